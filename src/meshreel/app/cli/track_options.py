"""How exact tracks are to be, and how they are shown, as options of commands."""

from collections.abc import Sequence

import click

from meshreel.app.cli.completing import names_of
from meshreel.app.cli.parameters import option

track_option = option(
    "--track",
    multiple=True,
    metavar="NAME=BOUND",
    help="How exact a track is to come back; once for each: stress=0.1% (of its range), "
    "stress=500Pa or =500 (in its unit), normal=0.5deg, colour=8bit, id=exact, velocity=drop. "
    "Default: normals 0.5deg, colours 8bit, integers exact, all others 0.1%.",
    panel="What to meet (give one)",
)

COLORS = "Colours of a track"
component_option = option(
    "--component",
    metavar="x|y|z|magnitude|INDEX",
    completion=names_of(["x", "y", "z", "magnitude"]),
    help="Which number of its values; INDEX counts from 0. Default: the magnitude of vectors, x of "
    "normals.",
    panel=COLORS,
)
range_option = option(
    "--range",
    metavar="LOW:HIGH",
    help="Numbers or percentiles where the colours end, as 0:500 or 2%:98%. Percentiles are of "
    "the frames shown, and as far on both sides of 0 where they lie on both. Default: 2%:98%; "
    "of normals -1:1.",
    panel=COLORS,
)
colormap_option = option(
    "--colormap",
    metavar="sequential|diverging",
    completion=names_of(["sequential", "diverging"]),
    help="Violet to yellow, or blue over grey to red. Default: the second if 0 is inside the "
    "range.",
    panel=COLORS,
)


def track_targets(given: Sequence[str] | None) -> dict[str, float | str] | None:
    """Error bounds by track name, from texts such as stress=0.1%.

    Raises
    ------
    click.UsageError
        If a text has no name or no bound, or a name comes twice.
    """
    if not given:
        return None
    found: dict[str, float | str] = {}
    for text in given:
        name, equals, bound = text.partition("=")
        if not (name and equals and bound):
            raise click.UsageError(
                f"--track takes a name and a bound, as in stress=0.1%; got {text!r}"
            )
        if name in found:
            raise click.UsageError(f"--track names {name!r} twice; give it once")
        found[name] = bound
    return found
