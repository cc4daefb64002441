"""Films as files: .mp4 by the extra [video], .gif by Pillow; pictures are written as they come."""

from collections.abc import Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen
from tempfile import TemporaryFile
from typing import IO, Any, BinaryIO

import numpy as np
from PIL import GifImagePlugin, ImageChops
from PIL import Image as PillowImage

from meshreel.errors import FormatError, InvalidInputError
from meshreel.rendering.films import Film
from meshreel.runtime.outputs.atomic import replace_when_done
from meshreel.runtime.progress import Count, Progress, silent

GIF_MAX_FPS = 50.0
"""Browsers slow down what is shown for less than 2 hundredths of a second."""

N_PALETTE_PICTURES = 6
"""Pictures that the colours of a .gif are chosen from."""

_NEAR_BACKGROUND = 8

_QUALITY = "18"  # of x264: differences from the pictures are hard to see


def require_ffmpeg() -> Any:
    """The library that brings ffmpeg; asked for before long work, it fails early.

    Raises
    ------
    FormatError
        If it is not installed.
    """
    try:
        return import_module("imageio_ffmpeg")
    except ImportError as error:
        raise FormatError(
            "writing .mp4 needs imageio-ffmpeg: pip install 'meshreel[video]'; "
            ".gif and .png need nothing more"
        ) from error


def save_film(
    film: Film, path: Path, *, overwrite: bool = False, progress: Progress = silent
) -> None:
    """Write a film as its ending says: .mp4 by `save_mp4`, .gif by `save_gif`.

    Raises
    ------
    FormatError
        If the ending is another.
    """
    writers = {".mp4": save_mp4, ".gif": save_gif}
    if path.suffix.lower() not in writers:
        raise FormatError(f"{path}: films are {' and '.join(writers)} files")
    writers[path.suffix.lower()](film, path, overwrite=overwrite, progress=progress)


def save_mp4(
    film: Film, path: Path, *, overwrite: bool = False, progress: Progress = silent
) -> None:
    """Write a film as H.264, whole or not at all.

    Parameters
    ----------
    film : Film
        Its width and height must be even.
    overwrite : bool
        Whether a file that is there already may be replaced.
    progress : Progress, default silent

    Raises
    ------
    InvalidInputError
        If a side is odd, or the path cannot or must not be written.
    FormatError
        If the library that writes it is not installed.
    """
    ffmpeg = require_ffmpeg()
    if film.size[0] % 2 or film.size[1] % 2:
        raise InvalidInputError(
            f"an .mp4 needs an even width and height; got {film.size[0]} x {film.size[1]}"
        )
    width, height = film.size
    with replace_when_done(path, overwrite=overwrite) as temporary, TemporaryFile() as said:
        command = [
            ffmpeg.get_ffmpeg_exe(), "-y", "-loglevel", "error",
            "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{film.fps:g}",
            "-i", "-", *_MP4_OPTIONS, str(temporary),
        ]  # fmt: skip
        with (
            Popen(command, stdin=PIPE, stdout=DEVNULL, stderr=said) as encoder,
            suppress(BrokenPipeError),  # it ended early; why is asked below
        ):
            _feed(encoder.stdin, film, progress)
        if encoder.returncode:
            said.seek(0)
            reason = said.read().decode(errors="replace").strip() or f"code {encoder.returncode}"
            raise OSError(f"ffmpeg could not write {path}: {reason}")


def _feed(pipe: IO[bytes] | None, film: Film, progress: Progress) -> None:
    if pipe is None:
        raise OSError("ffmpeg takes no pictures")
    with pipe:
        for picture in _told(film, 1, progress):
            pipe.write(picture.tobytes())


# Colours as players expect them; nothing that differs from one run to the next.
_MP4_OPTIONS = [
    "-an", "-c:v", "libx264", "-pix_fmt", "yuv420p",
    "-crf", _QUALITY, "-preset", "medium", "-threads", "1",
    "-vf", "scale=out_color_matrix=bt709:out_range=tv,"
    "setparams=colorspace=bt709:color_primaries=bt709:color_trc=bt709",
    "-movflags", "+faststart", "-map_metadata", "-1", "-fflags", "+bitexact",
    "-flags:v", "+bitexact",
]  # fmt: skip


def save_gif(
    film: Film, path: Path, *, overwrite: bool = False, progress: Progress = silent
) -> None:
    """Write a film as a GIF that repeats for ever, whole or not at all.

    All pictures share one palette, and each holds only the part that changed. Of a film of more
    than `GIF_MAX_FPS`, every second picture is taken, or as few as needed.

    Parameters
    ----------
    overwrite : bool
        Whether a file that is there already may be replaced.
    progress : Progress, default silent

    Raises
    ------
    InvalidInputError
        If the path cannot or must not be written.
    """
    stride = 1
    while film.fps / stride > GIF_MAX_FPS:
        stride += 1
    with (
        replace_when_done(path, overwrite=overwrite) as temporary,
        temporary.open("wb") as file,
    ):
        palette = _palette(film)
        _write_gif(file, _told(film, stride, progress), palette, stride / film.fps)


def _write_gif(
    file: BinaryIO,
    pictures: Iterator[PillowImage.Image],
    palette: PillowImage.Image,
    shown_s: float,
) -> None:
    before: PillowImage.Image | None = None
    for number, picture in enumerate(pictures):
        image = picture.quantize(palette=palette, dither=PillowImage.Dither.NONE)
        # Hundredths of a second are rounded so that the whole lasts as long as it should.
        duration = 10 * (round(100 * shown_s * (number + 1)) - round(100 * shown_s * number))
        box = (0, 0, *image.size)
        if before is None:
            header, _ = GifImagePlugin.getheader(image, info={"loop": 0, "duration": duration})
            file.writelines(header)
        else:
            box = ImageChops.difference(picture, before).getbbox() or (0, 0, 1, 1)
        part = image.crop(box)
        file.writelines(GifImagePlugin.getdata(part, box[:2], duration=duration, disposal=1))
        before = picture
    file.write(b";")


def _palette(film: Film) -> PillowImage.Image:
    """The background, and 255 colours that suit pictures from all over the film."""
    stride = -(-film.n_pictures // N_PALETTE_PICTURES)
    samples = list(film.pictures(stride))
    width, height = film.size
    sheet = PillowImage.new("RGB", (width, height * len(samples)))
    for number, sample in enumerate(samples):
        sheet.paste(sample, (0, number * height))
    found = sheet.quantize(255, method=PillowImage.Quantize.MEDIANCUT).getpalette() or []
    colors, background = np.array(found[: 3 * 255]).reshape(-1, 3), film.scene.background
    # Pillow looks colours up in coarse boxes: one near the background would be taken for it.
    is_apart = np.abs(colors - np.array(background)).max(axis=1) > _NEAR_BACKGROUND
    palette = PillowImage.new("P", (1, 1))
    palette.putpalette([*background, *colors[is_apart].ravel().tolist()])
    return palette


def _told(film: Film, stride: int, progress: Progress) -> Iterator[PillowImage.Image]:
    total = -(-film.n_pictures // stride)
    for done, picture in enumerate(film.pictures(stride), 1):
        yield picture
        progress("drawing", Count(done, total, "pictures"))
