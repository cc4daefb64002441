"""The plot of a track: rate against largest error."""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from meshreel.evaluation.folder import file_name
from meshreel.evaluation.plots.axes import draw_envelopes
from meshreel.evaluation.tracks.results import TrackResults
from meshreel.rendering.documents.parts import Picture
from meshreel.rendering.plots import blank_figure, save_figure

CAPTION = (
    "Bits of the track alone by its numbers. A point is a stream; a line joins those that no other "
    "of its codec beats. Streams that lose nothing have no place on a log axis of errors."
)


def drawings(results: TrackResults, folder: Path) -> Iterator[Callable[[], Picture]]:
    """A function for the plot, if there are points."""
    if results.curves():
        yield partial(draw_curves, results, folder)


def draw_curves(results: TrackResults, folder: Path) -> Picture:
    """The plot of all codecs."""
    unit = results.track["error_unit"]
    figure = blank_figure(9.5, 5.6)
    draw_envelopes(
        figure.add_subplot(),
        results.curves(),
        f"largest error of {results.track['name']}" + (f", {unit}" if unit else ""),
        "bits per number",
    )
    path = folder / f"{results.slug}-{file_name(results.track['name'])}.png"
    save_figure(figure, path, overwrite=True)
    return Picture(path, f"Rate and largest error, {results.name}", CAPTION, 1)
