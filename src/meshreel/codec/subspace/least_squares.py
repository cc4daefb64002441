"""Least squares by normal equations."""

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotrs

from meshreel.arrays import Floats
from meshreel.runtime.threads import one_blas_thread

MIN_PIVOT = 1e-5
"""Smallest reliable pivot of a Cholesky factor, relative to the largest; a Gram matrix of float32
has no more precision."""


def solve_gram(gram: Floats, products: Floats) -> Floats:
    """Solve ``gram X = products``; the minimum-norm solution if the rows are linearly dependent.

    Parameters
    ----------
    gram : float64 array of shape (K, K)
        ``A A^T`` of the rows to combine.
    products : float64 array of shape (K, n)
        ``A B^T`` with the n rows of B to approximate.

    Returns
    -------
    float64 array of shape (K, n)
    """
    if not gram.size or not products.size:
        return np.zeros(products.shape)
    with one_blas_thread():
        factor, failed = dpotrf(gram, lower=True)
        pivots = np.diagonal(factor)
        if not failed and pivots.min() > MIN_PIVOT * pivots.max():
            return np.asarray(dpotrs(factor, products, lower=True)[0])
        return np.asarray(np.linalg.lstsq(gram, products, rcond=None)[0])
