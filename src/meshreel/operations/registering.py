"""Registration of the raw frames of an input, and of their textures."""

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

from meshreel.formats.needed_extras import REGISTRATION, extras_to_bake
from meshreel.formats.options import Reading
from meshreel.formats.remote import local_copy, remote_files
from meshreel.formats.segments import open_any
from meshreel.formats.sources import AnyPath, Source, find_files
from meshreel.model.notes import Notes
from meshreel.model.sequence import MeshSequence
from meshreel.registration.options import RegisterOptions
from meshreel.runtime.extras import Extra
from meshreel.runtime.progress import Progress, silent
from meshreel.runtime.stores.address import is_remote
from meshreel.runtime.workers.cluster import cluster_executor

if TYPE_CHECKING:
    from meshreel.codec.config import EncoderConfig
    from meshreel.codec.reel_file import ReelFile
    from meshreel.operations.textures import TextureJob
    from meshreel.registration.register import Registration
    from meshreel.registration.report import Report
    from meshreel.registration.runs import Open


MAX_LOADED_BYTES = 256 << 20
"""Raw frames up to this size are loaded; others stay in their files, and are read six times."""


def loading_raw(reading: Reading) -> Reading:
    """Return the options with which the raw frames of a capture are opened."""
    max_bytes = reading.max_loaded_bytes
    max_bytes = MAX_LOADED_BYTES if max_bytes is None else min(max_bytes, MAX_LOADED_BYTES)
    return replace(
        reading, max_loaded_bytes=max_bytes, matches_frames=False, finds_hard_edges=False
    )


def extras_to_register(options: RegisterOptions) -> list[Extra]:
    """Return the extras that registration and the textures need."""
    if options.texture is None:
        return [*REGISTRATION]
    return [*REGISTRATION, *extras_to_bake(options.texture, options.texture_output or "")]


def check_scheduler(options: RegisterOptions) -> None:
    """Raise InvalidInputError unless the scheduler answers; call it before long work."""
    if options.scheduler is not None:
        with cluster_executor(options.scheduler):
            pass


def open_part(source: Source, reading: Reading) -> Callable[[range], "Open"]:
    """Return a function that returns a function that opens a range of the frames of a source.

    Workers call the second one, so files must have the same path or address there.
    """
    reading = replace(loading_raw(reading), notes=Notes(), referenced=set[Path](), progress=silent)

    @cache
    def files() -> Sequence[AnyPath]:
        sources = [source] if isinstance(source, str | os.PathLike) else source
        is_elsewhere = any(map(is_remote, sources))
        return remote_files(source) if is_elsewhere else find_files(source).paths

    def of_frames(numbers: range) -> "Open":
        if len(files()) == 1:
            return partial(_opened, files(), reading, numbers)
        return partial(_opened, files()[numbers.start : numbers.stop], reading)

    return of_frames


@contextmanager
def _opened(
    files: Source, reading: Reading, numbers: range | None = None
) -> Iterator[MeshSequence]:
    with local_copy(files) as copies:
        sequence = open_any(find_files(copies), reading)
        yield sequence if numbers is None else sequence.part(numbers)


def register_frames(
    raw: MeshSequence,
    options: RegisterOptions,
    notes: Notes,
    progress: Progress,
    source: Callable[[range], "Open"] | None = None,
) -> "Registered":
    """Register raw frames, with texture coordinates that fit the textures.

    Parameters
    ----------
    source : callable, optional
        Opens frames on workers, as `open_part`. Default: frames are sent to them.

    Raises
    ------
    InvalidInputError, FormatError
        As `meshreel.register`.
    """
    from meshreel.registration.register import register_files  # imports SciPy

    job = None
    if options.texture is not None and options.texture_output is not None:
        from meshreel.operations.textures import TextureJob  # imports Pillow

        job = TextureJob.checked(options, raw, notes)
    registration = register_files(raw, replace(options, progress=progress), source)
    return Registered(registration if job is None else job.prepared(registration, notes), job)


@dataclass(frozen=True)
class Registered:
    """Registered frames, and their textures if they are to be baked."""

    registration: "Registration"
    job: "TextureJob | None" = None

    @property
    def sequence(self) -> MeshSequence:
        """The segments."""
        return self.registration.sequence

    def tuned(self, config: "EncoderConfig", notes: Notes) -> "EncoderConfig":
        """Return the options with which to encode the segments; see `Registration.tuned`."""
        return self.registration.tuned(config, notes, bakes_textures=self.job is not None)

    def report(self, decoded: "MeshSequence | ReelFile", progress: Progress) -> "Report":
        """Measure the distances of decoded segments from the raw frames."""
        from meshreel.registration.report import Report  # imports SciPy

        return Report.measured(self.registration, decoded, progress)

    def bake(
        self, sequence: "MeshSequence | ReelFile", progress: Progress, stream: bytes = b""
    ) -> None:
        """Write the textures, if there are any, for these segments; parameters as of the job."""
        if self.job is not None:
            self.job.write(self.registration, sequence, progress, stream)
