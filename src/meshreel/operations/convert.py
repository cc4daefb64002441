"""Writing the sequence of any input: as a .reel with measured errors, or in another format."""

import shutil
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from itertools import pairwise, starmap
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshreel.codec.config import EncoderConfig
from meshreel.codec.options import config_of
from meshreel.codec.reel_options import quality_of
from meshreel.errors import InvalidInputError, Keyword
from meshreel.formats.file_errors import errors_naming
from meshreel.formats.load import loading_for
from meshreel.formats.needed_extras import extras_to_read, extras_to_write
from meshreel.formats.options import Reading, WriteOptions
from meshreel.formats.outputs import DEFAULT_OPTIONS, check_output, numbering
from meshreel.formats.reel import note_video, origin_of_file
from meshreel.formats.reel import open as open_reel
from meshreel.formats.registry import FRAME_FORMATS, STREAMS
from meshreel.formats.save import save_part
from meshreel.formats.segments import open_any
from meshreel.formats.sources import AnyPath, Source, find_files
from meshreel.model.frame_choice import frame_range
from meshreel.model.notes import Notes
from meshreel.model.sequence import MeshSequence
from meshreel.operations.encoding import Encoded, encode_and_measure
from meshreel.operations.inputs import chosen_frames, local_input
from meshreel.operations.registering import (
    Registered,
    check_scheduler,
    extras_to_register,
    loading_raw,
    open_part,
    register_frames,
)
from meshreel.operations.rigs import fit_rig
from meshreel.registration.options import RegisterOptions
from meshreel.runtime.extras import require
from meshreel.runtime.outputs.atomic import replace_when_done
from meshreel.runtime.outputs.checks import check_output_path
from meshreel.runtime.progress import Progress, silent
from meshreel.runtime.stores.address import STANDARD_INPUT, is_remote

if TYPE_CHECKING:
    from meshreel.formats.options import AnySource
    from meshreel.registration.report import Report


def is_stream(output: AnyPath) -> bool:
    """Whether an output is, or contains, a .reel."""
    return Path(output).suffix.lower() in STREAMS


@dataclass(frozen=True, kw_only=True)
class Target:
    """What to write, and how."""

    output: AnyPath
    config: EncoderConfig = field(default_factory=config_of)
    """Options of a .reel; its memory limit also applies to reading for other outputs."""
    tracks: Mapping[str, float | str] | None = None
    """Error bounds of the tracks of a .reel."""
    options: WriteOptions = DEFAULT_OPTIONS
    """Options of other formats."""
    start_number: int | None = None
    overwrite: bool = False

    def check(self, inputs: Sequence[Path], frames: range | None = None, *, first: int = 0) -> None:
        """Raise if the output cannot be written or would replace a file; call it before long work.

        Parameters
        ----------
        inputs : sequence of Path
            Files that are never replaced.
        frames : range, optional
            The frames to write. Default: unknown.
        first : int, default 0
            Number of the first frame of the sequence in its input.
        """
        check_output(
            self.output,
            None if frames is None else len(frames),
            overwrite=self.overwrite,
            start_number=self._number(frames or range(1), first),
            inputs=inputs,
            options=self.options,
        )

    def write(
        self,
        sequence: "AnySource",
        frames: range,
        inputs: Sequence[Path],
        notes: Notes,
        progress: Progress,
        *,
        first: int = 0,
    ) -> "Written":
        """Write these frames of a sequence; parameters as of `check`. A .mp4 is only encoded."""
        sizes = [(segment.n_verts, len(segment.faces)) for segment in sequence.segments]
        n_verts, n_faces = map(max, zip(*sizes, strict=True))
        mesh_figures = {
            "n_segments": len(sizes), "n_verts": n_verts, "n_faces": n_faces, "fps": sequence.fps,
        }  # fmt: skip
        if is_stream(self.output):
            path = Path(self.output)
            assert isinstance(sequence, MeshSequence)  # a .reel is read with `open_any`
            encoded = encode_and_measure(
                sequence.part(frames), self.config, self.tracks, notes, progress=progress
            )
            if path.suffix.lower() == ".reel":
                with replace_when_done(path, overwrite=self.overwrite) as temporary:
                    temporary.write_bytes(encoded.data)
            return Written([path], len(frames), mesh_figures, encoded)
        figures: dict[str, Any] = {}
        paths = save_part(
            sequence, frames, self.output,
            overwrite=self.overwrite, start_number=self._number(frames, first), inputs=inputs,
            options=self.options, progress=progress, notes=notes, figures=figures, fit_rig=fit_rig,
        )  # fmt: skip
        return Written(paths, len(frames), mesh_figures, figures=figures)

    def _number(self, frames: range, first: int) -> int | None:
        """Number of the first file of an output; None for a single file."""
        number = numbering(self.output, frames, self.start_number)
        return number if number is None else first + number


