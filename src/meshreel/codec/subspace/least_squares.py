"""Least squares by normal equations."""

import numpy as np

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
        if _is_regular(gram):
            return np.asarray(np.linalg.solve(gram, products))
        return np.asarray(np.linalg.lstsq(gram, products, rcond=None)[0])


def _is_regular(gram: Floats) -> bool:
    """Whether the smallest pivot of the Cholesky factor is reliable."""
    try:
        pivots = np.diagonal(np.linalg.cholesky(gram))
    except np.linalg.LinAlgError:
        return False
    return bool(pivots.min() > MIN_PIVOT * pivots.max())
