"""Seconds of an eigen-decomposition of the graph Laplacian, which the paper repeats per frame."""

import statistics
import time

from meshreel.evaluation.runs.store import Outcome, Run
from meshreel.model.sequence import MeshSequence
from meshreel.paper.laplacian import uniform_laplacian
from meshreel.paper.subspace.graph_fourier import graph_fourier_basis
from meshreel.runtime.progress import Progress

N_DECOMPOSITIONS = 2


def decompositions_run(sequence: MeshSequence, n_modes: int) -> Run:
    """A run that times two decompositions with this many graph frequencies.

    Its figures are "n_modes", "seconds" (of each), "seconds_each" (their mean) and
    "processor_seconds_each".
    """

    def measure(progress: Progress) -> Outcome:
        laplacian = uniform_laplacian(sequence.faces, sequence.n_verts)
        seconds, processor = [], time.process_time()
        for number in range(N_DECOMPOSITIONS):
            progress("decomposition", number / N_DECOMPOSITIONS)
            start = time.perf_counter()
            graph_fourier_basis(laplacian, n_modes)
            seconds.append(time.perf_counter() - start)
        spent = (time.process_time() - processor) / N_DECOMPOSITIONS
        return Outcome(
            {
                "n_modes": n_modes,
                "seconds": seconds,
                "seconds_each": statistics.mean(seconds),
                "processor_seconds_each": spent,
            }
        )

    setting = {"n_modes": n_modes, "n_decompositions": N_DECOMPOSITIONS}
    return Run("decompositions", "decompositions", setting, measure)
