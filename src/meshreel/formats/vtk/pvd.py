"""Reader for ParaView collections (``.pvd``): a list of VTK files and their times."""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from meshreel.arrays import Floats
from meshreel.errors import FormatError, InvalidInputError, Keyword
from meshreel.formats.file_errors import errors_naming, read_bytes
from meshreel.formats.file_references import resolve_reference
from meshreel.formats.frames.steps import DataArray, Step, StepFrames
from meshreel.formats.kinds import VERTEX_FACE_CELL, SequenceFormat
from meshreel.formats.options import Reading
from meshreel.formats.scenes.merging import merge_meshes, merge_tracks
from meshreel.formats.scenes.scene_mesh import SceneMesh, read_or_defer_error
from meshreel.formats.scenes.timing import file_order_times
from meshreel.formats.surfaces.polygons import EmptyMeshError, PolygonMesh
from meshreel.formats.vtk.legacy import read_vtk_legacy
from meshreel.formats.vtk.xml_arrays import parse_xml
from meshreel.formats.vtk.xml_file import read_vtk_xml
from meshreel.formats.vtk.xml_writing import pvd_pieces, write_pvd
from meshreel.model.notes import Notes, listed
from meshreel.model.surface import Surface
from meshreel.model.tracks import TrackSource

READERS = {".vtu": read_vtk_xml, ".vtp": read_vtk_xml, ".vtk": read_vtk_legacy}
READABLE = (*READERS, ".pvtu", ".pvtp")


def read_pvd(path: Path, reading: Reading) -> Sequence[SceneMesh]:
    """Return the meshes of a collection, one for each numbered part.

    Raises
    ------
    FormatError
        If the file is not a collection, or refers to unsupported files.
    """
    root = parse_xml(read_bytes(path))
    if root.tag != "VTKFile" or root.get("type") != "Collection":
        raise FormatError(f"is {root.tag} of type {root.get('type', '')!r}; expected a Collection")
    parts: dict[tuple[str, str], list[tuple[float, Path]]] = {}
    for element in root.findall("Collection/DataSet"):
        time, text = math.nan, element.get("timestep", "0")
        with suppress(ValueError):
            time = float(text)
        if not math.isfinite(time):
            raise FormatError(f"has the timestep {text[:40]!r}; expected a finite number")
        file = resolve_reference(path, element.get("file", ""), reading)
        if file.suffix.lower() not in READABLE:
            raise FormatError(f"refers to {file.name}; {', '.join(READABLE)} files are supported")
        part = element.get("group", ""), element.get("part", "0")
        parts.setdefault(part, []).append((time, file))
    if not parts:
        raise FormatError("lists no files")
    steps = _FileSteps(reading)
    return [
        read_or_defer_error(name, partial(_scene_mesh, name, files, steps, reading))
        for (group, part), files in parts.items()
        for name in [path.stem if len(parts) == 1 else f"/{group or 'part'}_{part}"]
    ]


def _scene_mesh(
    name: str, files: list[tuple[float, Path]], steps: "_FileSteps", reading: Reading
) -> SceneMesh:
    if reading.skip_bad:
        files = _files_with_faces(files, steps, reading)
    pieces: dict[float, list[Path]] = {}
    for time, file in sorted(files, key=lambda item: item[0]):
        pieces.setdefault(time, []).append(file)
    frames, times = list(pieces.values()), np.array(list(pieces))
    repeated_time = next((time for time, paths in pieces.items() if len(paths) > 1), None)
    if repeated_time is not None and not reading.merge:
        frames = [[file] for _, file in files]
        if (file_order := file_order_times(len(files), reading)) is None:
            raise _equal_times_error(repeated_time, {time: len(pieces[time]) for time in pieces})
        times = file_order
    read = _PieceFrames(name, times, frames, steps, reading.notes)
    return SceneMesh(name, times, read.frame, read.surface, tracks=read.tracks)


def _files_with_faces(
    files: list[tuple[float, Path]], steps: "_FileSteps", reading: Reading
) -> list[tuple[float, Path]]:
    """Return the times and files of steps with faces; a note lists the others."""
    nonempty: list[tuple[float, Path]] = []
    empty = []
    for time, path in files:
        try:
            steps.read(path, time, nonempty[-1][1] if nonempty else None)
            nonempty.append((time, path))
        except EmptyMeshError:
            empty.append(f"{path.name} (time {time:g})")
    if not nonempty:
        raise EmptyMeshError(f"lists only files without faces: {listed(empty)}")
    reading.notes.left_out("steps without faces", empty)
    return nonempty


def _equal_times_error(time: float, n_files: Mapping[float, int]) -> InvalidInputError:
    """Return the error for a time with several files, given the number of files of each time."""
    text = f"lists {n_files[time]} files for the time {time:g}"
    file_order_advice = "read each file as a frame, in file order, with ", Keyword("fps")
    single = next((other for other, count in n_files.items() if count == 1), None)
    if single is None:
        return InvalidInputError(
            f"{text} with the same part number; merge the files of each time into one mesh with ",
            Keyword("merge", True),
            ", or ",
            *file_order_advice,
        )
    return InvalidInputError(
        f"{text} and 1 for the time {single:g}, as after a restart; delete the older entries of "
        "such times, or ",
        *file_order_advice,
        "; if they are pieces of one mesh, merge the files of each time with ",
        Keyword("merge", True),
    )


