"""Frame files, one mesh each: each is read and parsed once, in runs of frames with equal faces."""

import zlib
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshreel.formats.file_errors import errors_naming, read_bytes
from meshreel.formats.frames.field_tracks import NORMALS, Fields
from meshreel.formats.frames.frame import Frame, FrameData
from meshreel.formats.frames.stored_frames import (
    Description,
    FrameSurvey,
    StoredFrames,
    changed_error,
    identity,
)
from meshreel.formats.kinds import FrameFormat
from meshreel.formats.options import Reading
from meshreel.formats.surfaces.polygons import triangulated
from meshreel.formats.surfaces.welding import CornerWelder
from meshreel.model.notes import CHANGES, Note, NoteKind, Notes
from meshreel.model.notes import NORMALS as NORMALS_SUBJECT
from meshreel.model.sequence import FrameSource, MeshSequence, Vertices
from meshreel.model.surface import Surface
from meshreel.model.surface_selection import differing_names
from meshreel.model.timing import Timing
from meshreel.model.tracks import read_tracks
from meshreel.model.validation import validate_finite
from meshreel.runtime.progress import Count

MAX_RECENT = 8
"""Number of recently read frames that stay in memory, because callers read one part at a time."""


class FrameFiles:
    """The frames of files, checked for changes when they are read again.

    Parameters
    ----------
    paths : sequence of Path
        One file per frame, in order.
    format : FrameFormat
        Format of all files.

    Attributes
    ----------
    recent : deque of (int, FrameSource)
        Frames with other faces than their neighbors that were read last, with their numbers.
    """

    def __init__(self, paths: Sequence[Path], format: FrameFormat) -> None:
        self.paths: tuple[Path, ...] = tuple(paths)
        self.format = format
        self._checksums: dict[int, int] = {}
        self._times_s: dict[int, float | None] = {}
        self._last: tuple[int, Frame] | None = None
        self.recent: deque[tuple[int, FrameSource]] = deque(maxlen=MAX_RECENT)

    def __len__(self) -> int:
        return len(self.paths)

    def frame(self, index: int) -> Frame:
        """Read a frame.

        Raises
        ------
        InvalidInputError
            If the file does not exist, or has changed since it was first read.
        FormatError
            If it is damaged.
        """
        last = self._last  # threads that read positions and tracks may replace it
        if last is not None and last[0] == index:
            return last[1]
        path = self.paths[index]
        data = read_bytes(path)
        if self._checksums.setdefault(index, crc := zlib.crc32(data)) != crc:
            raise changed_error(f"{path} (frame {index})")
        with errors_naming(path):
            frame = self.format.read(data)
        self._last = index, frame
        self._times_s[index] = frame.time_s
        return frame

    def timing(self, notes: Notes) -> Timing | None:
        """Return the timing that the files state, once all are read.

        None if they state no times, or with a note if some do not, or the times do not ascend.
        """
        times_s = [time for _, time in sorted(self._times_s.items()) if time is not None]
        if 0 < len(times_s) < len(self):
            notes.left_out(f"times of files, which only {len(times_s)} of {len(self)} files have")
        elif not (np.isfinite(times_s).all() and (np.diff(times_s) > 0).all()):
            notes.left_out("times of files, which do not ascend")
        elif times_s:
            return Timing.of_times(times_s)
        return None


def read_runs(files: FrameFiles, name: str, reading: Reading) -> Iterator[FrameSource]:
    """Read all files once, and yield each run of frames with the same vertices and faces.

    Runs are loaded until they take `max_loaded_bytes` together; others stay in their files, and
    need memory for one frame. A single file is always loaded.

    Parameters
    ----------
    name : str
        Of the sequences.
    reading : Reading
        Their notes receive sentences on each run.

    Raises
    ------
    FormatError
        If a file cannot be read.
    InvalidInputError
        If a position is not finite; also when frames are read later, if a file has changed. Errors
        name the file.
    """
    run: _Run | None = None
    budget = reading.max_loaded_bytes
    for index in range(len(files)):
        frame = files.frame(index)
        with errors_naming(files.paths[index]):
            if run is None or not run.add(frame):
                if run is not None:
                    sequence = run.sequence(name, reading)
                    budget = None if budget is None else max(0, budget - run.kept_bytes)
                    yield sequence
                    del sequence
                run = _Run(files, index, frame, budget)
        reading.progress("reading", Count(index + 1, len(files), "frames"))
    if run is not None:
        yield run.sequence(name, reading)


