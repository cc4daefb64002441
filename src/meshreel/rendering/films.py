"""Films of selected frames, and their .mp4 (extra [video]) and .gif (extra [render]) files.

A film is drawn picture by picture while it is written.
"""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen
from tempfile import TemporaryFile

import numpy as np
from PIL import GifImagePlugin, ImageChops
from PIL import Image as PillowImage

from meshreel.errors import FormatError, InvalidInputError
from meshreel.model.frame_choice import spread_frames
from meshreel.model.timing import DUE_TOLERANCE, Timing
from meshreel.rendering.scenes import Scales, Scene
from meshreel.rendering.sheets import Sheet, Size, plan_sheet
from meshreel.rendering.shots import (
    ASPECT_FRAMES,
    Shot,
    draw_shots,
    frame_labels,
    framing_of,
    scene_annotations,
)
from meshreel.rendering.views import View
from meshreel.runtime.extras import VIDEO
from meshreel.runtime.outputs.atomic import replace_when_done
from meshreel.runtime.progress import Count, Progress, silent

FILM_PX, GIF_PX = (1280, 720), (800, 450)
"""Largest picture by default; large GIFs would be huge files."""

UNKNOWN_FPS = 24.0
"""Frame rate of films of sequences whose own is unknown."""

GIF_MAX_FPS = 50.0
"""Browsers slow down pictures that are shown for less than 2 hundredths of a second."""

N_PALETTE_PICTURES = 6
"""Pictures from which the palette of a .gif is chosen."""

_NEAR_BACKGROUND = 8

# Visually nearly lossless; BT.709, which players assume; and no metadata that differs between runs.
_MP4_OPTIONS = [
    "-c:v", "libx264", "-pix_fmt", "yuv420p",
    "-crf", "18", "-preset", "medium", "-threads", "1",
    "-vf", "scale=out_color_matrix=bt709:out_range=tv,"
    "setparams=colorspace=bt709:color_primaries=bt709:color_trc=bt709",
    "-movflags", "+faststart", "-map_metadata", "-1", "-fflags", "+bitexact",
    "-flags", "+bitexact",
]  # fmt: skip


@dataclass(frozen=True, eq=False)
class Film:
    """A film whose pictures are drawn during iteration."""

    scene: Scene
    scales: Scales
    sheet: Sheet
    shots: Sequence[Shot]
    """One for each picture."""
    fps: float
    """Pictures per second."""

    @property
    def n_pictures(self) -> int:
        """Number of pictures."""
        return len(self.shots)

    @property
    def size(self) -> Size:
        """Width and height of each picture, in pixels."""
        return self.sheet.layout.size

    def pictures(self, stride: int = 1, progress: Progress = silent) -> Iterator[PillowImage.Image]:
        """Yield every `stride`-th picture."""
        shots = self.shots[::stride]
        views_of_shots = draw_shots(self.scene, shots, self.scales)
        for n_done, ((number, _), views) in enumerate(zip(shots, views_of_shots, strict=True), 1):
            yield self.sheet.compose(views, frame_labels(self.scene, number))
            progress("drawing", Count(n_done, len(shots), "pictures"))


def film(
    scene: Scene,
    numbers: Sequence[int],
    view: View,
    *,
    size: Size | None = None,
    max_size: Size = FILM_PX,
    is_followed: bool | None = None,
    progress: Progress = silent,
) -> Film:
    """Prepare a film of selected frames at their frame rate.

    Frames in order that are not evenly spaced are shown when they are due, at their mean rate.

    Parameters
    ----------
    scene : Scene
        Plays at `UNKNOWN_FPS` if its frame rate is unknown.
    numbers : sequence of int
        Frame numbers, at least one.
    size : tuple of 2 ints, optional
        Width and height in pixels. Default: fits the content.
    max_size : tuple of 2 ints
        Limit of the default size.
    is_followed : bool, optional
        Whether the camera follows the mesh. Default: if the mesh would otherwise be small.
    progress : Progress, default silent
        Called while the frames of a heat map are measured.

    Raises
    ------
    InvalidInputError
        If the size is too small.
    """
    fps = scene.sequence.fps or UNKNOWN_FPS
    scales = scene.scales(numbers, progress)
    labels = [frame_labels(scene, number)[0] for number in numbers]
    annotations = scene_annotations(scene, scales, labels)
    sample = scene.frames(spread_frames(numbers, ASPECT_FRAMES))
    framing = framing_of(view, sample, is_followed=is_followed)
    layout = plan_sheet(
        annotations, len(annotations.titles), framing.aspect(sample), size, max_size
    )
    cameras = framing.cameras(scene.frames(numbers), *layout.view_size)
    shots = list(zip(numbers, cameras, strict=True))
    times = scene.sequence.timing.times
    if times is not None and len(numbers) > 1 and (np.diff(numbers) > 0).all():
        timing = Timing.of_times(times[list(numbers)])
        fps = timing.fps or fps
        due_times_s = (timing.start_s + (np.arange(len(numbers)) + DUE_TOLERANCE) / fps).tolist()
        shots = [shots[timing.frame_at(time, len(shots))] for time in due_times_s]
    return Film(scene, scales, Sheet(layout, annotations, scene.background), shots, fps)


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
    pictures = film.pictures(progress=progress)
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
            if encoder.stdin is None:
                raise OSError("ffmpeg has no standard input")
            with encoder.stdin as pipe:
                for picture in pictures:
                    pipe.write(picture.tobytes())
        if encoder.returncode:
            log.seek(0)
            reason = log.read().decode(errors="replace").strip() or f"code {encoder.returncode}"
            raise OSError(f"ffmpeg could not write {path}: {reason}")
        with temporary.open("ab") as file:
            file.write(appended)


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
    palette, period_s = _palette(film), stride / film.fps
    previous: PillowImage.Image | None = None
    with replace_when_done(path, overwrite=overwrite) as temporary, temporary.open("wb") as file:
        # `Image.save(save_all=True)` keeps all pictures in memory, for files of the same size.
        for number, picture in enumerate(film.pictures(stride, progress)):
            image = picture.quantize(palette=palette, dither=PillowImage.Dither.NONE)
            # End times, not durations, are rounded to hundredths of a second, so that errors do
            # not add up.
            begin, end = (round(100 * period_s * count) for count in (number, number + 1))
            duration, box = 10 * (end - begin), (0, 0, *image.size)
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
