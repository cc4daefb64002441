"""Opening of one sequence from a file of several meshes: selected or merged, and checked."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache, lru_cache
from itertools import pairwise
from pathlib import Path

import numpy as np

from meshreel.errors import FormatError, InvalidInputError, Keyword, MeshReelError
from meshreel.formats.file_errors import errors_naming
from meshreel.formats.frames.stored_frames import Description, FrameSurvey
from meshreel.formats.options import Reading
from meshreel.formats.scenes.merging import merge_meshes
from meshreel.formats.scenes.scene_mesh import BLOCK_BYTES, ReadMeshes, SceneMesh
from meshreel.formats.scenes.visibility import meshes_in_turn, note_changes, without_hidden
from meshreel.formats.surfaces.polygons import PolygonMesh, triangulated
from meshreel.model.notes import CHANGES, Notes, listed
from meshreel.model.sequence import FrameSource, MeshSequence, Vertices
from meshreel.model.surface import Surface
from meshreel.model.surface_selection import differing_names
from meshreel.model.timing import Timing
from meshreel.model.tracks import read_tracks, size_bytes
from meshreel.model.validation import validate_finite
from meshreel.runtime.counting import counted
from meshreel.runtime.progress import Count


def open_scene(read_meshes: ReadMeshes, path: Path, reading: Reading) -> MeshSequence:
    """Open the selected or merged mesh of a file whose meshes `read_meshes` returns.

    Raises
    ------
    FormatError, InvalidInputError
        As `select_mesh` and `open_mesh`.
    """
    mesh = select_mesh(read_meshes, path, reading)
    return MeshSequence.of_segments(open_mesh(mesh, path, reading))


def select_mesh(read_meshes: ReadMeshes, path: Path, reading: Reading) -> SceneMesh:
    """Return the mesh that the options select, or all meshes merged.

    Raises
    ------
    FormatError
        As `read_meshes`.
    InvalidInputError
        If there are several meshes and none is selected, or none has the name; all are listed.
    """
    with errors_naming(path):
        meshes = selected_meshes(read_meshes, path, reading)
        if len(meshes) > 1:
            raise InvalidInputError(
                f"holds {_listed(meshes)}; choose one with ",
                Keyword("object"),
                ", or merge all with ",
                Keyword("merge", True),
            )
        return meshes[0]


def select_frames(read_meshes: ReadMeshes, paths: Sequence[Path], reading: Reading) -> SceneMesh:
    """Return the meshes of several files, which have one frame each, as frames of one mesh.

    Raises
    ------
    FormatError
        When a frame is read: as `select_mesh`, or if a file has several frames.
    """
    compared: set[int] = set()

    @lru_cache(maxsize=2)
    def mesh_of(index: int) -> tuple[SceneMesh, Notes]:
        path, notes = paths[index], Notes()
        mesh = select_mesh(read_meshes, path, replace(reading, notes=notes))
        if len(mesh.times_s) > 1:
            raise FormatError(
                f"{path.name} has {len(mesh.times_s)} frames; files that are read together "
                "must have one each: choose one of them"
            )
        return mesh, notes

    @lru_cache(maxsize=2)
    def contents(index: int) -> tuple[PolygonMesh, Surface]:
        with errors_naming(paths[index]):
            mesh, notes = mesh_of(index)
            polygons, surface = mesh.frame(0), mesh.surface(0)
            mesh.note_unread()
        reading.notes.merge(notes)
        return polygons, surface

    def frame(index: int) -> PolygonMesh:
        if index in compared:  # only the positions are read again
            with errors_naming(paths[index]):
                return mesh_of(index)[0].frame(0)
        polygons, surface = contents(index)
        if index:
            before, earlier = contents(index - 1)
            if polygons.has_faces_of(before):
                reading.notes.left_out(CHANGES, differing_names(earlier, surface))
        compared.add(index)
        return polygons

    name = paths[0].resolve().parent.name
    times_s = np.arange(len(paths), dtype=np.float64)
    return SceneMesh(name, times_s, frame, lambda index: contents(index)[1], fps=0.0)


def selected_meshes(read_meshes: ReadMeshes, path: Path, reading: Reading) -> Sequence[SceneMesh]:
    """Return the mesh that the options name, all merged, or all separately by default.

    Hidden meshes are left out, unless named, and meshes that are visible in turn are one mesh. With
    `skip_bad`, unreadable meshes are left out.

    Raises
    ------
    FormatError
        As `read_meshes`.
    InvalidInputError
        If no mesh or several meshes have the name.
    """
    meshes = read_meshes(path, reading)
    if reading.object is not None:
        mesh = _find_named(meshes, reading.object)
        note_changes([mesh], reading.notes)
        return [mesh]
    meshes = without_hidden(meshes, reading.notes)
    if reading.skip_bad:
        meshes = readable_meshes(meshes, reading)
    joined = meshes_in_turn(meshes, path.stem, reading.notes, merges=reading.merge)
    if joined is not None:
        return [joined]
    if reading.merge and len(meshes) > 1:
        return [merge_meshes(meshes, path.stem, reading.notes)]
    return meshes


def open_mesh(mesh: SceneMesh, path: Path, reading: Reading) -> Iterator[FrameSource]:
    """Yield each range of frames of a mesh with the same faces, loaded if they are small enough.

    All frames are read once now.

    Raises
    ------
    InvalidInputError
        If a position is not finite; the message names the frame.
    """
    with errors_naming(path):
        runs = _read_frames(mesh, reading)
        # Surfaces and tracks depend on what changes in any frame.
        starts, timing = [run.start for run in runs], _timing(mesh, reading)
        for run, stop in zip(runs, [*starts[1:], len(mesh.times_s)], strict=True):
            yield run.sequence(stop, path, reading, timing.part(range(run.start, stop)))
        mesh.note_unread()


def _timing(mesh: SceneMesh, reading: Reading) -> Timing:
    """Return the timing of a mesh; a frame rate of the options replaces its times."""
    if mesh.fps == 0:
        return Timing(reading.fps or 0.0)
    timing = Timing.of_times(mesh.times_s, declared_fps=mesh.fps or 0.0)
    return timing.at_rate(reading.fps or None)


def _read_frames(mesh: SceneMesh, reading: Reading) -> "list[_SceneRun]":
    """Read the frames of a mesh, and compare their faces."""
    runs: list[_SceneRun] = []
    n_frames, budget = len(mesh.times_s), reading.max_loaded_bytes
    if mesh.positions is not None and n_frames > 1:
        first = mesh.frame(0)
        runs, block_frames = (
            [_SceneRun(mesh, 0, first, budget)],
            max(1, BLOCK_BYTES // first.vertices.nbytes),
        )
        for start in range(0, n_frames, block_frames):
            stop = min(start + block_frames, n_frames)
            runs[0].add(mesh.positions(start, stop))
            reading.progress("reading", Count(stop, n_frames, "frames"))
        return runs
    last: PolygonMesh | None = None
    for start, frames in _read_blocks(mesh):
        run_starts = {
            row
            for row, (frame, before) in enumerate(zip(frames, [last, *frames], strict=False))
            if before is None
            or not frame.has_faces_of(before)
            or not mesh.keeps_surface(start + row)
        }
        for row, stop in pairwise(sorted({0, *run_starts, len(frames)})):
            if row in run_starts:
                kept_bytes = sum(run.kept_bytes for run in runs)
                limit = None if budget is None else max(0, budget - kept_bytes)
                runs.append(_SceneRun(mesh, start + row, frames[row], limit))
            runs[-1].add(np.array([frame.vertices for frame in frames[row:stop]]))
        last = frames[-1]
        reading.progress("reading", Count(start + len(frames), n_frames, "frames"))
    return runs


def _read_blocks(mesh: SceneMesh) -> Iterator[tuple[int, list[PolygonMesh]]]:
    """Yield frames whose positions take little memory together, and the number of the first."""
    frames: list[PolygonMesh] = []
    block_bytes, n_frames = 0, len(mesh.times_s)
    for index in range(n_frames):
        frames.append(mesh.frame(index))
        block_bytes += frames[-1].vertices.nbytes
        if block_bytes > BLOCK_BYTES or index + 1 == n_frames:
            yield index + 1 - len(frames), frames
            frames, block_bytes = [], 0


class _SceneRun:
    """Consecutive frames of a mesh with the same faces, kept while they are small.

    Parameters
    ----------
    start : int
        Number of the first frame.
    max_bytes : int, optional
        Size above which frames stay in the file; default: never.
    """

    def __init__(
        self, mesh: SceneMesh, start: int, first: PolygonMesh, max_bytes: int | None
    ) -> None:
        self.first, self.start = first, start
        self._mesh, self._max_bytes = mesh, max_bytes
        self._survey = FrameSurvey()
        self._blocks: list[Vertices] = []
        self._n_frames = 0
        self._is_loaded = True

    @property
    def kept_bytes(self) -> int:
        """Size of the kept frames."""
        return sum(block.nbytes for block in self._blocks)

    def add(self, block: Vertices) -> None:
        """Check the next frames, of shape (K, V, 3), and keep them unless all become too large."""
        validate_finite(block, first_frame=self.start + self._n_frames)
        self._n_frames += len(block)
        self._survey.add(block)
        self._blocks.append(block)
        is_large = self._max_bytes is not None and self.kept_bytes > self._max_bytes
        if is_large or not self._is_loaded:
            self._is_loaded = False
            self._blocks.clear()

    def sequence(self, stop: int, path: Path, reading: Reading, timing: Timing) -> FrameSource:
        """Return the frames up to `stop`; raises as `open_mesh`."""
        mesh, first, n_frames = self._mesh, self.first, stop - self.start
        description = Description(
            triangulated(first, reading.notes),
            mesh.name.rstrip("/").rpartition("/")[2],
            timing,
            first.with_polygons(mesh.surface(self.start)),
            mesh.error_bound,
        )
        tracks = mesh.tracks(range(self.start, stop))
        size = first.vertices.nbytes * n_frames + sum(map(size_bytes, tracks.values()))
        if self._is_loaded and (self._max_bytes is None or size <= self._max_bytes):
            vertices = np.concatenate(self._blocks).astype(self._survey.dtype, copy=False)
            self._blocks.clear()
            return description.sequence(vertices, read_tracks(tracks))
        shape = n_frames, len(first.vertices)
        return description.stored_frames(shape, self._survey, self._read, [path], tracks)

    def _read(self, start: int, stop: int) -> Vertices:
        """Return the positions of frames start..stop - 1 of the run, of shape (K, V, 3)."""
        mesh, dtype = self._mesh, self._survey.dtype
        if mesh.positions is not None and start < stop:
            return mesh.positions(self.start + start, self.start + stop).astype(dtype, copy=False)
        vertices: Vertices = np.empty((stop - start, *self.first.vertices.shape), dtype)
        for row, index in enumerate(range(self.start + start, self.start + stop)):
            vertices[row] = mesh.frame(index).vertices
        return vertices


def _find_named(meshes: Sequence[SceneMesh], name: str) -> SceneMesh:
    matches = [mesh for mesh in meshes if mesh.name == name]
    matches = matches or [
        mesh for mesh in meshes if f"/{mesh.name.strip('/')}".endswith(f"/{name.strip('/')}")
    ]
    # The name of a parent node, such as a transform, selects the only mesh below it.
    matches = matches or [mesh for mesh in meshes if _is_below(mesh.name, name)]
    if len(matches) != 1:
        count_text = "no mesh" if not matches else f"{counted(len(matches), 'mesh')}"
        raise InvalidInputError(f"has {count_text} named {name!r}; it holds {_listed(meshes)}")
    return matches[0]


def _is_below(name: str, node_path: str) -> bool:
    """Whether a node above the mesh has this path, or a path that ends with it."""
    parent_path, part = f"/{name.strip('/')}".rpartition("/")[0], node_path.strip("/")
    return not part or f"/{part}/" in f"{parent_path}/"


def _listed(meshes: Sequence[SceneMesh], max_names: int = 20) -> str:
    if len(meshes) == 1:
        return f"the mesh {meshes[0].name}"
    return f"{counted(len(meshes), 'mesh')}: {listed((mesh.name for mesh in meshes), max_names)}"


def readable_meshes(meshes: Sequence[SceneMesh], reading: Reading) -> list[SceneMesh]:
    """Return the meshes whose frames can all be read; reads them all once now.

    Parameters
    ----------
    reading : Reading
        Its notes receive a sentence that lists the other meshes and their errors.

    Raises
    ------
    FormatError
        If no mesh can be read.
    """
    readable, faults = [], []
    for number, mesh in enumerate(meshes):
        # Cache the surface, so that its notes are added only once.
        cached_mesh = replace(mesh, surface=cache(mesh.surface))
        if fault := _fault(cached_mesh):
            faults.append(f"{mesh.name} ({fault})")
        else:
            readable.append(cached_mesh)
        reading.progress("checking", Count(number + 1, len(meshes), "meshes"))
    if not readable:
        raise FormatError(f"has no readable mesh: {listed(faults)}")
    reading.notes.left_out("meshes that cannot be read", faults)
    return readable


def _fault(mesh: SceneMesh) -> str:
    """Describe why a mesh cannot be read; empty if it can."""
    try:
        first = mesh.frame(0)
        surface = first.with_polygons(mesh.surface(0))
        surface.validated(len(first.vertices), triangulated(first, Notes()))
        for index in range(len(mesh.times_s)):
            frame = mesh.frame(index) if index else first
            validate_finite(frame.vertices[np.newaxis], first_frame=index)
    except MeshReelError as error:
        return str(error)
    return ""