class _Run:
    """Consecutive frames with the same faces, whose contents are kept while they are small.

    Parameters
    ----------
    start : int
        Number of the first frame.
    first : Frame
        Its contents.
    max_bytes : int, optional
        Size of contents above which two or more frames stay in their files.

    Attributes
    ----------
    kept_bytes : int
        Size of the kept contents.
    """

    def __init__(self, files: FrameFiles, start: int, first: Frame, max_bytes: int | None) -> None:
        self.first = first
        self.kept_bytes: int = 0
        self._files, self._start, self._max_bytes = files, start, max_bytes
        file_format = files.format
        self._survey = FrameSurvey(is_decimal=file_format.is_decimal)
        self._welder = CornerWelder() if file_format.has_unshared_vertices else None
        self._positions: deque[tuple[Vertices, npt.NDArray[np.int64] | None]] = deque()
        self._data = FrameData(first.fields)
        self._differing_names: dict[str, None] = {}
        self._notes = Notes(first.notes)
        self._n_frames = 0
        self._keep(first.mesh.vertices)

    def add(self, frame: Frame) -> bool:
        """Add a frame; return whether it belongs to the run."""
        if not frame.mesh.has_faces_of(self.first.mesh):
            return False
        self.kept_bytes += self._data.add(frame.fields)
        names = differing_names(_without_data(self.first), _without_data(frame))
        self._differing_names.update(dict.fromkeys(names))
        self._notes.merge(frame.notes)
        self._keep(frame.mesh.vertices)
        return True

    def _keep(self, vertices: Vertices) -> None:
        """Validate positions and keep them, unless all contents become too large."""
        validate_finite(vertices[np.newaxis], first_frame=self._start + self._n_frames)
        self._survey.add(vertices[np.newaxis])
        labels = None
        if self._welder is not None:
            self._welder.add(vertices)
            vertices, labels = vertices[self._welder.representatives], self._welder.labels
        self.kept_bytes += vertices.nbytes
        self._n_frames += 1
        is_large = self._max_bytes is not None and self.kept_bytes > self._max_bytes
        if self._n_frames > 1 and (is_large or not self._positions):
            self._positions.clear()
            self._data.forget_values()
            self.kept_bytes = 0
        else:
            self._positions.append((vertices, labels))

    def sequence(self, name: str, reading: Reading) -> FrameSource:
        """Return the frames: loaded, or read from their files on demand."""
        timing = Timing.of_rate(reading.fps or 0.0).part(range(self._start, self._start + 1))
        mesh, notes = self.first.mesh, Notes(self._notes)
        surface = self._surface(notes, finds_edges=reading.finds_hard_edges)
        rows: slice | npt.NDArray[np.int64] = slice(None)
        if self._welder is None:
            faces = triangulated(mesh, notes)
            surface = mesh.with_polygons(surface)
        else:
            faces, rows = self._welder.faces, self._welder.representatives
            text = self._welder.description
            notes.insert(0, Note(NoteKind.CHANGED, "welded corners", text=text))
        tracks = self._data.tracks(mesh, self._read_fields, notes)
        reading.notes.add_all(notes)
        description = Description(faces, name, timing, surface)
        if self._positions:
            loaded = description.sequence(self._stack_positions(rows), read_tracks(tracks))
            if self._n_frames > 1:
                return loaded
            self.kept_bytes = loaded.raw_size_bytes
            limit = self._max_bytes if len(self._files) > 1 else None
            is_large = limit is not None and self.kept_bytes > limit
            return self._stored(loaded, reading) if is_large else loaded
        shape = self._n_frames, len(mesh.vertices[rows])
        files = self._files.paths[self._start : self._start + self._n_frames]
        read = partial(self._read_range, rows)
        return description.stored_frames(shape, self._survey, read, files, tracks)

    def _stored(self, frame: MeshSequence, reading: Reading) -> StoredFrames:
        """Return the only frame as a sequence that parses its file whenever it is read."""
        files, start, name = self._files, self._start, frame.name
        options = replace(reading, notes=Notes())
        self.kept_bytes = 0
        files.recent.append((start, frame))

        def read() -> FrameSource:
            for number, recent in tuple(files.recent):
                if number == start:
                    return recent
            sequence = _Run(files, start, files.frame(start), None).sequence(name, options)
            files.recent.append((start, sequence))
            return sequence

        return StoredFrames(
            n_frames=1,
            n_verts=frame.n_verts,
            dtype=frame.dtype,
            name=name,
            timing=frame.timing,
            read_range=lambda first, stop: read().read(first, stop),
            read_faces=lambda: read().faces,
            read_surface=lambda: read().surface,
            read_tracks=lambda: read().tracks,
            read_extent=partial(identity, frame.extent),
            files=(files.paths[start],),
            keeps_mesh=False,
        )

    def _surface(self, notes: Notes, *, finds_edges: bool) -> Surface:
        """Return the surface of the first frame without data that change, and note the changes."""
        changing_keys = self._data.changing_keys
        surface = self.first.surface_with_edges(notes, finds_edges=finds_edges)
        attributes = [
            attribute
            for attribute in surface.attributes
            if (attribute.domain, attribute.name) not in changing_keys
        ]
        if any(
            self.first.fields[key][1].role == NORMALS
            for key in changing_keys & {*self.first.fields}
        ):
            notes.discard(NORMALS_SUBJECT)
        notes.left_out(CHANGES, self._differing_names)
        return replace(surface, attributes=tuple(attributes))

    def _stack_positions(self, rows: slice | npt.NDArray[np.int64]) -> Vertices:
        """Return the kept positions as one array, releasing each frame once it is copied."""
        shape = self._n_frames, *self.first.mesh.vertices[rows].shape
        vertices: Vertices = np.empty(shape, self._survey.dtype)
        for index in range(self._n_frames):
            frame, labels = self._positions.popleft()
            vertices[index] = frame if labels is None else frame[labels[rows]]
        return vertices

    def _read_range(self, rows: slice | npt.NDArray[np.int64], start: int, stop: int) -> Vertices:
        shape = stop - start, *self.first.mesh.vertices[rows].shape
        block: Vertices = np.empty(shape, self._survey.dtype)
        for row, index in enumerate(range(self._start + start, self._start + stop)):
            block[row] = self._files.frame(index).mesh.vertices[rows]
        return block

    def _read_fields(self, index: int) -> Fields:
        return self._files.frame(self._start + index).fields


def _without_data(frame: Frame) -> Surface:
    """Return the surface without the data that may become tracks."""
    attributes = (
        attribute
        for attribute in frame.surface.attributes
        if (attribute.domain, attribute.name) not in frame.fields
    )
    return replace(frame.surface, attributes=tuple(attributes))