@dataclass
class Written:
    """Files with frames of a sequence."""

    paths: list[Path]
    n_frames: int
    mesh_figures: dict[str, Any]
    """Number of segments, and the largest number of their vertices and faces; frame rate."""
    encoded: Encoded | None = None
    """The stream, for a .reel."""
    figures: dict[str, Any] = field(default_factory=dict)
    """Errors and sizes of a rig."""
    input_bytes: int | None = None
    """Size of the files that contain exactly these frames; None if they contain more."""

    @property
    def size_bytes(self) -> int:
        """Size of the files."""
        return sum(path.stat().st_size for path in self.paths)

    def as_dict(self) -> dict[str, Any]:
        """Figures for JSON."""
        stream = {} if self.encoded is None else self.encoded.as_dict()
        if stream:
            stream |= {"output": str(self.paths[0]), "input_size_bytes": self.input_bytes}
        return {
            "outputs": list(map(str, self.paths)),
            "n_frames": self.n_frames,
            **self.mesh_figures,
            "size_bytes": self.size_bytes,
            **self.figures,
            **stream,
        }


@dataclass
class Result:
    """What an operation wrote."""

    files: list[Written]
    """Of each output."""
    registered: Registered | None = None
    report: "Report | None" = None
    """Distances of the decoded .reel from the raw capture."""
    is_whole: bool = True
    """Whether the input is complete."""


def convert(
    source: Source,
    target: Target,
    reading: Reading,
    *,
    registering: RegisterOptions | None = None,
    frames: slice | None = None,
    splits: bool = False,
    reports: bool = True,
) -> Result:
    """Write the sequence of an input.

    Parameters
    ----------
    source : str, Path, or list or tuple of them
        As in `meshreel.load`.
    target : Target
    reading : Reading
        Receives the notes.
    registering : RegisterOptions, optional
        Registers the frames first; for a .reel with its quality and in a folder beside it, from
        which a second run continues if the first is stopped.
    frames : slice, optional
        The frames to write. Default: all.
    splits : bool
        Whether each segment has its output, named after its first and last frame.
    reports : bool
        Whether the distances of a registered and encoded surface are measured.

    Raises
    ------
    InvalidInputError, FormatError
        As `meshreel.load`, `meshreel.register`, `meshreel.encode` and `meshreel.save`; outputs and
        extras are checked before the input is read. Also if options exclude each other.
    """
    for name, choice in (("register", registering), ("frames", frames)):
        if splits and choice is not None:
            raise InvalidInputError(
                Keyword("split"), " and ", Keyword(name), " cannot be combined; give one"
            )
    notes, progress = reading.notes, reading.progress
    writes_stream = is_stream(target.output)
    with local_input(source, notes) as local:
        found = find_files(local)
        files = found.with_companions(reading.topology)
        extras = [*extras_to_read(files), *extras_to_write(target.output)]
        require([*extras, *([] if registering is None else extras_to_register(registering))])
        is_joined = registering is not None and registering.texture_output == target.output
        if is_joined:
            check_output_path(Path(target.output), overwrite=target.overwrite, inputs=files)
        else:
            target.check(files, None if splits else _known_frames(files, frames))
        if registering is not None:
            check_scheduler(registering)
        origin = None if writes_stream or len(files) > 1 else origin_of_file(files[0])
        target = replace(target, options=replace(target.options, origin=origin))
        is_matched = not splits and registering is None
        loading = _loading(target, reading, matches=is_matched)
        if registering is not None:
            loading = loading_raw(loading)
        opened = open_any(found, loading)
        input_bytes = _size_bytes({*files} | reading.referenced) if reading.object is None else None
        if splits:
            parts = _write_segments(opened, target, files, notes, progress)
            parts[0].input_bytes = input_bytes if len(parts) == 1 else None
            return Result(parts)
        registered = None
        if registering is not None:
            if writes_stream:
                # Frames stay in a folder until the file is complete: a second run continues.
                folder = Path(target.output).with_suffix(".registration")
                quality = quality_of(target.config)
                registering = replace(registering, quality=quality, folder=folder)
            parts_of = None if source == STANDARD_INPUT else open_part(source, loading)
            registered = register_frames(opened, registering, notes, progress, parts_of)
            opened = registered.sequence
            target = replace(target, config=registered.tuned(target.config, notes))
            notes += registered.registration.notes(is_reported=writes_stream and reports)
        numbers = chosen_frames(frames, opened.n_frames, notes)
        written = target.write(opened, numbers, files, notes, progress)
        written.input_bytes = input_bytes if len(numbers) == opened.n_frames else None
        result = Result([written], registered)
        if registered is not None and written.encoded is not None:
            data = written.encoded.data
            with open_reel(data) as reel:
                result.report = registered.report(reel, progress) if reports else None
                registered.bake(reel, progress, data if is_joined else b"")
        if registering is not None and registering.folder is not None:
            shutil.rmtree(registering.folder)
        return result


