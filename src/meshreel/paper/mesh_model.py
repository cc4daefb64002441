"""The mesh model shared by encoder and decoder: Laplacian, anchors, isolated vertices."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from meshreel.arrays import Floats, Integers
from meshreel.codec.bitstream.layout import Laplacian
from meshreel.model.geometry.connectivity import isolated_vertices
from meshreel.model.sequence import Faces
from meshreel.paper.graph_fourier import check_basis_size, graph_fourier_basis
from meshreel.paper.laplacian import cotangent_laplacian, uniform_laplacian
from meshreel.paper.reconstruction_system import ReconstructionSystem
from meshreel.runtime.progress import Progress, silent


@dataclass(frozen=True)
class MeshModel:
    """Connectivity and anchors, with the matrices and systems derived from them."""

    faces: Faces
    """Integer array of shape (M, 3). In internal order, like all indices here."""
    n_verts: int
    anchors: Integers
    """Integer array of shape (A,). Ascending; at least one in each component that has an edge."""
    laplacian_choice: Laplacian
    shape: Floats | None = None
    """float64 array of shape (V, 3), or None. Decoded positions from which cotangent weights are
    computed.
    """
    n_frames: int = 0
    """Frames of the whole stream, which can share anchor responses; 0 if unknown."""
    basis_memory: float | None = None
    """Memory limit in bytes of a graph Fourier basis that may take any time. None: the size of the
    basis is limited by `check_basis_size`.
    """
    own_laplacian: csr_array | None = None
    """csr_array of shape (V, V), or None. L of an experiment, instead of `laplacian_choice`."""
    bases: dict[int, Floats] = field(default_factory=dict, compare=False, repr=False)
    """Computed graph Fourier bases by number of modes; `graph_fourier_basis` keeps the last one."""

    @cached_property
    def isolated(self) -> Integers:
        """Vertices without an edge; deltas do not determine them, so they are stored exactly."""
        return isolated_vertices(self.faces, self.n_verts)

    @cached_property
    def laplacian(self) -> csr_array:
        """L of shape (V, V)."""
        if self.own_laplacian is not None:
            return self.own_laplacian
        if self.laplacian_choice is Laplacian.COTANGENT:
            assert self.shape is not None  # the stream contains it
            return cotangent_laplacian(self.faces, self.shape)
        return uniform_laplacian(
            self.faces,
            self.n_verts,
            normalized=self.laplacian_choice is Laplacian.NORMALIZED,
        )

    def graph_fourier_basis(self, n_modes: int, progress: Progress = silent) -> Floats:
        """Low-frequency eigenvectors of D - C, of shape (V, K), independent of `laplacian`.

        The last one is kept, because all blocks of a stream usually have the same number.

        Raises
        ------
        InvalidInputError
            If it takes more memory than `basis_memory`, or too much time without this limit.
        """
        basis = self.bases.get(n_modes)
        if basis is None:
            if self.basis_memory is None:
                check_basis_size(self.n_verts, n_modes)
            laplacian = uniform_laplacian(self.faces, self.n_verts)
            self.bases.clear()
            basis = graph_fourier_basis(
                laplacian, n_modes, memory=self.basis_memory, progress=progress
            )
            self.bases[n_modes] = basis
        return basis

    def reconstruct(self, deltas: Floats, anchor_values: Floats) -> Floats:
        """Solve Eq. 12: values at all vertices, of shape (V, K); 0 at isolated vertices.

        The system is factored once, at the first call.

        Parameters
        ----------
        deltas : float64 array of shape (V, K)
        anchor_values : float64 array of shape (A, K)
        """
        return self._solve(self._system, deltas, anchor_values)

    def reconstruct_uncached(self, deltas: Floats, anchor_values: Floats) -> Floats:
        """Solve as `reconstruct`, but factor the system for this call only."""
        return self._solve(self._new_system(), deltas, anchor_values)

    @cached_property
    def anchor_responses(self) -> Floats:
        """Solutions of Eq. 12, of shape (V, A), for zero deltas and each anchor in turn at 1."""
        return self._system.responses(self.anchors)

    @cached_property
    def _system(self) -> ReconstructionSystem:
        return self._new_system()

    def _new_system(self) -> ReconstructionSystem:
        return ReconstructionSystem(self.laplacian, np.concatenate([self.anchors, self.isolated]))

    def _solve(self, system: ReconstructionSystem, deltas: Floats, anchor_values: Floats) -> Floats:
        zeros = np.zeros((len(self.isolated), anchor_values.shape[1]))
        return system.solve(deltas, np.concatenate([anchor_values, zeros]))
