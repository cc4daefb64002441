"""Textures of raw frames: reading, baking for registered segments, and writing."""

import glob
import os
from collections.abc import Generator, Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen, run

from PIL import Image as PillowImage
from PIL import UnidentifiedImageError

from meshreel.codec.reel_file import ReelFile
from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.file_errors import check_input_file
from meshreel.formats.needed_extras import VIDEOS
from meshreel.formats.outputs import numbered_paths
from meshreel.formats.sources import NUMBER_FIELD, Source, natural_order
from meshreel.kernel.mp4 import reel_box
from meshreel.model.notes import Notes
from meshreel.model.sequence import MeshSequence
from meshreel.registration.baking import COMBINE, Size, bake, check_textured, with_atlases
from meshreel.registration.options import RegisterOptions
from meshreel.registration.register import Registration
from meshreel.rendering.films import UNKNOWN_FPS, write_mp4
from meshreel.runtime.counting import counted
from meshreel.runtime.extras import VIDEO
from meshreel.runtime.outputs.atomic import replace_all_when_done
from meshreel.runtime.outputs.checks import check_extension, check_output_paths
from meshreel.runtime.progress import Progress, silent

OUTPUT_EXTENSIONS = (".mp4", ".png")


@dataclass(frozen=True)
class TextureFrames:
    """The texture of each frame, in image files or a video."""

    paths: tuple[Path, ...]
    """A video, or an image of each frame."""
    n_frames: int
    size: Size
    """Width and height of the first image."""

    def images(self) -> Iterator[PillowImage.Image]:
        """Yield the image of each frame, in RGB."""
        is_video = self.paths[0].suffix.lower() in VIDEOS
        return _decode_video(self.paths[0]) if is_video else map(_open_image, self.paths)


def open_textures(source: Source) -> TextureFrames:
    """Return the textures of a folder, pattern or list of images, or of a video.

    Images of folders and patterns are in natural order; a list keeps its order.

    Raises
    ------
    InvalidInputError
        If there are no images.
    FormatError
        If a file is neither an image nor a video, or reading the video needs an extra.
    """
    paths = _texture_files(source)
    if not paths:
        raise InvalidInputError(f"{source} contains no texture images; check it")
    for path in paths:
        check_input_file(path)
    if paths[0].suffix.lower() in VIDEOS:
        if len(paths) > 1:
            raise InvalidInputError(f"{source} contains {len(paths)} videos; choose one")
        with closing(_decode_video(paths[0])) as pictures:
            try:
                n_frames, _ = VIDEO.load().count_frames_and_secs(str(paths[0]))
            except (OSError, RuntimeError) as error:
                raise FormatError(f"{paths[0]} is not a video that ffmpeg reads") from error
            return TextureFrames(paths, int(n_frames), next(pictures).size)
    return TextureFrames(paths, len(paths), _open_image(paths[0]).size)


@dataclass(frozen=True)
class TextureJob:
    """Textures to bake once their frames are registered, and where to write them."""

    textures: TextureFrames
    output: Path
    """A video (.mp4), or a pattern of images (``%04d.png``)."""
    overwrite: bool
    """Whether existing files may be replaced."""
    sound: tuple[str, ...] = ()
    """Arguments of ffmpeg that store the sound in the video."""

    @classmethod
    def checked(cls, options: RegisterOptions, raw: MeshSequence, notes: Notes) -> "TextureJob":
        """Return a job for raw frames; call it before registration to fail early.

        Raises
        ------
        InvalidInputError
            If the numbers of textures and frames differ, a frame has no texture
            coordinates or several images, or the output cannot or must not be written.
        FormatError
            As `open_textures`; also if writing a video needs an extra, or ffmpeg reads no sound.
        """
        textures = open_textures(options.texture or ())
        path, overwrite = Path(options.texture_output or ""), options.overwrite
        if textures.n_frames != raw.n_frames:
            has_several = textures.n_frames % raw.n_frames == 0
            raise InvalidInputError(
                f"there are {counted(textures.n_frames, 'texture')} for "
                f"{counted(raw.n_frames, 'frame')}; each frame needs one"
                + (f"; {COMBINE}" if has_several else "")
            )
        check_textured(raw)
        job = cls(textures, path, overwrite)
        check_extension(path, OUTPUT_EXTENSIONS)
        if job.is_video:
            VIDEO.load()
        check_output_paths(
            job.paths, overwrite=overwrite, inputs=textures.paths, makes_folder=not job.is_video
        )
        if options.sound is None:
            return job
        duration_s = raw.n_frames / (raw.fps or UNKNOWN_FPS)
        return replace(job, sound=_sound(Path(options.sound), duration_s, raw.fps, notes))

    @property
    def is_video(self) -> bool:
        """Whether one file contains all textures."""
        return self.output.suffix.lower() == ".mp4"

    @property
    def paths(self) -> list[Path]:
        """The files that the job writes."""
        field = NUMBER_FIELD.search(self.output.name)
        if self.is_video == (field is not None):
            raise InvalidInputError(
                f"{self.output}: name a video (walk.mp4), or images by a pattern (walk_%04d.png)"
            )
        if field is None:
            return [self.output]
        return numbered_paths(self.output, field, range(self.textures.n_frames))

    @property
    def size(self) -> Size:
        """Width and height of the textures: those of the first image, even for a video."""
        width, height = self.textures.size
        return (width + width % 2, height + height % 2) if self.is_video else (width, height)

    def prepared(self, registration: Registration, notes: Notes) -> Registration:
        """Return a registration with texture coordinates that fit; call it before encoding."""
        registration, n_atlases = with_atlases(registration, self.size)
        if n_atlases:
            notes.changed(
                f"made new texture coordinates for {counted(n_atlases, 'segment')}, because "
                "triangles of the key share texels or have none; omitted materials of the key"
            )
        return registration

    def write(
        self,
        registration: Registration,
        sequence: MeshSequence | ReelFile,
        progress: Progress = silent,
        stream: bytes = b"",
    ) -> None:
        """Write the textures for a registered sequence; arguments as `bake`.

        The video also contains the `.reel` in `stream`, if there is one.
        """
        images = self.textures.images()
        pictures = bake(registration, sequence, images, self.size, progress)
        if self.is_video:
            fps = registration.sequence.fps or UNKNOWN_FPS
            write_mp4(
                pictures, self.output, self.size, fps, overwrite=self.overwrite,
                sound=self.sound, appended=reel_box(stream) if stream else b"",
            )  # fmt: skip
            return
        with replace_all_when_done(
            self.paths, overwrite=self.overwrite, makes_folder=True
        ) as temporaries:
            for path, picture in zip(temporaries, pictures, strict=True):
                picture.save(path)


