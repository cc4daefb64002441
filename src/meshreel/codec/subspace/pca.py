"""Eigen-trajectories: eigenvectors of the trajectory autocorrelation."""

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.runtime.threads import chunks, in_threads

RANK_TOLERANCE = 1e-13
"""Eigenvalues of a Gram matrix below this share of the largest are rounding errors."""

ACCURATE = 3e-6
"""Singular values above this share of the largest are accurate in a Gram matrix."""

ROUNDING = 1e-14
"""Singular values below this share of the largest are rounding errors of the matrix itself."""

GRAM_COLUMNS = 2048
"""Columns whose contribution to a Gram matrix is computed at a time."""

SMALL_GRAM = 200
"""Gram matrices up to this size are decomposed completely; larger ones only partly, if few
eigenvalues matter."""

FIRST_COUNT, OVERSAMPLING, MAX_SHARE, N_ITERATIONS = 64, 16, 0.3, 2
"""Of subspace iteration: eigenvectors of the first trial, extra vectors for convergence, largest
share of all eigenvectors, and number of iterations."""


def autocorrelation(frames: Floats) -> Floats:
    """Trajectory autocorrelation ``R = A A^T`` (paper Eq. 7).

    Parameters
    ----------
    frames : float64 array of shape (..., T, V)
        A row for each frame: one coordinate of every vertex.

    Returns
    -------
    float64 array of shape (..., T, T), in squared units of the frames.
    """
    return frames @ np.swapaxes(frames, -1, -2)


def eigen_trajectories(correlation: Floats, n_modes: int) -> tuple[Floats, Floats]:
    """Leading eigenvalues and orthonormal eigenvectors, ``R = U Lambda U^T`` (paper Eq. 5).

    # Deviation from Eq. 5: the paper writes a singular value decomposition; R is symmetric and
    # positive semi-definite, so its eigen-decomposition is the same and cheaper.

    Parameters
    ----------
    correlation : float64 array of shape (..., T, T)
        Symmetric; from `autocorrelation`.
    n_modes : int
        Number of modes, K, in 1..T.

    Returns
    -------
    eigenvalues : float64 array of shape (..., K), descending, not negative
    basis : float64 array of shape (..., T, K)
        A column for each; signs by `fix_signs`.
    """
    values, vectors = np.linalg.eigh(correlation)
    values = np.maximum(values[..., ::-1][..., :n_modes], 0.0)
    return values, fix_signs(vectors[..., ::-1][..., :n_modes])


def truncated_pca(
    columns: Callable[[slice], npt.NDArray[np.floating]], gram: Floats, n_columns: int, least: float
) -> tuple[Floats, Floats]:
    """Return singular values of a wide matrix above `least`, at least one, and left vectors.

    A Gram matrix has squares of singular values, of which the smallest vanish in the rounding of
    the largest. They are recomputed from the Gram matrix of the residual of the stronger modes.

    The caller limits BLAS to one thread (`one_blas_thread`), so that the result does not depend on
    the number of cores.

    Parameters
    ----------
    columns, n_columns
        As in `gram_of_rows`.
    gram : float64 array of shape (n_rows, n_rows)
        From `gram_of_rows`.

    Returns
    -------
    singular_values : float64 array of shape (K,), descending, positive
    vectors : float64 array of shape (n_rows, K), columns orthonormal
    """
    n_rows = len(gram)
    values, vectors = _leading_modes(gram, n_rows, least)
    largest = float(values[0])
    if least >= math.sqrt(RANK_TOLERANCE) * largest or largest == 0.0:
        return values, vectors
    values, vectors = _above(values, vectors, ACCURATE * largest)
    least = max(least, ROUNDING * largest)
    while len(values) < n_rows:
        strong = vectors

        def residual(piece: slice, strong: Floats = strong) -> Floats:
            part = columns(piece).astype(np.float64)
            for _ in range(2):  # a second pass restores orthogonality of small residuals
                part -= strong @ (strong.T @ part)
            return part

        residual_gram = gram_of_rows(residual, n_rows, n_columns)
        weak_values, weak = _leading_modes(residual_gram, n_rows - len(values), least)
        threshold = max(least, ACCURATE * float(weak_values[0]))
        weak_values, weak = _above(weak_values, weak, threshold)
        weak -= strong @ (strong.T @ weak)
        values = np.concatenate([values, weak_values])
        vectors = np.concatenate([strong, fix_signs(np.linalg.qr(weak)[0])], axis=1)
        if threshold == least:
            break
    order = np.argsort(-values, kind="stable")
    return values[order], vectors[:, order]


