"""Parse the options of `meshreel render`: frames, size, color, track."""

import re
from typing import TYPE_CHECKING

import click

from meshreel.app.cli.write_options import frame_slice

if TYPE_CHECKING:
    from meshreel.model.notes import Notes
    from meshreel.rendering.track_colors import TrackLook


def is_range(text: str | None) -> bool:
    """Whether --frames is A:B or absent, not a list."""
    return text is None or ":" in text


def frame_numbers(text: str | None, n_frames: int, notes: "Notes") -> list[int]:
    """The frames of 'A:B' or 'N,N,...', where -1 is the last; all by default.

    Adds a note if 'A:B' exceeds the ends.
    """
    from meshreel.operations.convert import chosen_frames

    if is_range(text):
        return list(chosen_frames(frame_slice(text), n_frames, notes))
    try:
        return [range(n_frames)[int(word)] for word in (text or "").split(",")]
    except ValueError:
        raise click.UsageError(
            f"--frames takes A:B or a list such as 0,10,20 with whole numbers; got {text!r}"
        ) from None
    except IndexError:
        raise click.UsageError(
            f"--frames {text} names a frame that does not exist; there are frames 0 to "
            f"{n_frames - 1}"
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


def parse_color(text: str) -> tuple[int, int, int]:
    """The color of a CSS name or #rrggbb; needs Pillow."""
    from PIL import ImageColor

    try:
        return ImageColor.getrgb(text)[:3]
    except ValueError:
        raise click.UsageError(
            f"--background takes a name such as white or black, or #rrggbb; got {text!r}"
        ) from None


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
