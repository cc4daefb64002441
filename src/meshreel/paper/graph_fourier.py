"""Graph Fourier basis: low-frequency eigenvectors of a Laplacian."""

import time

import numpy as np
import scipy.linalg
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import eigsh

from meshreel.arrays import Floats
from meshreel.codec.memory import memory_limit
from meshreel.codec.subspace.pca import fix_signs
from meshreel.errors import InvalidInputError, Keyword
from meshreel.runtime.counting import counted, duration_text, size_text
from meshreel.runtime.progress import Progress, silent

MAX_WORK = 1 << 36
"""Limit of `check_basis_size`; the decomposition then takes a few minutes."""

MAX_SPARSE_RATIO = 5
"""With more than V / 5 frequencies the dense solver is faster than the sparse one."""

SAMPLE_VERTS = 1500
"""Rows of the matrix that `estimated_seconds` decomposes, which takes less than a second."""

DIAGONAL_SPREAD = 1e-3
"""Largest number added to the diagonal of L."""

GOLDEN_RATIO = (5**0.5 - 1) / 2

COLUMNS_AT_ONCE = 64
"""Columns whose signs are fixed together, so that copies of them stay small."""


def graph_fourier_basis(
    laplacian: csr_array,
    n_modes: int,
    *,
    memory: float | str | None = None,
    progress: Progress = silent,
) -> Floats:
    """Eigenvectors of the K smallest eigenvalues of L, one per column: the basis of Eq. 6.

    Symmetric meshes, and meshes with several components, have multiple eigenvalues, whose
    eigenvectors are unique only up to a rotation and would differ between machines. Numbers in
    0..0.001 that follow the golden ratio are therefore added to the diagonal; they separate these
    eigenvalues and change the others by at most as much.

    The time of more than V / 5 vectors grows with V^3: seconds for 3,000 vertices, minutes for
    10,000.

    Parameters
    ----------
    laplacian : csr_array of shape (V, V)
        Symmetric, positive semi-definite.
    n_modes : int
        K, in 1..V.
    memory : float or str, optional
        Upper limit for the decomposition: bytes, or text such as "2GiB". Default: 2 GiB.
    progress : callable, optional
        Called before the decomposition. The stage states its memory, and its time if that exceeds
        what decoders spend, estimated from a small decomposition.

    Returns
    -------
    float64 array of shape (V, K), columns orthonormal, by ascending frequency

    Raises
    ------
    InvalidInputError
        If `n_modes` is out of range, or more memory is needed.
    """
    n_verts = laplacian.shape[0]
    _check_range(n_verts, n_modes)
    n_bytes, limit_bytes = basis_bytes(n_verts, n_modes), memory_limit(memory).limit_bytes
    if n_bytes > limit_bytes:
        raise InvalidInputError(
            f"{_frequencies_text(n_verts, n_modes)} take {size_text(n_bytes)} of memory, and "
            f"{size_text(limit_bytes)} are allowed; allow more with ",
            Keyword("memory"),
            ", or use fewer (",
            Keyword("n_modes"),
            ")",
        )
    stage = f"decomposing {counted(n_modes, 'graph frequency')} with {size_text(n_bytes)}"
    if progress is not silent and _work(n_verts, n_modes) > MAX_WORK:
        progress(stage, 0.0)
        seconds = estimated_seconds(laplacian, n_modes)
        stage += f", about {duration_text(seconds)} (an estimate)"
    progress(stage, 0.0)
    spread = DIAGONAL_SPREAD * ((np.arange(n_verts) * GOLDEN_RATIO) % 1)
    matrix = csc_array(laplacian + diags_array(spread))
    if _is_dense(n_verts, n_modes):
        vectors = _eigenvectors(matrix.toarray(order="F"))[:, :n_modes]
    else:
        # The shift lies below all eigenvalues, so that the factored matrix is definite.
        values, vectors = eigsh(matrix, k=n_modes, sigma=-0.01, v0=np.ones(n_verts))
        vectors = vectors[:, np.argsort(values)]
    for start in range(0, n_modes, COLUMNS_AT_ONCE):
        columns = slice(start, start + COLUMNS_AT_ONCE)
        vectors[:, columns] = fix_signs(vectors[:, columns])
    return vectors


def basis_bytes(n_verts: int, n_modes: int) -> int:
    """Memory of the decomposition.

    Two matrices of shape (V, V), or a search space of 2 K + 1 vectors.
    """
    return 8 * n_verts * (2 * n_verts if _is_dense(n_verts, n_modes) else 2 * n_modes + 1)


def estimated_seconds(laplacian: csr_array, n_modes: int) -> float:
    """Estimate the time of a basis on this machine, from a small decomposition that is timed now.

    The time is proportional to V^3 with the dense solver and to V K^2 with the sparse one, and
    equal where one replaces the other.
    """
    n_verts = laplacian.shape[0]
    n_sample = min(n_verts, SAMPLE_VERTS)
    sample = laplacian[:n_sample, :n_sample].toarray(order="F")
    start = time.perf_counter()
    _eigenvectors(sample)
    seconds = time.perf_counter() - start
    largest = min(MAX_SPARSE_RATIO * n_modes, n_verts)
    return seconds * n_verts * largest**2 / n_sample**3


def check_basis_size(n_verts: int, n_modes: int) -> None:
    """Raise InvalidInputError if a decoder would spend more than a few minutes on a basis.

    A stream of a few bytes may announce any number of vertices and frequencies. Allowed are up to
    V / 3 frequencies if V K^2 is at most `MAX_WORK`, and more if V^3 is.
    """
    _check_range(n_verts, n_modes)
    if _work(n_verts, n_modes) <= MAX_WORK:
        return
    max_modes = min(int((MAX_WORK / n_verts) ** 0.5), n_verts // 3)
    raise InvalidInputError(
        f"{_frequencies_text(n_verts, n_modes)} may take many minutes; use at most {max_modes} (",
        Keyword("n_modes"),
        "). If you accept the time, encode with ",
        Keyword("n_modes"),
        ", or decode with meshreel.paper.read and its option all_frequencies",
    )


def _work(n_verts: int, n_modes: int) -> int:
    """Measure of the work that `check_basis_size` limits."""
    return n_verts**3 if n_modes > n_verts // 3 else n_verts * n_modes**2


def _check_range(n_verts: int, n_modes: int) -> None:
    if not 1 <= n_modes <= n_verts:
        raise InvalidInputError(
            Keyword("n_modes"), f" must be in 1..{n_verts}, the vertices; got {n_modes}"
        )


def _frequencies_text(n_verts: int, n_modes: int) -> str:
    return f"{n_modes} graph frequencies of {counted(n_verts, 'vertex')}"


def _is_dense(n_verts: int, n_modes: int) -> bool:
    return n_modes > n_verts // MAX_SPARSE_RATIO


def _eigenvectors(matrix: Floats) -> Floats:
    """Eigenvectors of a symmetric matrix as columns, by ascending eigenvalue.

    LAPACK's dsyevr takes two matrices of memory; dsyevd, as fast, takes three.

    Parameters
    ----------
    matrix : float64 array of shape (V, V), in Fortran order
        It is overwritten.
    """
    return np.asarray(
        scipy.linalg.eigh(matrix, driver="evr", overwrite_a=True, check_finite=False)[1]
    )
