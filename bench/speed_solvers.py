"""Seconds to factor the system of Eq. 12 and to solve it for 60 columns, solver by solver.

    python bench/speed_solvers.py --sphere 5 1 --sphere 6 1 samba.npz --cores 1

Solvers take turns; the medians of their wall times are printed, as a table.
"""

import argparse
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy.sparse import csc_array, csr_array, diags_array

import meshreel
from meshreel.geometry.laplacian import uniform_laplacian
from meshreel.paper.anchors import choose_anchors
from meshreel.paper.reconstruction.multifrontal import MultifrontalSolver
from meshreel.paper.reconstruction.solver import Solve, _cholespy_solve, _splu_solve
from meshreel.runtime.threads import limit_cores
from speed_inputs import add_inputs, sources
from speed_timing import Patience, Tasks, medians, timed_in_turn

N_COLUMNS = 60

Factor = Callable[[csc_array, csr_array], Solve | None]
SOLVERS: dict[str, Factor] = {
    "multifrontal": lambda matrix, mesh: MultifrontalSolver(matrix, mesh).solve,
    "cholespy": lambda matrix, _: _cholespy_solve(matrix),
    "splu": lambda matrix, _: _splu_solve(matrix),
}


class SolverTrial:
    """Factors once for each run, and solves with the last factor."""

    def __init__(self, factor: Factor, matrix: csc_array, mesh: csr_array) -> None:
        self._factor, self._matrix, self._mesh = factor, matrix, mesh
        self._solve: Solve | None = None
        self._right = np.random.default_rng(0).normal(size=(matrix.shape[0], N_COLUMNS))

    def factor(self) -> None:
        self._solve = None  # two factors need not be there at once
        self._solve = self._factor(self._matrix, self._mesh)

    def solve(self) -> npt.NDArray[np.float64]:
        if self._solve is None:
            raise SystemExit("a solver is not installed; leave it out of --solvers")
        return self._solve(self._right)

    def tasks(self) -> Tasks:
        return {"factor": self.factor, "solve": self.solve}


def system(sequence: meshreel.MeshSequence) -> tuple[csr_array, csc_array]:
    """The Laplacian, and the matrix with the usual number of anchors."""
    faces, n_verts = sequence.faces, sequence.n_verts
    selected = np.zeros(n_verts)
    selected[choose_anchors(faces, n_verts, 0.01)] = 1.0
    laplacian = uniform_laplacian(faces, n_verts, normalized=True)
    return laplacian, csc_array(laplacian.T @ laplacian + diags_array(selected))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    add_inputs(parser)
    parser.add_argument("--solvers", nargs="+", default=["multifrontal", "cholespy"])
    parser.add_argument("--cores", type=int)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    if options.cores:
        limit_cores(options.cores)
    print("| mesh | vertices |", *(f"{name}: factor, solve |" for name in options.solvers))
    for source in sources(options):
        sequence = source()
        mesh, matrix = system(sequence)
        trials = {name: SolverTrial(SOLVERS[name], matrix, mesh) for name in options.solvers}
        tasks = {name: trial.tasks() for name, trial in trials.items()}
        found = medians(timed_in_turn(tasks, Patience(options.rounds, 120)))
        cells = (f"{found[name]['factor']:.3f}, {found[name]['solve']:.3f} |" for name in found)
        print(f"| {sequence.name} | {sequence.n_verts} |", *cells, flush=True)


if __name__ == "__main__":
    main()
