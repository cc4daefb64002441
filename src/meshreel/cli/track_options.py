"""How exact tracks are to be, as options of commands."""

from collections.abc import Sequence
from typing import Annotated

import typer

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
