"""Detection of hard edges from corner normals or smoothing groups."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.kernel.polygons import triangulate
from meshreel.model.geometry.hard_edges import Int32s, corner_normals, next_corners, shared_edges
from meshreel.model.geometry.normals import face_normals
from meshreel.model.notes import NORMALS, Note, NoteKind, Notes
from meshreel.model.surface import Surface
from meshreel.runtime.counting import counted

SHARED_DEG = 0.1
"""Normals of two faces at a vertex that differ by less are equal."""

NEAR_DEG = 15.0
"""Notes report recomputed normals with a larger error."""

GAIN = 0.99
"""More hard edges must reduce the mean error to below this fraction of it."""


@dataclass(frozen=True, eq=False)
class HardEdges:
    """Hard edges, and the error of the normals computed with them."""

    edges: Int32s | None
    """int32 array of shape (H, 2) or None."""
    n_shared: int
    """Number of edges between faces."""
    n_far: int
    n_corners: int
    """Number of corners whose normal error exceeds `NEAR_DEG`, and of all corners with a normal."""
    source: str = NORMALS
    """What notes call the contents from which edges follow, if none do."""


def find_hard_edges(mesh: PolygonMesh, normals: npt.NDArray[np.floating]) -> HardEdges:
    """Find the hard edges with which recomputed normals are nearest to the given ones.

    Candidates are no edges, the edges across which normals differ at both ends, those where they
    differ at one end, and all edges if these are most, since finely faceted surfaces have coplanar
    neighbors. Normals that point inward on average are reversed first.

    Parameters
    ----------
    normals : float array of shape (C, 3)
        Normal of each corner, of any length; 0 or NaN if it has none.
    """
    with np.errstate(all="ignore"):  # frame validation reports non-finite positions
        return _find_hard_edges(mesh, normals)


def _find_hard_edges(mesh: PolygonMesh, normals: npt.NDArray[np.floating]) -> HardEdges:
    counts, corners = mesh.counts, mesh.corners
    units = _units(normals)
    is_known = np.asarray(units.any(axis=1))
    faces, _ = triangulate(counts, corners, mesh.vertices)
    sizes = counts.astype(np.int32)
    vectors = np.add.reduceat(
        face_normals(mesh.vertices, faces), np.cumsum(counts - 2) - counts + 2
    )
    if np.einsum("ij,ij", units, np.repeat(vectors, counts, axis=0)) < 0:
        units = -units
    areas = np.linalg.norm(vectors, axis=1)
    weights = np.where(is_known, np.repeat(areas / counts, counts), 0)

    def angles(edges: Int32s | None) -> Floats:
        computed_normals = corner_normals(mesh.vertices, faces, Surface(sizes, hard_edges=edges))
        # Half the chord: the cosine of a small angle resolves only 0.02 degrees.
        halves = np.linalg.norm(computed_normals - units, axis=1) / 2
        return np.asarray(2 * np.degrees(np.arcsin(halves.clip(0, 1))))

    shared = shared_edges(counts, corners)
    at_low, at_high = _differences(counts, corners, shared.of_side, units, is_known)
    best, edges = angles(None), None
    at_both, at_either = at_low & at_high, at_low | at_high
    candidates = [at_both, at_either] if (at_either != at_both).any() else [at_both]
    if 2 * at_either.sum() > len(at_either) and not at_either.all():
        candidates.append(np.ones_like(at_either))
    for is_hard in candidates:
        if not is_hard.any():
            continue
        candidate = shared.ends[is_hard].astype(np.int32)
        errors = weights * best
        is_split = np.zeros(len(mesh.vertices), bool)
        is_split[candidate] = True
        # Normals at all other vertices stay the same.
        if errors[~is_split[corners]].sum() > GAIN * errors.sum():
            continue
        new_angles = angles(candidate)
        if (weights * new_angles).sum() < GAIN * (weights * best).sum():
            best, edges = new_angles, candidate
    n_far = int((best[is_known & (weights > 0)] > NEAR_DEG).sum())
    return HardEdges(edges, len(shared.ends), n_far, int(is_known.sum()))


def edges_between_groups(mesh: PolygonMesh, groups: npt.NDArray[np.integer]) -> HardEdges:
    """Return the edges between faces of different smoothing groups as hard edges.

    Parameters
    ----------
    groups : integer array of shape (P,)
        Smoothing group of each face; group 0 means no smoothing.
    """
    shared = shared_edges(mesh.counts, mesh.corners)
    sides = np.flatnonzero(shared.of_side >= 0)
    edges, of_side = shared.of_side[sides], np.repeat(groups, mesh.counts)[sides]
    _, first = np.unique(edges, return_index=True)
    is_hard = np.zeros(len(shared.ends), bool)
    is_hard[edges[(of_side == 0) | (of_side != of_side[first][edges])]] = True
    hard_edges = shared.ends[is_hard].astype(np.int32) if is_hard.any() else None
    return HardEdges(hard_edges, len(shared.ends), 0, 0, "smoothing groups, which share no edges")


class NormalNotes:
    """Notes on the conversion of normals to hard edges, updated with each mesh of a file.

    Parameters
    ----------
    notes : Notes
        Receives one or two sentences, which are replaced when a mesh is added.
    """

    def __init__(self, notes: Notes) -> None:
        self._notes = notes
        self._meshes: dict[str, HardEdges] = {}
        self._added_notes: list[Note] = []

    def add(self, name: str, hard_edges: HardEdges, *, is_track: bool = False) -> None:
        """Add a mesh, replacing an earlier one of the same name.

        Parameters
        ----------
        is_track : bool, default False
            Whether its normals are also stored as a track.
        """
        if is_track and hard_edges.edges is None:
            return
        self._meshes[name] = replace(hard_edges, n_far=0) if is_track else hard_edges
        self._notes[:] = [note for note in self._notes if note not in self._added_notes]
        self._added_notes = list(_notes_on(self._meshes.values()))
        self._notes += self._added_notes


def _notes_on(meshes: Collection[HardEdges]) -> Iterator[Note]:
    n_hard = sum(len(mesh.edges) for mesh in meshes if mesh.edges is not None)
    n_shared = sum(mesh.n_shared for mesh in meshes)
    if n_hard:
        text = (
            f"kept {n_hard} of {counted(n_shared, 'edge')} as hard edges, from which normals are "
            "computed in every frame"
        )
        yield Note(NoteKind.CHANGED, "hard edges", text=text)
    else:
        yield from (Note(NoteKind.LEFT_OUT, source) for source in {mesh.source for mesh in meshes})
    if n_far := sum(mesh.n_far for mesh in meshes):
        n_corners = sum(mesh.n_corners for mesh in meshes)
        text = (
            f"normals do not follow from the faces at {n_far} of {counted(n_corners, 'corner')}, "
            f"by more than {NEAR_DEG:g} degrees"
        )
        yield Note(NoteKind.CHANGED, NORMALS, text=text)


def _units(normals: npt.NDArray[np.floating]) -> Floats:
    """Normalize normals; undefined ones become 0."""
    vectors = np.asarray(normals, np.float64)
    lengths = np.linalg.norm(np.nan_to_num(vectors), axis=1, keepdims=True)
    is_known = np.isfinite(vectors).all(axis=1, keepdims=True) & (lengths > 0)
    return np.asarray(np.divide(vectors, lengths, out=np.zeros_like(vectors), where=is_known))


def _differences(
    counts: npt.NDArray[np.integer],
    corners: npt.NDArray[np.integer],
    of_side: npt.NDArray[np.int64],
    units: Floats,
    is_known: npt.NDArray[np.bool_],
) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """Whether normals differ across each shared edge, at its lower and at its higher vertex."""
    sides = np.flatnonzero(of_side >= 0)
    following = next_corners(counts)[sides]
    is_forward = corners[sides] < corners[following]
    edges = of_side[sides]
    n_edges = int(edges.max(initial=-1)) + 1
    first = np.empty(n_edges, np.int64)
    first[edges[::-1]] = np.arange(len(edges))[::-1]  # all edges have sides
    limit = 2 * np.sin(np.radians(SHARED_DEG) / 2)
    masks = []
    for ends in (np.where(is_forward, sides, following), np.where(is_forward, following, sides)):
        reference = ends[first][edges]
        is_different = np.linalg.norm(units[ends] - units[reference], axis=1) > limit
        differs = np.zeros(n_edges, bool)
        differs[edges[is_different & is_known[ends] & is_known[reference]]] = True
        masks.append(differs)
    return masks[0], masks[1]
