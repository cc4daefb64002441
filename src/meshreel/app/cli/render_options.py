"""Parse the options of `meshreel render`: frames, size, color, track."""

import re
from typing import TYPE_CHECKING

import click

from meshreel.app.cli.write_options import frame_slice

if TYPE_CHECKING:
    from meshreel.rendering.track_colors import TrackLook


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


def picture_size(text: str | None) -> tuple[int, int] | None:
    """Width and height of 'WxH'."""
    if text is None:
        return None
    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text.lower())
    if not match:
        message = f"--size takes WIDTHxHEIGHT in pixels, such as 1280x720; got {text!r}"
        raise click.UsageError(message)
    return int(match[1]), int(match[2])


def track_look(
    track: str | None,
    component: str | None,
    ends: str | None,
    colormap: str | None,
    heatmap: str | None = None,
) -> "TrackLook | None":
    """The look of a track; None without a track.

    Raises
    ------
    click.UsageError
        If options for the look are set without a track.
    """
    from meshreel.rendering.colormap import check_colormap
    from meshreel.rendering.scenes import TRACK_HEAT
    from meshreel.rendering.track_colors import TrackLook, parse_range

    if track is None:
        options = {"--component": component, "--range": ends, "--colormap": colormap}
        unused = next((name for name, value in options.items() if value is not None), None)
        if heatmap == TRACK_HEAT:
            raise click.UsageError("--heatmap track shows the error of a track; name it: --track")
        if unused:
            raise click.UsageError(f"{unused} applies to a track; name it with --track")
        return None
    if ends is not None:
        parse_range(ends)
    if colormap is not None:
        check_colormap(colormap)
    return TrackLook(track, component, ends, colormap)