def _read_step(path: Path, time: float, reading: Reading) -> Step:
    data, extension = read_bytes(path), path.suffix.lower()

    def read_piece(reference: str) -> bytes:
        return read_bytes(resolve_reference(path, reference, reading))

    with errors_naming(path):
        try:
            reader = READERS.get(extension)
            return read_vtk_xml(data, read_piece) if reader is None else reader(data)
        except EmptyMeshError as error:
            remedy = f"; leave out the step at time {time:g}, and others without faces, with "
            raise EmptyMeshError(*error.args, remedy, Keyword("skip_bad", True)) from None


class _FileSteps:
    """Cache of steps: each file is parsed once, while all steps together are small enough."""

    def __init__(self, reading: Reading) -> None:
        self._max_bytes, self._options = reading.max_loaded_bytes, reading
        self._cached: dict[Path, Step] = {}
        self._cached_bytes = 0
        self._last: tuple[Path, Step] | None = None

    def read(self, path: Path, time: float, previous: Path | None) -> Step:
        """Read the step of a file; raises as `read_pvd`.

        Parameters
        ----------
        previous : Path, optional
            File of the previous frame, with which the step shares equal data.
        """
        last = self._last
        if last is not None and last[0] == path:
            return last[1]
        if path in self._cached:
            return self._cached[path]
        step = _read_step(path, time, self._options)
        previous_step = None if previous is None else self._cached.get(previous)
        if previous_step is not None:
            step = step.share_data(previous_step)
        self._last = path, step
        self._cache(path, time, step, previous_step)
        return step

    def _cache(self, path: Path, time: float, step: Step, previous: Step | None) -> None:
        """Cache a step, or clear the cache if it becomes too large; shared arrays count once."""
        shared: Sequence[DataArray] = () if previous is None else previous.data
        new_arrays = [array for array in step.data if not any(array is known for known in shared)]
        self._cached_bytes += sum(array.read().nbytes for array in new_arrays)
        if previous is not None and previous.surface is step.surface and not self._options.skip_bad:
            # Callers keep the positions that they have read.
            options = self._options
            step = replace(step, read_points=lambda: _read_step(path, time, options).read_points())
        else:
            self._cached_bytes += step.surface.size_bytes + step.read_points().nbytes
        if self._max_bytes is None or self._cached_bytes <= self._max_bytes:
            self._cached[path] = step
        else:
            self._cached.clear()


class _PieceFrames:
    """Frames that consist of one file or of several files merged into one mesh.

    Parameters
    ----------
    times : float64 array of shape (T,)
    files : list of list of Path
        The files of each frame.
    """

    def __init__(
        self,
        name: str,
        times: Floats,
        files: list[list[Path]],
        steps: _FileSteps,
        notes: Notes,
    ) -> None:
        self._name, self._times, self._notes = name, times, notes
        n_series = max(len(paths) for paths in files)
        series: list[list[tuple[Path, float]]] = [[] for _ in range(n_series)]
        piece_indices = []
        for time, paths in zip(times.tolist(), files, strict=True):
            piece_indices.append([len(series[number]) for number in range(len(paths))])
            for number, file in enumerate(paths):
                series[number].append((file, time))
        self._piece_indices = piece_indices
        self._pieces = [
            SceneMesh(f"/piece_{number}", times, read.frame, read.surface, tracks=read.tracks)
            for number, frames in enumerate(series)
            for read in [StepFrames(partial(_read_frame, steps, frames), notes)]
        ]

    def frame(self, index: int) -> PolygonMesh:
        """Return the mesh of a frame."""
        return self._mesh(index).frame(0)

    def surface(self, index: int) -> Surface:
        """Return the static data of a frame; merged frames have a part for each file."""
        return self._mesh(index).surface(0)

    def tracks(self, frames: range) -> Mapping[str, TrackSource]:
        """Return the tracks of consecutive frames that share their faces."""
        counts = {len(self._piece_indices[index]) for index in frames}
        if len(counts) > 1:  # pieces cannot be matched between frames
            self._notes.left_out("fields of frames that differ in their number of files")
            return {}
        numbers = np.array([self._piece_indices[index] for index in frames])
        if counts == {1}:
            return self._pieces[0].tracks(range(numbers[0, 0], numbers[0, 0] + len(frames)))
        piece_indices = [(indices, indices, np.zeros(len(indices))) for indices in numbers.T]
        return merge_tracks(self._pieces[: counts.pop()], piece_indices, self._notes)

    def _mesh(self, index: int) -> SceneMesh:
        pieces = zip(self._pieces, self._piece_indices[index], strict=False)
        meshes = [_frame_of(piece, row, self._times[index]) for piece, row in pieces]
        return merge_meshes(meshes, self._name, self._notes) if len(meshes) > 1 else meshes[0]


def _frame_of(piece: SceneMesh, index: int, time: float) -> SceneMesh:
    return SceneMesh(
        piece.name, np.array([time]), lambda _: piece.frame(index), lambda _: piece.surface(index)
    )


def _read_frame(steps: _FileSteps, files: list[tuple[Path, float]], index: int) -> Step:
    return steps.read(*files[index], files[index - 1][0] if index else None)


FORMATS = (
    SequenceFormat(
        ".pvd",
        "ParaView collection",
        read_meshes=read_pvd,
        write=write_pvd,
        holds_segments=True,
        refers_to_files=True,
        track_domains=VERTEX_FACE_CELL,
        data_files=pvd_pieces,
    ),
)
