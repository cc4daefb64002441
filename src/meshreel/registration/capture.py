"""The frames of a capture, or of a run of it: cleaned on demand, and surveyed."""

from dataclasses import dataclass, field
from functools import lru_cache
from hashlib import blake2b
from typing import NamedTuple

import numpy as np

from meshreel.arrays import Floats, rows_as_bytes
from meshreel.model.sequence import MeshSequence, frames_of, segment_of_frame
from meshreel.model.surface import Domain, Kind
from meshreel.model.tracks import TrackKind
from meshreel.registration.cleaning import MAX_CRACK, CleanMesh, Removed, clean
from meshreel.registration.debris import debris_faces
from meshreel.registration.growing import Frames, Topology
from meshreel.registration.transfer import attributes_of, items_at_corners, transferable
from meshreel.registration.triangle_mesh import Indices, TriangleMesh
from meshreel.registration.verification import Tolerance

CACHED_VERTICES = 1_000_000
"""Maximum number of vertices of the cleaned frames in memory, about 100 bytes each."""

MIN_CACHED_FRAMES = 4


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
    low, scale, dtype
        As of `Frames`.
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

    def frames(self, sequence: MeshSequence, first: int = 0) -> Frames:
        """Return the frames of a sequence that begins with frame `first` of the capture."""
        max_removed_area = self.tolerance.patch_area * self.scale**2
        max_crack = MAX_CRACK * self.tolerance.length * self.scale
        n_verts = max(segment.n_verts for segment in sequence.segments)
        cached = lru_cache(max(MIN_CACHED_FRAMES, CACHED_VERTICES // n_verts))

        def raw(number: int) -> MeshSequence:
            index, local = segment_of_frame(sequence.starts, number - first)
            return frames_of(sequence.segments[index], range(local, local + 1))

        @cached
        def with_debris(number: int) -> CleanMesh | None:
            is_frame = 0 <= number < self.n_frames
            return (
                clean(sequence[number - first], max_removed_area, max_crack) if is_frame else None
            )

        @cached
        def as_oriented(number: int) -> CleanMesh:
            mesh = with_debris(number)
            assert mesh is not None
            return mesh if self.keeps_debris else mesh.without(debris_faces(with_debris, number))

        def cleaned(number: int) -> CleanMesh:
            mesh = as_oriented(number)
            return mesh.turned() if number in self.turned else mesh

        def wedges(number: int) -> Indices | None:
            return _wedges(raw(number), cleaned(number))

        return Frames(self.n_frames, raw, cleaned, wedges, self.low, self.scale, self.dtype)


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


def _wedges(frame: MeshSequence, cleaned: CleanMesh) -> Indices | None:
    """Return a number for each corner of a cleaned frame, of shape (M, 3).

    Corners of a vertex have the same one if they have the same texture coordinates and groups. None
    if vertices have other values, such as colors, which decimation would blur.
    """
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
