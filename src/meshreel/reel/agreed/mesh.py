"""The mesh as `reel` codes it: a hierarchy of its vertices, their stencils and coding passes."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from meshreel.geometry.connectivity import adjacency_matrix, neighbours_of
from meshreel.kernel.fields import Pass
from meshreel.kernel.predict import Hierarchy
from meshreel.reel.agreed.hierarchy import Resolution, build_hierarchy
from meshreel.reel.agreed.smooth import smooth_fields
from meshreel.runtime.profiling import staged
from meshreel.sequence import Faces

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

Connectivity = tuple[bytes, int, int]
"""Faces as the bytes of int32, number of vertices, stencil size."""

N_CONTEXT_NEIGHBOURS = 8
"""Most vertices whose residuals are the context of a residual."""


@dataclass(frozen=True)
class FieldMesh:
    """All that both sides derive from connectivity, whatever the quantisation step.

    Attributes
    ----------
    faces : int32 array of shape (M, 3)
        In internal order, as everything here.
    n_verts : int
    stencil_size : int
        Vertices that predict one.

    Only connectivity is pickled. A process that is given the same one again finds the derived
    parts it had before.
    """

    faces: Faces
    n_verts: int
    stencil_size: int

    @property
    def connectivity(self) -> Connectivity:
        """All that it follows from; see `shared_field_mesh`."""
        return self.faces.tobytes(), self.n_verts, self.stencil_size

    def __reduce__(self) -> tuple[Any, ...]:
        return shared_field_mesh, self.connectivity

    @cached_property
    def adjacency(self) -> csr_array:
        """Binary, of shape (V, V)."""
        return adjacency_matrix(self.faces, self.n_verts)

    @cached_property
    @staged("hierarchy")
    def resolutions(self) -> list[Resolution]:
        """The hierarchy of the vertices, from coarse to fine."""
        return build_hierarchy(self.adjacency, self.stencil_size)

    @cached_property
    def levels(self) -> list[Integers]:
        """Vertices of each level, all resolutions in a row."""
        return self.levels_of(slice(None))

    def levels_of(self, resolutions: slice) -> list[Integers]:
        """Vertices of each level of some resolutions."""
        return [
            level for resolution in self.resolutions[resolutions] for level in resolution.levels
        ]

    @cached_property
    def order(self) -> Integers:
        """The vertices in coding order: coarsest resolution first, level after level."""
        return np.concatenate([resolution.predicted for resolution in self.resolutions])

    @cached_property
    def number(self) -> Integers:
        """Place of each vertex in coding order."""
        number = np.empty(self.n_verts, np.int64)
        number[self.order] = np.arange(self.n_verts)
        return number

    @cached_property
    @staged("stencils")
    def hierarchy(self) -> Hierarchy:
        """All that predicts fields, in coding order."""
        number = self.number
        stencil = np.full((self.n_verts, self.stencil_size), -1, np.int32)
        hops = np.zeros((self.n_verts, self.stencil_size), np.uint8)
        smooth, starts, n_rows = [], [], 0
        for resolution in self.resolutions:
            rows, size = number[resolution.predicted], resolution.stencil.shape[1]
            near = resolution.stencil
            stencil[rows, :size] = np.where(near >= 0, number[near], -1)
            hops[rows, :size] = resolution.hops
            smooth.append(smooth_fields(resolution)[np.argsort(number[resolution.members])])
            starts += [n_rows] * len(resolution.levels)
            n_rows += len(resolution.members)
        return Hierarchy(
            np.concatenate([[0], np.cumsum([len(level) for level in self.levels])]),
            np.array(starts, np.int64),
            stencil,
            hops,
            np.concatenate(smooth),
        )

    @cached_property
    @staged("coding passes")
    def passes(self) -> list[Pass]:
        """The order in which residuals of a field are coded, with context neighbours of each."""
        return [_pass(resolution) for resolution in self.resolutions]


@lru_cache(maxsize=2)
def shared_field_mesh(faces: bytes, n_verts: int, stencil_size: int) -> FieldMesh:
    """The mesh of this connectivity; the same object each time, so that work is done once."""
    triangles = np.frombuffer(faces, np.int32).reshape(-1, 3)
    return FieldMesh(triangles, n_verts, stencil_size)


def _pass(resolution: Resolution) -> Pass:
    """The vertices of all levels, with those next to them in their level, then their stencil."""
    near = np.hstack([_before_in_level(resolution), resolution.stencil])
    is_there = near >= 0
    used = is_there & (np.cumsum(is_there, axis=1) <= N_CONTEXT_NEIGHBOURS)
    starts = np.concatenate([[0], np.cumsum(used.sum(axis=1))])
    return Pass(resolution.predicted, starts, near[used])


def _before_in_level(resolution: Resolution) -> Integers:
    """For each predicted vertex the first vertices of its level that are next to it and lower.

    Of shape (n, N_CONTEXT_NEIGHBOURS), ascending; -1 where there are no more.
    """
    predicted = np.searchsorted(resolution.members, resolution.predicted)
    level_of = np.full(len(resolution.members), -1)
    level_of[predicted] = np.repeat(
        np.arange(len(resolution.levels)), [len(level) for level in resolution.levels]
    )
    counts, near = neighbours_of(resolution.adjacency, predicted)
    rows = np.repeat(np.arange(len(predicted)), counts)
    is_before = (level_of[near] == level_of[predicted[rows]]) & (near < predicted[rows])
    rows, near = rows[is_before], near[is_before]
    order = np.lexsort((near, rows))
    rows, near = rows[order], near[order]
    places = np.arange(len(rows)) - np.searchsorted(rows, rows)
    fits = places < N_CONTEXT_NEIGHBOURS
    found = np.full((len(predicted), N_CONTEXT_NEIGHBOURS), -1)
    found[rows[fits], places[fits]] = resolution.members[near[fits]]
    return found
