"""Options of commands that draw meshes, derived from `rendering.looks`, and their frames."""

from dataclasses import replace
from typing import Annotated, Any

import click

from meshreel.app.cli.parameters import Group
from meshreel.app.cli.write_options import frame_slice
from meshreel.codec.option import options_of_fields
from meshreel.rendering.looks import Look, TrackLook

_NAME, *_OF_TRACK = options_of_fields(TrackLook)
_TRACK = replace(_NAME, name="track", default=None), *_OF_TRACK


def _track_look(values: dict[str, Any]) -> TrackLook | None:
    """Take the options of a track from values; None without a track."""
    name, *others = (values.pop(option.name) for option in _TRACK)
    if name is not None:
        return TrackLook(name, *others)
    for option, value in zip(_OF_TRACK, others, strict=True):
        if value is not None:
            raise click.UsageError(f"{option.flag} applies to a track; name it with --track")
    return None


TrackLookOption = Annotated[TrackLook | None, Group(_TRACK, _track_look)]
LookOption = Annotated[
    Look,
    Group(
        (*options_of_fields(Look), *_TRACK),
        lambda values: Look(track=_track_look(values), **values),
    ),
]


def frame_list(text: str | None) -> slice | tuple[int, ...] | None:
    """The frames of 'A:B' or 'N,N,...', where -1 is the last; None for all."""
    if text is None or ":" in text:
        return frame_slice(text)
    try:
        return tuple(map(int, text.split(",")))
    except ValueError:
        raise click.UsageError(
            f"--frames takes A:B or a list such as 0,10,20 with whole numbers; got {text!r}"
        ) from None
