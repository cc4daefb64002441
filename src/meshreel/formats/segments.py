"""Opening of the files of a sequence, in segments if its faces change."""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import accumulate
from pathlib import Path
from typing import Any

from meshreel.errors import ConnectivityChangeError, InvalidInputError
from meshreel.formats.file_errors import errors_naming
from meshreel.formats.frames.mesh_files import MeshFiles
from meshreel.formats.frames.opening import open_mesh_files
from meshreel.formats.frames.selection import select_attributes
from meshreel.formats.kinds import SequenceFormat
from meshreel.formats.notes import listed, note_left_out
from meshreel.formats.options import ReadOptions
from meshreel.formats.scenes.scene_source import frame_range, open_mesh, select_mesh
from meshreel.formats.sources import Source, SourceFiles, find_files
from meshreel.formats.supported_options import check_read_options
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.matching.segments import match_segments
from meshreel.model.sequence import FrameSource, MeshSequence, single_segment
from meshreel.runtime.counting import counted
from meshreel.runtime.progress import Count

MANY_SEGMENTS = 0.8
"""Segments per frame above which notes advise registration."""

FACES_CHANGE = "the faces change"
"""Beginning of notes on segments."""

COMPARING = "comparing"
"""Stage of progress while the faces of all frames are compared."""


def open_any(found: SourceFiles, options: ReadOptions) -> MeshSequence:
    """Open a sequence whose faces may change; frames may stay in their files.

    Frame files, scene files and uncompressed ``.npz`` files are read once now, a frame at a time,
    to validate them and to find their extent; later, frames are read on demand, and the files must
    not change. A compressed ``.npz``, a ``.reel`` and a single static mesh are loaded. If the faces
    change, each range of frames with the same faces becomes a segment; a note states how many.

    Raises
    ------
    InvalidInputError, FormatError
        As `load`; also InvalidInputError when frames are read, if a file has changed.
    """
    check_read_options(found.format, options)
    attempt = replace(_at_rate(found, options), notes=[])
    if options.register is not None:
        attempt = replace(attempt, matches_frames=False)
    try:
        opened = _open_constant(found, attempt)
    except ConnectivityChangeError:
        attempt.notes.clear()
        opened = _open_changing(found, attempt)
    options.notes.extend(dict.fromkeys(attempt.notes))
    return opened if options.register is None else registered(opened, options)


def registered(sequence: MeshSequence, options: ReadOptions) -> MeshSequence:
    """Return a sequence registered with the tolerance of the options.

    They receive the registration, and notes on it.

    Raises
    ------
    InvalidInputError
        As `meshreel.register`.
    """
    from meshreel.codec.error_bounds import bound_of
    from meshreel.registration.register import register  # imports SciPy

    tolerance = bound_of(options.register or "", option="register")
    registration = register(sequence, tolerance, options.progress)
    options.registrations.append(registration)
    options.notes.extend(registration.notes())
    return registration.sequence


def open_constant(found: SourceFiles, options: ReadOptions, purpose: str) -> MeshSequence:
    """Open a sequence as `open_any`, whose faces must not change.

    Parameters
    ----------
    purpose : str
        What needs constant connectivity, for the error message.

    Raises
    ------
    ConnectivityChangeError
        If the faces change; names the first frame with other faces, for a file of frames.
    """
    check_read_options(found.format, options)
    try:
        opened = _open_constant(found, _at_rate(found, options))
    except ConnectivityChangeError as error:
        raise ConnectivityChangeError(
            f"{error}; {purpose} needs the same faces in every frame"
        ) from None
    with errors_naming(found.paths[0]):
        single_segment(opened, purpose)
    return opened


def _at_rate(found: SourceFiles, options: ReadOptions) -> ReadOptions:
    """Return the options with the frame rate of a manifest, unless they have one.

    Their notes gain a sentence on what the manifest names besides frames.
    """
    if found.left_out:
        note_left_out(options.notes, f"{listed(found.left_out)} of the manifest")
    is_unset = found.fps and options.fps is None
    return replace(options, fps=found.fps) if is_unset else options


def _open_constant(found: SourceFiles, options: ReadOptions) -> MeshSequence:
    path = found.paths[0]
    if not isinstance(found.format, SequenceFormat):
        files = MeshFiles(found.paths, found.format)
        if len(files) > 1:  # before attributes of many frames are compared
            first = files.mesh(0)
            files.require_same_faces(1, files.mesh(1), first)
        frames = open_mesh_files(files, found.name, options)
        return MeshSequence.of_segments([select_attributes(frames, options.attributes, path)])
    opened = MeshSequence.of_segments([found.format.open(path, options)])
    segments = [select_attributes(one, options.attributes, path) for one in opened.segments]
    return MeshSequence.of_segments(segments, opened.name, opened.start_s)


