"""Opening of the files of a sequence, in segments if its faces change."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from meshreel.formats.displacement import displace, note_displacement
from meshreel.formats.frames.frame_files import FrameFiles, read_runs
from meshreel.formats.frames.selection import select_attributes
from meshreel.formats.kinds import SequenceFormat
from meshreel.formats.options import Reading
from meshreel.formats.scenes.scene_source import open_mesh, select_frames, select_mesh
from meshreel.formats.sources import SourceFiles
from meshreel.formats.supported_options import check_read_options
from meshreel.model.matching.segments import match_segments
from meshreel.model.notes import NoteKind, Notes
from meshreel.model.sequence import FrameSource, MeshSequence
from meshreel.model.timing import Timing
from meshreel.runtime.counting import counted

MANY_SEGMENTS = 0.8
"""Segments per frame above which notes advise registration."""


def open_any(files: SourceFiles, reading: Reading) -> MeshSequence:
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
    check_read_options(files.format, reading)
    own_reading = replace(reading, notes=Notes())
    sequence = _open(files, own_reading)
    if reading.displace is None:
        note_displacement(sequence, own_reading.notes)
    else:
        sequence = displace(sequence, reading.displace, reading.max_loaded_bytes)
    reading.notes.extend(dict.fromkeys(own_reading.notes))
    return sequence


def _open(files: SourceFiles, reading: Reading) -> MeshSequence:
    path, file_format = files.paths[0], files.format
    if isinstance(file_format, SequenceFormat) and file_format.open is not None:
        opened = MeshSequence.of_segments([file_format.open(path, reading)])
        segments = [
            select_attributes(segment, reading.attributes, path) for segment in opened.segments
        ]
        return MeshSequence.of_segments(segments, opened.name, opened.timing)
    frame_files = None
    if not isinstance(file_format, SequenceFormat):
        frame_files = FrameFiles(files.paths, file_format)
    runs = list(_runs(files, frame_files, reading))
    has_several = len(runs) > 1
    segments = runs
    if has_several and reading.matches_frames:
        segments = match_segments(runs, reading.progress)
    selected = [select_attributes(segment, reading.attributes, path) for segment in segments]
    timing = Timing.joined([run.timing for run in runs], [run.n_frames for run in runs])
    sequence = MeshSequence.of_segments(selected, timing=timing)
    stated = None if frame_files is None or reading.fps else frame_files.timing(reading.notes)
    if len(files.paths) > 1:
        # for several files only
        from meshreel.formats.frames.numbering import note_order, timing_by_number

        note_order(files.paths, reading.notes)
        if stated is None:
            stated = timing_by_number(files.paths, reading.fps or 0.0, reading.notes)
    sequence = sequence if stated is None else sequence.replace(timing=stated)
    if has_several:
        reading.notes.combine()
        _note_segments(sequence, runs, segments, reading)
    return sequence


def _runs(
    files: SourceFiles, frame_files: FrameFiles | None, reading: Reading
) -> Iterator[FrameSource]:
    """Yield each range of frames with the same faces, of a file of meshes or of frame files."""
    path, file_format = files.paths[0], files.format
    if frame_files is not None:
        yield from read_runs(frame_files, files.name, reading)
    elif isinstance(file_format, SequenceFormat) and file_format.read_meshes is not None:
        if len(files.paths) == 1:
            mesh = select_mesh(file_format.read_meshes, path, reading)
            yield from open_mesh(mesh, path, reading)
        else:
            mesh = select_frames(file_format.read_meshes, files.paths, reading)
            yield from open_mesh(mesh, path.parent, reading)


def _note_segments(
    sequence: MeshSequence,
    runs: Sequence[FrameSource],
    matched: Sequence[FrameSource],
    reading: Reading,
) -> None:
    text = (
        f"the faces change: {counted(sequence.n_frames, 'frame')} in "
        f"{counted(len(runs), 'segment')} of constant connectivity"
    )
    reading.notes.add(NoteKind.SEGMENTS, "faces", text)
    if len(matched) < len(runs):
        text = _describe_match(runs, matched)
        reading.notes.add(NoteKind.SEGMENTS, "matched segments", text)
    if reading.matches_frames and len(matched) > MANY_SEGMENTS * sequence.n_frames:
        text = "the faces change in almost every frame; `meshreel register` can follow the surface"
        reading.notes.add(NoteKind.SEGMENTS, "faces", text)


def _describe_match(unmatched: Sequence[FrameSource], matched: Sequence[FrameSource]) -> str:
    n_added = sum(len(segment.faces) * segment.n_frames for segment in matched)
    n_added -= sum(len(segment.faces) * segment.n_frames for segment in unmatched)
    added = f"; {counted(n_added, 'face')} that add no area complete them" if n_added else ""
    return (
        f"matched {counted(len(unmatched), 'segment')} that differ only in the order of vertices "
        f"and faces, which leaves {counted(len(matched), 'segment')}{added}"
    )
