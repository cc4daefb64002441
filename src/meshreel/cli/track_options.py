"""How exact tracks are to be, and how they are shown, as options of commands."""

from collections.abc import Sequence
from typing import Annotated

import typer

from meshreel.cli.completing import names_of

TrackOption = Annotated[
    list[str] | None,
    typer.Option(
        "--track",
        metavar="NAME=BOUND",
        help="How exact a track is to come back; once for each: stress=0.1% (of its range), "
        "stress=500Pa or =500 (in its unit), normal=0.5deg, colour=8bit, id=exact, velocity=drop. "
        "Default: normals 0.5deg, colours 8bit, integers exact, all others 0.1%.",
        rich_help_panel="What to meet (give one)",
    ),
]

COLORS = "Colours of a track"
ComponentOption = Annotated[
    str | None,
    typer.Option(
        metavar="x|y|z|magnitude|INDEX",
        autocompletion=names_of(["x", "y", "z", "magnitude"]),
        help="Which number of its values; INDEX from 0 on. Default: the magnitude of vectors, x of "
        "normals.",
        rich_help_panel=COLORS,
    ),
]
RangeOption = Annotated[
    str | None,
    typer.Option(
        metavar="LOW:HIGH",
        help="Numbers or percentiles where the colours end, as 0:500 or 2%:98%. Percentiles are of "
        "the frames shown, and as far on both sides of 0 where they lie on both. Default: 2%:98%; "
        "of normals -1:1.",
        rich_help_panel=COLORS,
    ),
]
ColormapOption = Annotated[
    str | None,
    typer.Option(
        metavar="sequential|diverging",
        autocompletion=names_of(["sequential", "diverging"]),
        help="Violet to yellow, or blue over grey to red. Default: the second if 0 is inside the "
        "range.",
        rich_help_panel=COLORS,
    ),
]


def track_targets(given: Sequence[str] | None) -> dict[str, float | str] | None:
    """What is asked of tracks, by their names, from texts such as stress=0.1%.

    Raises
    ------
    typer.BadParameter
        If a text has no name or no bound, or a name comes twice.
    """
    if not given:
        return None
    found: dict[str, float | str] = {}
    for text in given:
        name, equals, bound = text.partition("=")
        if not (name and equals and bound):
            raise typer.BadParameter(
                f"--track takes a name and a bound, as in stress=0.1%; got {text!r}"
            )
        if name in found:
            raise typer.BadParameter(f"--track names {name!r} twice; give it once")
        found[name] = bound
    return found
