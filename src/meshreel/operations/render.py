"""Pictures and films of an animation."""

from contextlib import ExitStack
from pathlib import Path
from typing import Any

from meshreel.errors import InvalidInputError, Keyword
from meshreel.formats.options import Reading
from meshreel.formats.supported_options import check_supported, supported_only
from meshreel.model.notes import Notes
from meshreel.operations.inputs import check_inputs, chosen_frames, opened
from meshreel.rendering.cuts import parse_cut
from meshreel.rendering.looks import Look
from meshreel.rendering.views import guess_up, parse_view
from meshreel.runtime.extras import RENDER, VIDEO, VIDEO_PILLOW
from meshreel.runtime.outputs.checks import check_extension, check_output_path

EXTENSIONS = (".png", ".mp4", ".gif")
SHEET_FRAMES, COMPARED_FRAMES = 8, 3
"""Default numbers of frames on a contact sheet, and in a comparison with the original."""

FrameList = slice | tuple[int, ...] | None
"""A range of frames, frames by number, or all."""


def render(
    source: str,
    output: Path,
    look: Look,
    reading: Reading,
    *,
    original: str | None = None,
    frames: FrameList = None,
    overwrite: bool = False,
) -> dict[str, Any]:
    """Draw an animation into a picture (.png) or a film (.mp4, .gif); return its figures.

    A picture shows frames side by side: the given ones, or some of a range. With an original, each
    frame has a row: original, decoded and error. Options for reading apply to the files whose
    formats have them.

    Raises
    ------
    InvalidInputError, FormatError
        As `meshreel.load`; if frames, view or track do not exist; or if the output exists and
        `overwrite` is false.
    """
    is_film = output.suffix.lower() != ".png"
    check_extension(output, EXTENSIONS)
    # These raise before the files are read.
    parse_view(look.view, look.up or "y")
    cut, size = None if look.cut is None else parse_cut(look.cut), look.size_px
    sources = [source] if original is None else [source, original]
    drawing = [VIDEO, VIDEO_PILLOW] if output.suffix.lower() == ".mp4" else [RENDER]
    files = check_inputs(sources, *drawing)
    check_output_path(output, overwrite=overwrite, inputs=files)
    check_supported(sources, reading)
    from meshreel.model.frame_choice import spread_frames
    from meshreel.rendering.films import FILM_PX, GIF_PX, film, save_film
    from meshreel.rendering.scenes import Scene  # imports Pillow, whose extra is checked above
    from meshreel.rendering.shots import representative_frames
    from meshreel.rendering.stills import save_png, still

    with ExitStack() as stack:
        sequence, *others = [
            stack.enter_context(opened(item, supported_only(reading, item))) for item in sources
        ]
        numbers = _frame_numbers(frames, sequence.n_frames, reading.notes)
        scene = Scene(
            sequence, others[0] if others else None, look.heatmap,
            background=_color(look.background), track=look.track, cut=cut,
        )  # fmt: skip
        view = parse_view(look.view, look.up or guess_up(scene.framed_sequence.extent))
        if is_film:
            if sequence.timing.times is not None:
                text = (
                    f"frame times are uneven; the film has {sequence.fps:g} pictures per second, "
                    "each of the frame that is due"
                )
                reading.notes.changed("frame times", text)
            drawn = film(
                scene, numbers, view,
                size=size,
                max_size=GIF_PX if output.suffix.lower() == ".gif" else FILM_PX,
                is_followed=look.follow, progress=reading.progress,
            )  # fmt: skip
            save_film(drawn, output, overwrite=overwrite, progress=reading.progress)
            figures = {
                "size_px": list(drawn.size),
                "n_pictures": drawn.n_pictures,
                "fps": drawn.fps,
            }
        else:
            if not isinstance(frames, tuple):
                choose, n = spread_frames, SHEET_FRAMES
                if others:
                    choose, n = representative_frames, COMPARED_FRAMES
                numbers = choose(numbers, n)
            picture = still(
                scene, numbers, view,
                size=size, is_followed=look.follow, progress=reading.progress,
            )  # fmt: skip
            save_png(picture, output, overwrite=overwrite)
            figures = {"size_px": list(picture.size), "frames": numbers}
    return {"output": str(output), **figures, "size_bytes": output.stat().st_size}


def _color(text: str) -> tuple[int, int, int]:
    from PIL import ImageColor

    try:
        return ImageColor.getrgb(text)[:3]
    except ValueError:
        raise InvalidInputError(
            Keyword("background"),
            f" takes a name such as white or black, or #rrggbb; got {text!r}",
        ) from None


def _frame_numbers(frames: FrameList, n_frames: int, notes: Notes) -> list[int]:
    """Return the numbers of chosen frames; adds a note if a range exceeds the ends."""
    if not isinstance(frames, tuple):
        return list(chosen_frames(frames, n_frames, notes))
    try:
        return [range(n_frames)[number] for number in frames]
    except IndexError:
        listed = ",".join(map(str, frames))
        raise InvalidInputError(
            Keyword("frames"),
            f" {listed} names a frame that does not exist; there are frames 0 to {n_frames - 1}",
        ) from None