def _open_changing(found: SourceFiles, options: ReadOptions) -> MeshSequence:
    is_of_files = not isinstance(found.format, SequenceFormat)

    def comparing(stage: str, share: float) -> None:
        if stage == COMPARING:  # others count the frames of one segment
            options.progress("reading" if is_of_files else stage, share)

    several = _find_segments(found, replace(options, progress=comparing))
    # Files of a segment are read when it is found.
    given = [one.open() for one in several] if is_of_files else _open_all([*several], options)
    segments = match_segments(given, options.progress) if options.matches_frames else given
    selected = [select_attributes(one, options.attributes, found.paths[0]) for one in segments]
    sequence = MeshSequence.of_segments(selected, start_s=given[0].start_s)
    options.notes[:] = _combined(options.notes)
    options.notes.append(
        f"{FACES_CHANGE}: {counted(sequence.n_frames, 'frame')} in "
        f"{counted(len(given), 'segment')} of constant connectivity"
    )
    if len(segments) < len(given):
        options.notes.append(_describe_match(given, segments))
    if options.matches_frames and len(segments) > MANY_SEGMENTS * sequence.n_frames:
        options.notes.append(
            f"{FACES_CHANGE} in almost every frame; `meshreel register` can follow the surface"
        )
    return sequence


def _open_all(several: Sequence["FoundSegment"], options: ReadOptions) -> list[FrameSource]:
    opened: list[FrameSource] = []
    for one in several:
        opened.append(one.open())
        options.progress("reading", Count(one.stop, several[-1].stop, "frames"))
    return opened


def _describe_match(given: Sequence[FrameSource], matched: Sequence[FrameSource]) -> str:
    n_added = sum(len(one.faces) * one.n_frames for one in matched)
    n_added -= sum(len(one.faces) * one.n_frames for one in given)
    added = f"; {counted(n_added, 'face')} that add no area complete them" if n_added else ""
    return (
        f"matched {counted(len(given), 'segment')} that differ only in the order of vertices and "
        f"faces, which leaves {counted(len(matched), 'segment')}{added}"
    )


def _combined(notes: Iterable[str]) -> list[str]:
    """Return the notes of all segments; of notes that differ only in numbers the first."""
    alike: dict[str, dict[str, None]] = {}
    for note in notes:
        alike.setdefault(re.sub(r"\d+", "", note), {})[note] = None
    return [
        f"{first}; other segments similarly" if others else first
        for first, *others in alike.values()
    ]


@dataclass(frozen=True)
class FoundSegment:
    """Consecutive frames of a sequence with the same vertices and faces.

    Attributes
    ----------
    start, stop : int
        Range of frames in the whole sequence.
    open : function
        Opens them as a sequence.
    """

    start: int
    stop: int
    open: Callable[[], Any]

    def path(self, whole: Path) -> Path:
        """Return the path of this segment, given that of the whole: ``walk_0-41.reel``."""
        return whole.with_name(f"{whole.stem}_{self.start}-{self.stop - 1}{whole.suffix}")


def find_segments(source: Source | SourceFiles, options: ReadOptions) -> list[FoundSegment]:
    """Find the segments of a sequence, in order; one if its faces never change.

    Reads all frames now, and again when a segment is opened.

    Parameters
    ----------
    source : str, Path, list or tuple of them, or SourceFiles
        As in `meshreel.load`. Only frame files, scene files and ``.reel`` can have changing faces.

    Raises
    ------
    InvalidInputError, FormatError
        As `meshreel.load`.
    """
    if options.register is not None:
        raise InvalidInputError("register= joins segments; it cannot be combined with split")
    found = source if isinstance(source, SourceFiles) else find_files(source)
    check_read_options(found.format, options)
    if not isinstance(source, SourceFiles):
        options = _at_rate(found, options)

    def selecting(segment: FoundSegment) -> FoundSegment:
        names, path = options.attributes, found.paths[0]

        def opened() -> MeshSequence:
            return MeshSequence.of_segments([select_attributes(segment.open(), names, path)])

        return replace(segment, open=opened)

    return list(map(selecting, _find_segments(found, options)))


def _find_segments(found: SourceFiles, options: ReadOptions) -> Iterable[FoundSegment]:
    """Find the segments; those of files are found while the caller reads earlier ones."""
    if not isinstance(found.format, SequenceFormat):
        return _of_files(MeshFiles(found.paths, found.format), found, options)
    path, form = found.paths[0], found.format
    if form.read_meshes is None:
        segments = MeshSequence.of_segments([form.open(path, options)]).segments
        stops = accumulate(one.n_frames for one in segments)
        return [
            FoundSegment(stop - one.n_frames, stop, partial(_opened, one))
            for one, stop in zip(segments, stops, strict=True)
        ]
    mesh = select_mesh(form.read_meshes, path, options)
    with errors_naming(path):
        runs = list(_same_faces(mesh.frame, len(mesh.times_s), options))
    return [
        FoundSegment(start, stop, partial(open_mesh, frame_range(mesh, start, stop), path, options))
        for start, stop in runs
    ]


def _opened(segment: FrameSource) -> FrameSource:
    return segment


def _of_files(files: MeshFiles, found: SourceFiles, options: ReadOptions) -> Iterator[FoundSegment]:
    for start, stop in _same_faces(files.mesh, len(files), options):
        part = MeshFiles(files.paths[start:stop], files.format)
        start_s = start / options.fps if options.fps else 0.0
        yield FoundSegment(
            start, stop, partial(open_mesh_files, part, found.name, options, start_s=start_s)
        )


def _same_faces(
    frame: Callable[[int], PolygonMesh], n_frames: int, options: ReadOptions
) -> Iterator[tuple[int, int]]:
    """Yield start and stop of each run of frames with the same vertices and faces."""
    start, first = 0, frame(0)
    for index in range(1, n_frames):
        mesh = frame(index)
        options.progress(COMPARING, Count(index + 1, n_frames, "frames"))
        if mesh.difference(first):
            yield start, index
            start, first = index, mesh
    yield start, n_frames
