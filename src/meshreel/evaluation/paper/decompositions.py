"""Seconds of one eigen-decomposition of the graph Laplacian: the paper does one for each frame."""

import statistics
import time

from meshreel.evaluation.runs.store import Result, Store
from meshreel.geometry.laplacian import uniform_laplacian
from meshreel.paper.subspace.graph_fourier import graph_fourier_basis
from meshreel.runtime.progress import Progress, silent
from meshreel.sequence import MeshSequence

N_DECOMPOSITIONS = 2
_KEY = "decompositions"


def time_decompositions(
    sequence: MeshSequence, n_modes: int, store: Store, *, progress: Progress = silent
) -> Result:
    """Seconds of a decomposition for so many graph frequencies, measured on two and stored.

    Returns
    -------
    dict with "n_modes", "seconds_each" (the mean) and "seconds", those of each
    """
    what = {"n_modes": n_modes, "n_decompositions": N_DECOMPOSITIONS}
    found = store.find_any(_KEY, what)
    if found is not None:
        return found
    laplacian = uniform_laplacian(sequence.faces, sequence.n_verts)
    seconds = []
    for number in range(N_DECOMPOSITIONS):
        progress("decomposition", number / N_DECOMPOSITIONS)
        start = time.perf_counter()
        graph_fourier_basis(laplacian, n_modes)
        seconds.append(time.perf_counter() - start)
    figures = {"n_modes": n_modes, "seconds": seconds, "seconds_each": statistics.mean(seconds)}
    return store.write(_KEY, what, figures)
