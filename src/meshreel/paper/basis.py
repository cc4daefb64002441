"""Temporal bases of blocks: projection, the number of modes, and tracking from block to block."""

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment

from meshreel.arrays import Floats
from meshreel.codec.subspace.pca import RANK_TOLERANCE
from meshreel.errors import InvalidInputError


def project(basis: Floats, frames: Floats) -> Floats:
    """Coefficients of the frames on the basis, ``U^T A`` (paper Eq. 6, paper Eq. 9).

    Parameters
    ----------
    basis : float64 array of shape (..., T, K)
        Orthonormal columns.
    frames : float64 array of shape (..., T, V)

    Returns
    -------
    float64 array of shape (..., K, V)
    """
    return np.swapaxes(basis, -1, -2) @ frames


def expand(basis: Floats, coefficients: Floats) -> Floats:
    """Frames of these coefficients, ``U C``: inverts `project` within the span of the basis.

    Parameters
    ----------
    basis : float64 array of shape (..., T, K)
    coefficients : float64 array of shape (..., K, V)

    Returns
    -------
    float64 array of shape (..., T, V)
    """
    return basis @ coefficients


def modes_for_energy(
    eigenvalues: npt.NDArray[np.float64], total: float, shape_energy: float, share: float
) -> int:
    """Smallest number of leading modes that keep a fraction of the shape's energy.

    The energy of R includes the translation of the whole model, which can be hundreds of times that
    of its shape and must not determine the accuracy of the shape. Relative to the energy about each
    frame's centroid, omitting 1 - share gives a KG error of sqrt(1 - share).

    Parameters
    ----------
    eigenvalues : float64 array of shape (..., K)
        Eigenvalues of R, descending along the last axis; leading axes (x, y, z) are summed.
    total : float
        Energy of all modes: the sum of the traces of R.
    shape_energy : float
        Squared distances of all vertices from their frame's centroid, in the same units.
    share : float
        Fraction of the shape's energy to keep, in 0..1.

    Returns
    -------
    int in 1..K
    """
    cumulative = np.cumsum(eigenvalues.reshape(-1, eigenvalues.shape[-1]).sum(axis=0))
    is_enough = total - cumulative <= (1 - share) * shape_energy
    return int(np.argmax(is_enough)) + 1 if is_enough.any() else int(eigenvalues.shape[-1])


def advance_basis(correlation: Floats, basis: Floats, n_iterations: int) -> Floats:
    """Advance an orthonormal basis towards the leading eigenvectors of R (paper Alg. 1).

    Each iteration is ``U <- QR(R U)``. From the basis of the previous block, which is close, a few
    suffice; from any other they converge to the same subspace, more slowly the closer eigenvalues
    K and K + 1 are.

    Parameters
    ----------
    correlation : float64 array of shape (..., T, T)
        Symmetric, positive semi-definite.
    basis : float64 array of shape (..., T, K)
        Initial basis.
    n_iterations : int
        The paper's t_max - 1.

    Returns
    -------
    float64 array of shape (..., T, K), columns orthonormal, after convergence in the order of the
    eigenvalues

    Raises
    ------
    InvalidInputError
        If T differs between the two arguments.
    """
    if correlation.shape[-1] != basis.shape[-2]:
        raise InvalidInputError(
            f"R has {correlation.shape[-1]} frames and the basis {basis.shape[-2]}; "
            "a basis can only be tracked between blocks of equal length"
        )
    for _ in range(n_iterations):
        basis = np.linalg.qr(correlation @ basis).Q
    return basis


def ritz_vectors(correlation: Floats, basis: Floats) -> Floats:
    """Rotate a basis within its span to the eigenvectors of R, which concentrates the energy.

    # Deviation from Alg. 1: orthogonal iterations converge quickly to a subspace but slowly to its
    # eigenvectors. Until then neighboring columns share the energy of an eigenvector, which costs
    # bits.

    Parameters
    ----------
    correlation : float64 array of shape (..., T, T)
        Symmetric, positive semi-definite.
    basis : float64 array of shape (..., T, K)
        Orthonormal columns.

    Returns
    -------
    float64 array of shape (..., T, K), columns orthonormal, by descending ``u^T R u``
    """
    projected = np.swapaxes(basis, -1, -2) @ correlation @ basis
    largest = np.abs(projected).max(axis=(-1, -2), keepdims=True)
    # Columns beyond the rank stay unchanged: rounding must not rotate them in every block.
    projected[np.abs(projected) <= RANK_TOLERANCE * largest] = 0.0
    return np.asarray(basis @ np.linalg.eigh(projected).eigenvectors[..., ::-1])


def align_basis(basis: Floats, reference: Floats) -> Floats:
    """Reorder the columns and change their signs to be closest to a reference.

    Eigenvectors are unique up to sign, and two with nearly equal eigenvalues may swap between
    blocks; differences of dictionaries are small only after this alignment.

    Parameters
    ----------
    basis, reference : float64 arrays of shape (A, T, K)
        Orthonormal columns.
    """
    return np.stack([_align(*pair) for pair in zip(basis, reference, strict=True)])


def _align(basis: Floats, reference: Floats) -> Floats:
    products = reference.T @ basis
    targets, columns = linear_sum_assignment(-np.abs(products))
    signs = np.where(products[targets, columns] < 0, -1.0, 1.0)
    return np.asarray(basis[:, columns] * signs)
