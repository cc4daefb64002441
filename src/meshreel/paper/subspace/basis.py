"""Projection of frames on a temporal basis, its inverse, and the number of modes to keep."""

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats


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