def _texture_files(source: Source) -> tuple[Path, ...]:
    if not isinstance(source, str | os.PathLike):
        return tuple(Path(file) for file in source)
    path = Path(source)
    if path.is_dir():
        files: Iterable[Path] = (file for file in path.iterdir() if file.name[0] != ".")
    elif path.exists() or not glob.has_magic(str(source)):
        return (path,)
    else:
        files = map(Path, glob.glob(str(source), recursive=True))
    return tuple(natural_order(file for file in files if file.is_file()))


def _sound(path: Path, duration_s: float, fps: float, notes: Notes) -> tuple[str, ...]:
    """Return the arguments of ffmpeg for the sound of a take; notes a difference in length."""
    check_input_file(path)
    # Samples of a byte, a thousand per second, measure the length of any input.
    command = [
        VIDEO.load().get_ffmpeg_exe(), "-i", str(path),
        "-map", "0:a:0", "-ac", "1", "-ar", "1000", "-f", "u8", "-",
    ]  # fmt: skip
    result = run(command, stdin=DEVNULL, capture_output=True, check=False)
    if result.returncode:
        raise FormatError("is not a file with sound that ffmpeg reads", path=path)
    sound_s = len(result.stdout) / 1000
    if abs(sound_s - duration_s) > 1 / (fps or UNKNOWN_FPS):
        end = "its end is left out" if sound_s > duration_s else "the end is silent"
        notes.changed(f"{path} lasts {sound_s:.2f} s, and the take {duration_s:.2f} s: {end}")
    codec = ["copy"] if b"Audio: aac" in result.stderr else ["aac", "-b:a", "160k"]
    maps = ["-map", "0:v:0", "-map", "1:a:0", "-t", f"{duration_s:.6f}"]
    return "-i", str(path), *maps, "-c:a", *codec


def _decode_video(path: Path) -> Generator[PillowImage.Image, None, None]:
    """Yield every stored picture of a video."""
    command = [
        VIDEO.load().get_ffmpeg_exe(), "-v", "quiet", "-i", str(path),
        "-fps_mode", "passthrough", "-f", "image2pipe", "-c:v", "ppm", "-",
    ]  # fmt: skip
    with Popen(command, stdin=DEVNULL, stdout=PIPE) as decoder:
        assert decoder.stdout is not None
        try:
            while decoder.stdout.readline():  # each picture begins with three lines
                width, height = map(int, decoder.stdout.readline().split())
                decoder.stdout.readline()
                data = decoder.stdout.read(3 * width * height)
                yield PillowImage.frombytes("RGB", (width, height), data)
        finally:
            decoder.kill()


def _open_image(path: Path) -> PillowImage.Image:
    try:
        with PillowImage.open(path) as image:
            return image.convert("RGB")
    except FileNotFoundError:
        raise InvalidInputError(f"there is no texture {str(path)!r}; check it") from None
    except UnidentifiedImageError:
        raise FormatError(f"{path} is neither an image (.png, .jpg, ...) nor a video") from None
    except OSError as error:
        raise FormatError(f"{path} is damaged: {error}") from error
