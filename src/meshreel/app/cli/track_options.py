"""Options for the error bounds of tracks."""

from collections.abc import Sequence
from typing import Annotated

import click

from meshreel.codec.option import Option

TrackOption = Annotated[
    tuple[str, ...],
    Option(
        "Error bound of a track, once per track: stress=0.1% (of its range), stress=500Pa or =500 "
        "(in its unit), stress=1kPa, normal=0.5deg, color=8bit, id=exact, velocity=drop. Default: "
        "that of --bound; without it, normals 0.5deg, colors 8bit, integers exact, others 0.1%.",
        metavar="NAME=BOUND",
        group="Tracks",
    ),
]


def track_targets(texts: Sequence[str] | None) -> dict[str, float | str] | None:
    """Error bounds by track name, from texts such as stress=0.1%.

    Raises
    ------
    click.UsageError
        If a text has no name, no bound or several, or a name is repeated.
    """
    if not texts:
        return None
    targets: dict[str, float | str] = {}
    for text in texts:
        name, equals, bound = text.partition("=")
        if not (name and equals and bound):
            raise click.UsageError(
                f"--track takes a name and a bound, as in stress=0.1%; got {text!r}"
            )
        if "=" in bound:
            raise click.UsageError(
                f"--track takes one name and bound; got {text!r}; repeat it for each track"
            )
        if name in targets:
            raise click.UsageError(f"--track names {name!r} twice; give it once")
        targets[name] = bound
    return targets