def _above(values: Floats, vectors: Floats, least: float) -> tuple[Floats, Floats]:
    count = int(np.sum(values > least))
    return values[:count], vectors[:, :count]


def gram_of_rows(
    columns: Callable[[slice], npt.NDArray[np.floating]], n_rows: int, n_columns: int
) -> Floats:
    """Return ``A A^T`` of a wide matrix, summed in the same order on any number of cores.

    Parameters
    ----------
    columns : callable
        Returns some columns of A; called in any thread.
    n_rows, n_columns : int
        Shape of A.
    """
    pieces = chunks(n_columns, GRAM_COLUMNS)
    total = np.zeros((n_rows, n_rows))
    parts: dict[int, Floats] = {}

    def multiply(piece: slice) -> None:
        part = columns(piece).astype(np.float64, copy=False)
        parts[piece.start] = part @ part.T

    def add(n_done: int) -> None:
        np.add(total, parts.pop(pieces[n_done - 1].start), out=total)

    in_threads(multiply, pieces, add)
    return total


def _leading_modes(gram: Floats, n_modes: int, least: float) -> tuple[Floats, Floats]:
    """Singular values above `least`, descending, and left vectors, from the Gram matrix of rows."""
    pairs = _few_leading(gram, least**2) if len(gram) > SMALL_GRAM else None
    eigenvalues, vectors = pairs or np.linalg.eigh(gram)
    eigenvalues, vectors = eigenvalues[::-1], vectors[:, ::-1]
    floor = max(least**2, RANK_TOLERANCE * max(eigenvalues[0], 0.0))
    n_kept = max(1, min(n_modes, int(np.sum(eigenvalues > floor))))
    return np.sqrt(np.maximum(eigenvalues[:n_kept], 0.0)), fix_signs(vectors[:, :n_kept])


def _few_leading(gram: Floats, least: float) -> tuple[Floats, Floats] | None:
    """Eigenvalues above `least`, and some more, ascending, with their eigenvectors.

    Subspace iteration from a fixed start; None if too many are above. Of nearly equal eigenvalues
    it determines the common eigenspace only.
    """
    count = FIRST_COUNT
    while count <= MAX_SHARE * len(gram):
        start = np.random.default_rng(count).standard_normal((len(gram), count + OVERSAMPLING))
        vectors = np.linalg.qr(gram @ start)[0]
        product = gram @ vectors
        lower_bounds = np.linalg.eigvalsh(vectors.T @ product)  # Ritz values
        if lower_bounds[OVERSAMPLING] < least:
            for _ in range(N_ITERATIONS):
                vectors = np.linalg.qr(gram @ product)[0]
                product = gram @ vectors
            eigenvalues, rotation = np.linalg.eigh(vectors.T @ product)
            if eigenvalues[OVERSAMPLING] < least:
                return eigenvalues, vectors @ rotation
        count *= 2
    return None


def fix_signs(basis: Floats) -> Floats:
    """Flip the sign of each column so that its first large entry is positive.

    Large means at least half of the column's largest magnitude: rounding cannot decide between two
    entries of nearly equal size, so streams do not depend on the LAPACK build.

    Parameters
    ----------
    basis : float64 array of shape (..., T, K)
    """
    magnitude = np.abs(basis)
    large = magnitude >= 0.5 * magnitude.max(axis=-2, keepdims=True)
    first = np.argmax(large, axis=-2, keepdims=True)
    leading = np.take_along_axis(basis, first, axis=-2)
    return np.where(leading < 0, -basis, basis)
