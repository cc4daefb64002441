"""Frame files to one array of positions and one list of faces."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.decimal_text import narrow_if_harmless
from meshreel.formats.polygons import PolygonMesh, describe_fans, triangulate_fans
from meshreel.formats.registry import FrameFormat
from meshreel.formats.welding import weld_corners
from meshreel.progress import Progress
from meshreel.sequence import Faces, Vertices


def read_frames(
    paths: Sequence[Path], found: FrameFormat, *, progress: Progress, notes: list[str]
) -> tuple[Vertices, Faces]:
    """Positions of shape (T, V, 3) and triangles of shape (M, 3) of frame files.

    Memory holds the result and one frame. Files without shared vertices are read twice: first to
    find the corners that coincide in every frame, then to keep one of each.

    Parameters
    ----------
    paths : sequence of Path
        One file a frame, in order.
    found : FrameFormat
        The format of all of them.
    progress : Progress
        Told of every frame read.
    notes : list of str
        Gains a sentence for everything that was changed on the way.

    Raises
    ------
    FormatError
        Naming the file that cannot be read.
    InvalidInputError
        Naming the file and frame whose vertex count or faces differ from the first frame's.
    """
    if found.has_corners_only:
        weld = weld_corners(mesh.vertices for mesh in _meshes(paths, found, progress, "welding"))
        notes.append(weld.description)
        meshes = _meshes(paths, found, progress, "reading")
        kept = (mesh.vertices[weld.representatives] for mesh in meshes)
        return _finish(_stack(kept, len(paths)), found), weld.faces
    meshes = _meshes(paths, found, progress, "reading")
    first = next(meshes)
    if note := describe_fans(first.counts):
        notes.append(note)
    faces = triangulate_fans(first.counts, first.corners)

    def positions() -> Iterator[Vertices]:
        yield first.vertices
        for mesh in meshes:
            yield mesh.vertices

    return _finish(_stack(positions(), len(paths)), found), faces


def _finish(vertices: Vertices, found: FrameFormat) -> Vertices:
    return narrow_if_harmless(vertices) if found.is_decimal else vertices


def _stack(frames: Iterator[Vertices], n_frames: int) -> Vertices:
    """The frames as one array, in the widest float type of them, filled as they come."""
    first = next(frames)
    stack = np.empty((n_frames, *first.shape), dtype=first.dtype)
    stack[0] = first
    with np.errstate(invalid="ignore"):
        for index, frame in enumerate(frames, start=1):
            if frame.dtype.itemsize > stack.dtype.itemsize:
                stack = stack.astype(frame.dtype)
            stack[index] = frame
    return stack


def _meshes(
    paths: Sequence[Path], found: FrameFormat, progress: Progress, stage: str
) -> Iterator[PolygonMesh]:
    """Each frame, once it is known to have the vertex count and the faces of the first."""
    first: PolygonMesh | None = None
    for index, path in enumerate(paths):
        mesh = _read_mesh(path, found)
        first = mesh if first is None else first
        if difference := _difference(mesh, first):
            raise InvalidInputError(
                f"{path} (frame {index}) has {difference} in frame 0 ({paths[0].name}); all frames "
                "of a sequence must have the same vertices and faces"
            )
        yield mesh
        progress(stage, (index + 1) / len(paths))


def _read_mesh(path: Path, found: FrameFormat) -> PolygonMesh:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InvalidInputError(f"{path} cannot be read: {error.strerror}") from error
    if not data:
        raise FormatError(f"{path}: is empty; expected a mesh in {found.ending} format")
    try:
        return found.parse(data)
    except FormatError as error:
        raise FormatError(f"{path}: {error}") from None


def _difference(mesh: PolygonMesh, first: PolygonMesh) -> str:
    """How a frame differs from the first, as in "8 vertices; expected 12 as"; empty if not."""
    if len(mesh.vertices) != len(first.vertices):
        return f"{len(mesh.vertices)} vertices; expected {len(first.vertices)} as"
    if len(mesh.counts) != len(first.counts):
        return f"{len(mesh.counts)} faces; expected {len(first.counts)} as"
    if (mesh.counts != first.counts).any():
        face = int(np.argmax(mesh.counts != first.counts))
        return f"{mesh.counts[face]} corners in face {face}; expected {first.counts[face]} as"
    if (mesh.corners != first.corners).any():
        corner = int(np.argmax(mesh.corners != first.corners))
        face = int(np.searchsorted(np.cumsum(mesh.counts), corner, side="right"))
        came, expected = mesh.corners[corner], first.corners[corner]
        return f"vertex {came} in face {face}; expected vertex {expected} as"
    return ""
