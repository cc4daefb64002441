"""Projection of frames on a temporal basis, and its inverse."""

import numpy as np

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
