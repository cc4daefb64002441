"""Graph Fourier basis: low-frequency eigenvectors of a Laplacian."""

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import eigsh

from meshreel.arrays import Floats
from meshreel.codec.subspace.pca import fix_signs
from meshreel.errors import InvalidInputError
from meshreel.runtime.counting import counted

MAX_BASIS_BYTES = 1 << 31
"""Limit of the search space, 2 K + 1 vectors of V numbers."""

MAX_WORK = 1 << 36
"""Limit of V K^2, to which time is proportional; a few minutes."""

DIAGONAL_SPREAD = 1e-3
"""Largest number added to the diagonal of L."""

GOLDEN_RATIO = (5**0.5 - 1) / 2


def graph_fourier_basis(laplacian: csr_array, n_modes: int) -> Floats:
    """Eigenvectors of the K smallest eigenvalues of L, one per column: the basis of Eq. 6.

    Symmetric meshes, and meshes with several components, have multiple eigenvalues, whose
    eigenvectors are unique only up to a rotation and would differ between machines. Numbers in
    0..0.001 that follow the golden ratio are therefore added to the diagonal; they separate these
    eigenvalues and change the others by at most as much.

    Parameters
    ----------
    laplacian : csr_array of shape (V, V)
        Symmetric, positive semi-definite.
    n_modes : int
        K, in 1..V.

    Returns
    -------
    float64 array of shape (V, K), columns orthonormal, by ascending frequency

    Raises
    ------
    InvalidInputError
        If it would take too much memory or time; the message names the largest number of modes.
    """
    n_verts = laplacian.shape[0]
    check_basis_size(n_verts, n_modes)
    spread = DIAGONAL_SPREAD * ((np.arange(n_verts) * GOLDEN_RATIO) % 1)
    matrix = csc_array(laplacian + diags_array(spread))
    if n_modes > n_verts // 3:
        vectors = np.linalg.eigh(matrix.toarray())[1][:, :n_modes]
    else:
        # The shift lies below all eigenvalues, so that the factored matrix is definite.
        values, vectors = eigsh(matrix, k=n_modes, sigma=-0.01, v0=np.ones(n_verts))
        vectors = vectors[:, np.argsort(values)]
    return fix_signs(vectors)


def check_basis_size(n_verts: int, n_modes: int) -> None:
    """Raise InvalidInputError if a basis of this size exceeds the limits of memory and time."""
    if not 1 <= n_modes <= n_verts:
        raise InvalidInputError(f"n_modes must be in 1..{n_verts}, the vertices; got {n_modes}")
    dense = n_modes > n_verts // 3
    n_bytes = 8 * n_verts * (3 * n_verts if dense else 2 * n_modes + 1)
    work = n_verts**3 if dense else n_verts * n_modes**2
    if n_bytes <= MAX_BASIS_BYTES and work <= MAX_WORK:
        return
    possible = min(int((MAX_WORK / n_verts) ** 0.5), MAX_BASIS_BYTES // (16 * n_verts))
    raise InvalidInputError(
        f"{n_modes} graph frequencies of {counted(n_verts, 'vertex')} need {n_bytes / 1e9:.1f} GB "
        f"or too much time; use at most {min(possible, n_verts // 3)} (n_modes=), or another method"
    )