def decode(
    source: AnyPath,
    target: Target,
    notes: Notes,
    *,
    frames: slice | None = None,
    n_modes: int | None = None,
    segment: int | None = None,
    memory: float | str | None = None,
    progress: Progress = silent,
) -> Result:
    """Decode the frames of a .reel, and write them in another format.

    Parameters
    ----------
    frames : slice, optional
        The frames to write; of a remote file only their blocks are fetched. Default: all.
    n_modes, segment, memory
        As in `meshreel.open`.

    Raises
    ------
    InvalidInputError, FormatError
        As `meshreel.open` and `meshreel.save`.
    """
    with ExitStack() as stack:
        inputs = [] if is_remote(source) else [Path(source)]
        target.check(inputs)
        file: Any = source
        if frames is None or source == STANDARD_INPUT:
            file = stack.enter_context(local_input(source, notes, memory))
        reel = stack.enter_context(open_reel(file, n_modes=n_modes, segment=segment, memory=memory))
        stack.enter_context(errors_naming(source))
        note_video(source, notes)
        numbers = chosen_frames(frames, reel.n_frames, notes)
        written = target.write(reel, numbers, inputs, notes, progress)
        if not reel.is_whole:
            notes.result(f"{source} is truncated: these are the frames of its complete blocks")
        return Result([written], is_whole=reel.is_whole)


def _known_frames(files: Sequence[Path], selection: slice | None) -> range | None:
    """The frames of a slice of frame files; None for other files, whose number is unknown."""
    is_frame = files[0].suffix.lower() in FRAME_FORMATS
    return frame_range(selection, len(files)) if is_frame else None


def _loading(target: Target, reading: Reading, *, matches: bool) -> Reading:
    """Return the options with which an input is opened for a target."""
    keeps_order = is_stream(target.output) and target.config.order in ("keep", "vertices")
    reading = replace(reading, matches_frames=matches and not keeps_order)
    reading = loading_for(target.config.memory_bytes, reading)
    if target.options.origin is None:
        return reading
    # Writers read each frame once, so that decoding all frames first would gain nothing.
    return replace(reading, max_loaded_bytes=0)


def _write_segments(
    sequence: MeshSequence, target: Target, inputs: Sequence[Path], notes: Notes, progress: Progress
) -> list[Written]:
    """Check the outputs of all segments, and write each segment to its output."""
    output, ranges = Path(target.output), [*starmap(range, pairwise(sequence.starts))]
    targets = [target]
    if len(ranges) > 1:
        targets = [
            replace(
                target,
                output=output.with_name(f"{output.stem}_{frames[0]}-{frames[-1]}{output.suffix}"),
            )
            for frames in ranges
        ]
    for frames, part in zip(ranges, targets, strict=True):
        part.check(inputs, range(len(frames)), first=frames[0])
    return [
        part.write(
            MeshSequence.of_segments([segment]),
            range(len(frames)),
            inputs,
            notes,
            progress,
            first=frames[0],
        )
        for segment, frames, part in zip(sequence.segments, ranges, targets, strict=True)
    ]


def _size_bytes(paths: set[Path]) -> int:
    """Size of files, which may be named several times."""
    files = {path.resolve() for path in paths}
    return sum(path.stat().st_size for path in files if path.is_file())
