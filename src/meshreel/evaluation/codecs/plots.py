"""Rate-distortion plots of our methods, other codecs and recorded points."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path

from meshreel.evaluation.codecs.results import ERRORS, RECORDED, CodecResults, family
from meshreel.evaluation.folder import file_name
from meshreel.evaluation.plots.axes import draw_envelopes
from meshreel.evaluation.rate_distortion import Point
from meshreel.rendering.documents.parts import Picture
from meshreel.rendering.plots import blank_figure, save_figure

TITLES = {
    "kg_error_percent": "Rate and KG error",
    "sted": "Rate and STED",
    "max_error_percent": "Rate and largest error",
}


def drawings(results: CodecResults, folder: Path) -> Iterator[Callable[[], Picture]]:
    """A function for each plot, of rate against an error that has points."""
    for error in ERRORS:
        curves = shown_curves(results.curves(error))
        if curves:
            yield partial(draw_curves, results, error, curves, folder)


def draw_curves(
    results: CodecResults, error: str, curves: Mapping[str, Sequence[Point]], folder: Path
) -> Picture:
    """The plot of curves of rate against this error."""
    figure = blank_figure(9.5, 5.6)
    draw_envelopes(figure.add_subplot(), curves, ERRORS[error])
    path = folder / f"{results.slug}-{file_name(error)}.png"
    save_figure(figure, path, overwrite=True)
    return Picture(path, f"{TITLES[error]}, {results.name}", _caption(curves), 1)


def shown_curves(curves: Mapping[str, Sequence[Point]]) -> dict[str, Sequence[Point]]:
    """The curves without those recorded ones whose codec was measured here."""
    measured = {family(label) for label in curves if not label.endswith(RECORDED)}
    return {
        label: points
        for label, points in curves.items()
        if not label.endswith(RECORDED) or family(label) not in measured
    }


def _caption(curves: Mapping[str, Sequence[Point]]) -> str:
    text = (
        "Rate of the whole with the order dropped. A point is a stream; a line joins those that no "
        "other of its codec beats. Lossless codecs have no place on a log axis of errors."
    )
    if any(label.endswith(RECORDED) for label in curves):
        text += (
            " Dashed: recorded elsewhere; those of codecs that were measured here are left out, "
            "and stand in the tables."
        )
    return text
