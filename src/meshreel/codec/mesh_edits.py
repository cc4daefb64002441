"""Meshes as edits of other ones: vertices and faces that are kept, dropped or inserted.

A segment whose mesh is nearly that of an earlier one, as of a simulation that deletes elements or a
character that changes props, then stores neither its connectivity nor its order again.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from meshreel.arrays import Integers, n_equal_before
from meshreel.codec.bitstream.container import write_varint
from meshreel.codec.connectivity.coder import CodedConnectivity, encode_connectivity
from meshreel.codec.connectivity.order import inverse_permutation
from meshreel.codec.mesh_matching import MAX_VERTS, FaceIndex, longest_ascending, match_vertices
from meshreel.kernel.integers import encode_integers
from meshreel.kernel.order import opposite_sides
from meshreel.model.geometry.triangles import matching_corners
from meshreel.model.sequence import Faces

SMALL_BYTES_PER_FACE = 1 / 16
"""Size of an edit, in bytes per face, up to which no smaller edit is searched for."""

MAX_SIZE = 1 / 2
"""Maximum size of any other edit, relative to the connectivity and order that it replaces."""

N_SAMPLES = 128
"""Number of faces compared first, because most pairs of meshes are unrelated."""


@dataclass(frozen=True, eq=False)
class BaseMesh:
    """A mesh that is not an edit itself; all edits of it share its coded connectivity."""

    faces: Faces
    """int32 array of shape (M_b, 3)."""
    n_verts: int
    """V_b."""

    @cached_property
    def connectivity(self) -> CodedConnectivity:
        """Its connectivity, with the order of vertices and faces."""
        return encode_connectivity(self.faces, self.n_verts, order="keep")

    @cached_property
    def index(self) -> FaceIndex:
        """Its faces by their vertices."""
        return FaceIndex(self.faces, self.n_verts)


@dataclass(frozen=True, eq=False)
class MeshEdit:
    """A mesh as an edit of a base mesh, both in their given orders."""

    base: BaseMesh
    base_verts: Integers
    """int64 array of shape (V,). Number of each vertex in the base, ascending, or -1 if it is new.
    """
    base_faces: Integers
    """int64 array of shape (M,). Number of each face in the base, ascending, or -1 if it is new."""
    payload: bytes
    """Payload of the section EDIT."""

    def connectivity_of(self, faces: Faces) -> CodedConnectivity:
        """Return the connectivity of the edited mesh, whose payloads are those of the base.

        Parameters
        ----------
        faces : int32 array of shape (M, 3)
            The edited mesh.
        """
        base, n_base_verts = self.base.connectivity, self.base.n_verts
        old_verts = np.flatnonzero(self.base_verts >= 0)
        rank = inverse_permutation(base.internal_to_given)[self.base_verts[old_verts]]
        order = np.concatenate([old_verts[np.argsort(rank)], np.flatnonzero(self.base_verts < 0)])
        to_internal = inverse_permutation(order).astype(np.int32)
        number = np.full(n_base_verts, -1)
        number[self.base_verts[old_verts]] = old_verts
        to_given = base.internal_to_given[base.internal_faces]
        internal_of = matching_corners(self.base.faces, to_given, n_base_verts) // 3
        is_new = self.base_faces < 0
        stored_faces = np.sort(internal_of[self.base_faces[~is_new]])
        all_faces = np.concatenate([number[to_given[stored_faces]], faces[is_new]])
        internal = to_internal[all_faces].astype(np.int32)
        twins = opposite_sides(internal, len(order))
        return replace(base, internal_to_given=order, internal_faces=internal, internal_twins=twins)


def find_edit(base: BaseMesh, faces: Faces, n_verts: int) -> MeshEdit | None:
    """Return the edit that turns a mesh into another one, or None if it is not small.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)
    n_verts : int
        V.
    """
    if base.n_verts > MAX_VERTS or not 0 < len(faces) <= 2 * len(base.faces):
        return None
    candidates = []
    if _shares_faces(base.index, faces, base.n_verts - n_verts):
        edit = _edit_with(base, faces, _split_vertices(base.index, faces, n_verts))
        if edit is not None and len(edit.payload) <= SMALL_BYTES_PER_FACE * len(faces):
            return edit
        candidates.append(edit)
    verts = match_vertices(base.index, faces, n_verts)
    if verts is not None:
        candidates.append(_edit_with(base, faces, verts))
    edits = [edit for edit in candidates if edit is not None]
    smallest = min(edits, key=lambda edit: len(edit.payload), default=None)
    if smallest is None:
        return None
    # The connectivity and order of the base usually take fewer bytes than those of the mesh, and
    # are coded only once for all edits.
    if len(smallest.payload) <= MAX_SIZE * base.connectivity.size_bytes:
        return smallest
    without_edit = encode_connectivity(faces, n_verts, order="keep")
    return smallest if len(smallest.payload) <= MAX_SIZE * without_edit.size_bytes else None


def _edit_with(base: BaseMesh, faces: Faces, verts: Integers) -> MeshEdit | None:
    """Return the edit in which vertices have these numbers, or None if most faces are new."""
    index, candidates = base.index, verts[faces]
    keys = index.keys(candidates)
    ranks = np.searchsorted(index.sorted_keys, keys) + n_equal_before(keys)
    is_in_base = ranks < len(index.faces)
    ranks = np.minimum(ranks, len(index.faces) - 1)
    is_in_base &= (index.sorted_keys[ranks] == keys) & (candidates.min(axis=1) >= 0)
    base_faces = np.where(is_in_base, index.by_key[ranks], -1)
    ascending = longest_ascending(base_faces[is_in_base])
    base_faces[np.flatnonzero(is_in_base)[~ascending]] = -1
    if 2 * np.count_nonzero(base_faces < 0) > len(faces):
        return None
    steps = [*_steps(verts, base.n_verts), *_steps(base_faces, len(base.faces))]
    corners = np.diff(faces[base_faces < 0].astype(np.int64).reshape(-1), prepend=0)
    counts = base.n_verts, len(base.faces), len(steps[0]), len(steps[3]), len(corners) // 3
    payload = b"".join(map(write_varint, counts)) + encode_integers([*steps, corners])
    return MeshEdit(base, verts, base_faces, payload)


def _shares_faces(index: FaceIndex, faces: Faces, shift: int) -> bool:
    """Whether a quarter of a sample of faces is in the base, with equal or shifted vertices."""
    sample = faces[:: max(1, len(faces) // N_SAMPLES)]
    sample_keys = np.unique(index.keys(np.concatenate([sample, sample + shift])))
    ranks = np.minimum(np.searchsorted(sample_keys, index.face_keys), len(sample_keys) - 1)
    return 4 * len(np.unique(ranks[sample_keys[ranks] == index.face_keys])) >= len(sample)


def _split_vertices(index: FaceIndex, faces: Faces, n_verts: int) -> Integers:
    """Return the number of each vertex in the base, or -1.

    Vertices before a split have the same number in both meshes; those after it have the same number
    counted from the end. The split is chosen to keep the most faces.
    """
    shift = index.n_verts - n_verts
    before = np.zeros(n_verts + 1, np.int64)  # faces that are kept if all vertices below are
    after = np.zeros(n_verts + 1, np.int64)
    last = np.minimum(faces.max(axis=1) + 1, n_verts)
    fits = index.contains(faces)
    np.add.at(before, last[fits], 1)
    first = faces.min(axis=1)
    fits = index.contains(faces + shift)
    np.add.at(after, first[fits] + min(shift, 0), 1)
    n_kept_if_split = np.cumsum(before) + np.cumsum(after[::-1])[::-1]
    low = min(n_verts, index.n_verts)
    split = int(np.argmax(n_kept_if_split[: low + 1]))
    numbers = np.arange(n_verts)
    numbers[split:] += shift
    if shift < 0:
        numbers[split : split - shift] = -1
    return numbers


def _steps(numbers: Integers, n_base: int) -> list[Integers]:
    """Return the numbers of items that each step keeps, then drops, then inserts."""
    is_new = numbers < 0
    # A step begins with an item that is kept after others were dropped or inserted.
    expected = np.concatenate([[0], np.maximum.accumulate(np.where(is_new, -1, numbers)) + 1])
    starts_step = ~is_new & ((numbers != expected[:-1]) | np.concatenate([[False], is_new[:-1]]))
    bounds = np.concatenate([[0], np.flatnonzero(starts_step), [len(numbers)]])
    n_kept, n_dropped, n_inserted = [], [], []
    for start, stop in pairwise(bounds):
        n_new = int(np.count_nonzero(is_new[start:stop]))
        next_number = int(numbers[stop]) if stop < len(numbers) else n_base
        n_kept.append(stop - start - n_new)
        n_dropped.append(next_number - int(expected[stop]))
        n_inserted.append(n_new)
    if not (n_dropped[-1] or n_inserted[-1]):  # all others are kept
        n_kept, n_dropped, n_inserted = n_kept[:-1], n_dropped[:-1], n_inserted[:-1]
    return [np.array(column, np.int64) for column in (n_kept, n_dropped, n_inserted)]


class MeshEdits:
    """Compares each mesh of a stream with the last one that is not an edit."""

    def __init__(self) -> None:
        self._base: BaseMesh | None = None

    def edit_to(self, faces: Faces, n_verts: int) -> MeshEdit | None:
        """Return an edit to the next mesh of the stream, or None if it is the next base."""
        base = self._base
        if base is not None:
            if n_verts == base.n_verts and np.array_equal(faces, base.faces):
                return None
            edit = find_edit(base, faces, n_verts)
            if edit is not None:
                return edit
        self._base = BaseMesh(faces, n_verts)
        return None
