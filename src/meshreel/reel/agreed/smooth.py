"""Smooth fields: what varies slowly on the graph of a resolution, made from connectivity alone.

They tell how whatever is smooth on this mesh varies from a stencil to its vertex.
"""

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.special import ive

from meshreel.kernel.predict import N_SMOOTH_FIELDS
from meshreel.reel.agreed.hierarchy import Resolution, scattered

DIFFUSION_TIME = 12.0
"""Time for which noise diffuses over the graph of a resolution to become a smooth field."""

CHEBYSHEV_DEGREE = 18
"""Terms after which those that follow are below a thousandth at this time."""


def smooth_fields(resolution: Resolution) -> npt.NDArray[np.float32]:
    """Fields of shape (N, N_SMOOTH_FIELDS): exp(-t (I - W)) of signs, W the neighbours' mean."""
    graph = resolution.adjacency
    n_verts = graph.shape[0]
    degrees = np.diff(graph.indptr)
    shares = np.repeat(1.0 / np.maximum(degrees, 1), degrees)
    mean = csr_array((shares, graph.indices, graph.indptr), shape=graph.shape)
    signs = scattered(np.arange(n_verts * N_SMOOTH_FIELDS)) >> np.uint64(63)
    before = 2.0 * signs.reshape(n_verts, N_SMOOTH_FIELDS).astype(np.float64) - 1.0
    # exp(-t (1 - w)) = sum_k c_k T_k(w), with c_k = (2 - [k = 0]) exp(-t) I_k(t).
    current = np.asarray(mean @ before)
    total = ive(0, DIFFUSION_TIME) * before
    twice = 2.0 * mean
    for degree in range(1, CHEBYSHEV_DEGREE + 1):
        total += 2.0 * ive(degree, DIFFUSION_TIME) * current
        following = twice @ current
        following -= before
        before, current = current, following
    return np.asarray(total, np.float32)
