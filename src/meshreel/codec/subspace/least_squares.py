"""Equations of least squares, by their Gram matrix."""

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotrs

from meshreel.arrays import Floats
from meshreel.runtime.threads import one_blas_thread

LEAST_PIVOT = 1e-5
"""Smallest pivot of a Cholesky factor, by the largest, that is believed; a Gram matrix of float32
tells no more."""


def solve_gram(gram: Floats, products: Floats) -> Floats:
    """``gram^-1 products``; the shortest of all solutions where rows depend on each other.

    Parameters
    ----------
    gram : float64 array of shape (K, K)
        ``A A^T`` of the rows that are to add up to something.
    products : float64 array of shape (K, n)
        ``A B^T`` of these and of the n that they are to add up to.

    Returns
    -------
    float64 array of shape (K, n)
    """
    if not gram.size or not products.size:
        return np.zeros(products.shape)
    with one_blas_thread():
        factor, failed = dpotrf(gram, lower=True)
        pivots = np.diagonal(factor)
        if not failed and pivots.min() > LEAST_PIVOT * pivots.max():
            return np.asarray(dpotrs(factor, products, lower=True)[0])
        return np.asarray(np.linalg.lstsq(gram, products, rcond=None)[0])
