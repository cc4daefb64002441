"""The frames of a capture, or of a run of it: cleaned on demand, and surveyed."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache, partial
from hashlib import blake2b
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, rows_as_bytes
from meshreel.model.geometry.connectivity import boundary_edges, component_labels, undirected_edges
from meshreel.model.sequence import MeshSequence, Vertices, frames_of, segment_of_frame
from meshreel.model.surface import Domain, Kind
from meshreel.model.tracks import TrackKind
from meshreel.registration.cleaning import MAX_CRACK, CleanMesh, Removed, clean
from meshreel.registration.debris import debris_faces
from meshreel.registration.transfer import RawFrame, attributes_of, items_at_corners, transferable
from meshreel.registration.triangle_mesh import Indices, TriangleMesh
from meshreel.registration.verification import Tolerance

CACHED_VERTICES = 1_000_000
"""Maximum number of vertices of the cleaned frames in memory, about 100 bytes each."""

MIN_CACHED_FRAMES = 4

MAX_FRAGMENT = 0.1
"""An open component up to this share of the area of its frame may be a part cut off by holes."""


class Topology(NamedTuple):
    """Rank of a frame as a key; the greatest is the best.

    A deformation can bring parts of a surface together, but cannot separate parts that touch. So
    the best key has the most components and, among those, the fewest handles, then the fewest
    fragments. Fragments, which holes of a scan cut off, are not components.
    """

    n_components: int
    euler_number: int
    minus_fragments: int = 0

    @classmethod
    def of_mesh(cls, mesh: CleanMesh) -> "Topology":
        """Return the topology of a cleaned frame."""
        labels = component_labels(mesh.faces, len(mesh.vertices))
        of_faces = labels[mesh.faces[:, 0]]
        areas = np.bincount(of_faces, TriangleMesh(mesh.vertices, mesh.faces).areas)
        is_open = np.isin(np.arange(len(areas)), labels[boundary_edges(mesh.faces)])
        is_fragment = is_open & (areas < MAX_FRAGMENT * areas.sum())
        n_fragments = len(np.unique(of_faces[is_fragment[of_faces]]))
        faces = mesh.faces[~is_fragment[of_faces]]
        euler_number = len(np.unique(faces)) - len(undirected_edges(faces)) + len(faces)
        return cls(mesh.n_components - n_fragments, euler_number, -n_fragments)


class Surveyed(NamedTuple):
    """What a survey finds in a frame.

    Attributes
    ----------
    topology : Topology or None
        None without a surface.
    orientation : int
        As of a `TriangleMesh`; 0 without a surface.
    removed : Removed
    names : frozenset of str
        Names of the tracks, other than texture coordinates.
    has_hard_edges : bool
    digest : bytes
        Of the cleaned mesh.
    """

    topology: Topology | None
    orientation: int
    removed: Removed
    names: frozenset[str]
    has_hard_edges: bool
    digest: bytes


@dataclass(frozen=True, eq=False)
class Capture:
    """What the frames of a capture share.

    Attributes
    ----------
    n_frames : int
    low : float64 array of shape (3,)
        Lowest corner of the box of all frames, in the unit of the sequence.
    scale : float
        Longest side of the box, above 0.
    dtype : dtype
        Number type of the positions of the sequence.
    tolerance : Tolerance
        In longest sides of the box.
    keeps_debris : bool
    turned : set of int
        Frames whose faces are turned over; complete after the survey.
    """

    n_frames: int
    low: Floats
    scale: float
    dtype: np.dtype[np.floating]
    tolerance: Tolerance
    keeps_debris: bool
    turned: set[int] = field(default_factory=set)


class Frames:
    """Raw frames of a capture, and the same cleaned, by their numbers.

    Parameters
    ----------
    capture : Capture
    sequence : MeshSequence
        All frames, or some of them.
    first : int
        Number of the first of them.
    """

    def __init__(self, capture: Capture, sequence: MeshSequence, first: int = 0) -> None:
        self.capture, self._sequence, self._first = capture, sequence, first
        n_verts = max(segment.n_verts for segment in sequence.segments)
        cached = lru_cache(max(MIN_CACHED_FRAMES, CACHED_VERTICES // n_verts))
        # Functions, because methods would keep the frames alive in a cycle.
        with_debris = cached(partial(_with_debris, capture, sequence, first))
        self._oriented = cached(partial(_oriented, capture, with_debris))

    def raw(self, number: int) -> MeshSequence:
        """Return a frame as it is, with its surface and tracks."""
        index, local = segment_of_frame(self._sequence.starts, number - self._first)
        return frames_of(self._sequence.segments[index], range(local, local + 1))

    def cleaned(self, number: int) -> CleanMesh:
        """Return a cleaned frame, in the unit of the sequence."""
        mesh = self._oriented(number)
        return mesh.turned() if number in self.capture.turned else mesh

    def mesh(self, number: int) -> TriangleMesh:
        """Return the cleaned surface of a frame, in longest sides of the box."""
        mesh = self.cleaned(number)
        return TriangleMesh(self.normalized(mesh.vertices), mesh.faces)

    def raw_frame(self, number: int) -> RawFrame:
        """Return a raw frame with its cleaned surface."""
        return RawFrame(self.raw(number), self.cleaned(number), self.mesh(number))

    def normalized(self, vertices: npt.NDArray[np.floating]) -> Floats:
        """Return positions in longest sides of the box, from its lowest corner."""
        return np.asarray((vertices.astype(np.float64) - self.capture.low) / self.capture.scale)

    def restored(self, positions: Floats) -> Vertices:
        """Return positions in the unit and the number type of the sequence."""
        capture = self.capture
        return np.asarray((positions * capture.scale + capture.low).astype(capture.dtype))

    def wedges(self, number: int) -> Indices | None:
        """Return a number for each corner of a cleaned frame, of shape (M, 3).

        Corners of a vertex have the same one if they have the same texture coordinates and groups.
        None if vertices have other values, such as colors, which decimation would blur.
        """
        frame, cleaned = self.raw(number), self.cleaned(number)
        if transferable(frame):
            return None
        polygons = items_at_corners(frame, Domain.FACE)[cleaned.raw_faces]
        columns = [cleaned.faces, *(group.numbers[polygons] for group in frame.surface.groups)]
        for attribute in attributes_of(frame):
            if attribute.kind is Kind.UV:
                items = items_at_corners(frame, attribute.domain)[cleaned.raw_faces]
                columns += [*np.moveaxis(attribute.per_item()[cleaned.reordered(items)], -1, 0)]
        rows = np.stack(columns, axis=-1, dtype=np.float64).reshape(-1, len(columns))
        _, numbers = np.unique(rows_as_bytes(rows + 0), return_inverse=True)
        return np.asarray(numbers.reshape(-1, 3))


def _with_debris(
    capture: Capture, sequence: MeshSequence, first: int, number: int
) -> CleanMesh | None:
    """Return a cleaned frame with its debris; None beyond the ends of the capture."""
    if not 0 <= number < capture.n_frames:
        return None
    length, max_area = capture.tolerance.length, capture.tolerance.patch_area * capture.scale**2
    return clean(sequence[number - first], max_area, MAX_CRACK * length * capture.scale)


def _oriented(
    capture: Capture, with_debris: Callable[[int], CleanMesh | None], number: int
) -> CleanMesh:
    """Return a cleaned frame as its faces are oriented in the raw frame."""
    mesh = with_debris(number)
    assert mesh is not None
    return mesh if capture.keeps_debris else mesh.without(debris_faces(with_debris, number))


def survey(frames: Frames, number: int) -> Surveyed:
    """Return what is in a frame."""
    mesh, raw = frames.cleaned(number), frames.raw(number)
    topology, orientation = None, 0
    if not mesh.is_empty:
        topology = Topology.of_mesh(mesh)
        orientation = TriangleMesh(mesh.vertices, mesh.faces).orientation
    return Surveyed(
        topology,
        orientation,
        mesh.removed,
        frozenset(n for n, track in raw.tracks.items() if track.kind is not TrackKind.UV),
        raw.surface.hard_edges is not None,
        blake2b(mesh.vertices.tobytes() + mesh.faces.tobytes()).digest(),
    )
