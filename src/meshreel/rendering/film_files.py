"""Write films to .mp4 (extra [video]) and .gif (extra [render]), picture by picture."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen
from tempfile import TemporaryFile
from typing import IO, BinaryIO

import numpy as np
from PIL import GifImagePlugin, ImageChops
from PIL import Image as PillowImage

from meshreel.errors import FormatError, InvalidInputError
from meshreel.rendering.films import Film
from meshreel.runtime.extras import VIDEO
from meshreel.runtime.outputs.atomic import replace_when_done
from meshreel.runtime.progress import Count, Progress, silent

GIF_MAX_FPS = 50.0
"""Browsers slow down pictures that are shown for less than 2 hundredths of a second."""

N_PALETTE_PICTURES = 6
"""Pictures from which the palette of a .gif is chosen."""

_NEAR_BACKGROUND = 8

_QUALITY = "18"  # of x264: visually nearly lossless


def save_film(
    film: Film, path: Path, *, overwrite: bool = False, progress: Progress = silent
) -> None:
    """Write a film to .mp4 with `write_mp4` or to .gif with `save_gif`.

    Raises
    ------
    FormatError
        If the path has another file extension.
    """
    extension = path.suffix.lower()
    if extension == ".gif":
        return save_gif(film, path, overwrite=overwrite, progress=progress)
    if extension != ".mp4":
        raise FormatError(f"{path}: films are .mp4 and .gif files")
    pictures = _pictures(film, 1, progress)
    return write_mp4(pictures, path, film.size, film.fps, overwrite=overwrite)


def write_mp4(
    pictures: Iterable[PillowImage.Image],
    path: Path,
    size: tuple[int, int],
    fps: float,
    *,
    overwrite: bool = False,
    sound: Sequence[str] = (),
    appended: bytes = b"",
) -> None:
    """Write RGB pictures of one size as H.264, atomically.

    `sound` are the arguments of ffmpeg for sound, and `appended` is a box for the end of the file.

    Raises
    ------
    InvalidInputError
        If a side is odd, or the path cannot or must not be written.
    FormatError
        If imageio_ffmpeg is not installed.
    """
    ffmpeg = VIDEO.load()
    width, height = size
    if width % 2 or height % 2:
        raise InvalidInputError(f"an .mp4 needs an even width and height; got {width} x {height}")
    with replace_when_done(path, overwrite=overwrite) as temporary, TemporaryFile() as log:
        command = [
            ffmpeg.get_ffmpeg_exe(), "-y", "-loglevel", "error",
            "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{fps:g}",
            "-i", "-", *(sound or ["-an"]), *_MP4_OPTIONS, str(temporary),
        ]  # fmt: skip
        with (
            Popen(command, stdin=PIPE, stdout=DEVNULL, stderr=log) as encoder,
            suppress(BrokenPipeError),  # ffmpeg ended early; its exit code is checked below
        ):
            _feed(encoder.stdin, pictures)
        if encoder.returncode:
            log.seek(0)
            reason = log.read().decode(errors="replace").strip() or f"code {encoder.returncode}"
            raise OSError(f"ffmpeg could not write {path}: {reason}")
        with temporary.open("ab") as file:
            file.write(appended)


def _feed(pipe: IO[bytes] | None, pictures: Iterable[PillowImage.Image]) -> None:
    if pipe is None:
        raise OSError("ffmpeg has no standard input")
    with pipe:
        for picture in pictures:
            pipe.write(picture.tobytes())


# BT.709, which players assume, and no metadata that differs between runs.
_MP4_OPTIONS = [
    "-c:v", "libx264", "-pix_fmt", "yuv420p",
    "-crf", _QUALITY, "-preset", "medium", "-threads", "1",
    "-vf", "scale=out_color_matrix=bt709:out_range=tv,"
    "setparams=colorspace=bt709:color_primaries=bt709:color_trc=bt709",
    "-movflags", "+faststart", "-map_metadata", "-1", "-fflags", "+bitexact",
    "-flags", "+bitexact",
]  # fmt: skip


def save_gif(
    film: Film, path: Path, *, overwrite: bool = False, progress: Progress = silent
) -> None:
    """Write a film as an endlessly looping GIF, atomically.

    All pictures share one palette, and each contains only the changed rectangle. Pictures are
    skipped at regular intervals to stay below `GIF_MAX_FPS`.

    Parameters
    ----------
    overwrite : bool
        Whether an existing file may be replaced.

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
        _write_gif(file, _pictures(film, stride, progress), _palette(film), stride / film.fps)


def _write_gif(
    file: BinaryIO,
    pictures: Iterator[PillowImage.Image],
    palette: PillowImage.Image,
    period_s: float,
) -> None:
    # `Image.save(save_all=True)` keeps all pictures in memory, for files of the same size.
    previous: PillowImage.Image | None = None
    for number, picture in enumerate(pictures):
        image = picture.quantize(palette=palette, dither=PillowImage.Dither.NONE)
        # End times, not durations, are rounded to hundredths of a second, so that errors do not
        # add up.
        duration = 10 * (round(100 * period_s * (number + 1)) - round(100 * period_s * number))
        box = (0, 0, *image.size)
        if previous is None:
            header, _ = GifImagePlugin.getheader(image, info={"loop": 0, "duration": duration})
            file.writelines(header)
        else:
            box = ImageChops.difference(picture, previous).getbbox() or (0, 0, 1, 1)
        part = image.crop(box)
        file.writelines(GifImagePlugin.getdata(part, box[:2], duration=duration, disposal=1))
        previous = picture
    file.write(b";")


def _palette(film: Film) -> PillowImage.Image:
    """The background and up to 255 colors, chosen from pictures spread over the film."""
    stride = -(-film.n_pictures // N_PALETTE_PICTURES)
    samples = list(film.pictures(stride))
    width, height = film.size
    sheet = PillowImage.new("RGB", (width, height * len(samples)))
    for number, sample in enumerate(samples):
        sheet.paste(sample, (0, number * height))
    channels = sheet.quantize(255, method=PillowImage.Quantize.MEDIANCUT).getpalette() or []
    colors, background = np.array(channels[: 3 * 255]).reshape(-1, 3), film.scene.background
    # Pillow looks up colors in coarse boxes and would map the background to a color near it.
    is_distinct = np.abs(colors - np.array(background)).max(axis=1) > _NEAR_BACKGROUND
    palette = PillowImage.new("P", (1, 1))
    palette.putpalette([*background, *colors[is_distinct].ravel().tolist()])
    return palette


def _pictures(film: Film, stride: int, progress: Progress) -> Iterator[PillowImage.Image]:
    total = -(-film.n_pictures // stride)
    for n_done, picture in enumerate(film.pictures(stride), 1):
        yield picture
        progress("drawing", Count(n_done, total, "pictures"))
