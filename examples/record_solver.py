"""Record a solver while it runs: an elastic bar is twisted, with large deformations.

    pip install meshreel scikit-fem
    python examples/record_solver.py --out twist.reel
    meshreel render twist.reel -o twist.png --track stress --cut z=50%

scikit-fem assembles the equations. Each converged step is pushed with its time, its deformed nodes
and the von Mises stress of its cells, all within 0.1 % of their ranges.
"""

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse.linalg import spsolve
from skfem import Basis, BilinearForm, ElementTetP1, ElementVector, LinearForm, MeshTet, condense
from skfem.helpers import ddot, det, grad, identity, inv, mul, trace, transpose

import meshreel

LAME_PA, SHEAR_PA = 1.2e6, 0.8e6  # of rubber, as a compressible neo-Hookean material
LENGTH_M, WIDTH_M = 4.0, 1.0
N_STEPS, STEP_DEG = 30, 5
MAX_ITERATIONS, TOLERANCE_M = 20, 1e-8
TETRAHEDRON = 10  # cell type of VTK

Floats = npt.NDArray[np.float64]


def gradients(u: Any) -> tuple[Floats, Floats, Floats]:
    """Return the deformation gradient, its transposed inverse, and its determinant."""
    gradient = grad(u) + identity(grad(u))
    return gradient, transpose(inv(gradient)), det(gradient)


def stress(u: Any) -> Floats:
    """Return the first Piola-Kirchhoff stress."""
    gradient, inverse, volume = gradients(u)
    return np.asarray(SHEAR_PA * (gradient - inverse) + LAME_PA * np.log(volume) * inverse)


def work(v: Any, w: Any) -> Any:
    """Return the work of the internal forces on a virtual displacement."""
    return ddot(stress(w["last"]), grad(v))


def work_change(u: Any, v: Any, w: Any) -> Any:
    """Return the derivative of `work`."""
    _, inverse, volume = gradients(w["last"])
    change = grad(u)
    turned = mul(inverse, mul(transpose(change), inverse))
    increment = SHEAR_PA * change + (SHEAR_PA - LAME_PA * np.log(volume)) * turned
    return ddot(increment + LAME_PA * ddot(inverse, change) * inverse, grad(v))


FORCES, STIFFNESS = LinearForm(work), BilinearForm(work_change)


def equilibrium(basis: Basis, u: Floats, fixed: npt.NDArray[np.integer]) -> Floats:
    """Return the displacement in equilibrium, by Newton's method; `fixed` values stay."""
    for _ in range(MAX_ITERATIONS):
        last = basis.interpolate(u)
        residual = FORCES.assemble(basis, last=last)
        reduced, load, change, free = condense(
            STIFFNESS.assemble(basis, last=last), -residual, x=np.zeros_like(u), D=fixed
        )
        change[free] = spsolve(reduced.tocsc(), load)
        u = u + change
        if np.abs(change).max() < TOLERANCE_M:
            return u
    raise RuntimeError(f"no equilibrium after {MAX_ITERATIONS} iterations")


def von_mises_stress(basis: Basis, u: Floats) -> Floats:
    """Return the von Mises stress of each cell, in Pa."""
    field = basis.interpolate(u)
    gradient, _, volume = gradients(field)
    cauchy = mul(stress(field), transpose(gradient)) / volume
    deviator = cauchy - trace(cauchy) / 3 * identity(cauchy)
    return np.asarray(np.sqrt(1.5 * ddot(deviator, deviator)).mean(axis=1))


def tetrahedra(mesh: MeshTet) -> meshreel.Cells:
    """Return the cells of a mesh, each with a positive volume."""
    corners = mesh.t.T.astype(np.int32)
    sides = mesh.p.T[corners[:, 1:]] - mesh.p.T[corners[:, :1]]
    is_inverted = np.linalg.det(sides) < 0
    corners[is_inverted, 2:] = corners[is_inverted, :1:-1]
    return meshreel.Cells(np.full(len(corners), TETRAHEDRON, np.uint8), corners.ravel())


def twist(output: Path, n_across: int) -> None:
    """Twist a bar, and print the processor time of the solver and of the recording."""
    across = np.linspace(-WIDTH_M / 2, WIDTH_M / 2, n_across + 1)
    mesh = MeshTet.init_tensor(np.linspace(0, LENGTH_M, 4 * n_across + 1), across, across)
    basis = Basis(mesh, ElementVector(ElementTetP1()), intorder=1)
    nodes = mesh.p.T.copy()
    held, turned = (np.flatnonzero(nodes[:, 0] == end) for end in (0, LENGTH_M))
    fixed = basis.nodal_dofs[:, [*held, *turned]].ravel()
    u, started, recording = basis.zeros(), time.process_time(), 0.0
    with meshreel.Encoder(tetrahedra(mesh), output, bound="0.1%") as encoder:
        for step in range(N_STEPS + 1):
            angle = np.radians(STEP_DEG * step)
            turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            u[basis.nodal_dofs[1:, turned]] = (turn - np.eye(2)) @ nodes[turned, 1:].T
            u = equilibrium(basis, u, fixed)
            tracks = {"stress": meshreel.Track([von_mises_stress(basis, u)], "cell", unit="Pa")}
            began = time.process_time()
            encoder.push(nodes + u[basis.nodal_dofs].T, tracks, time=float(step))
            recording += time.process_time() - began
        began = time.process_time()
        encoder.close()
        recording += time.process_time() - began
    solver = time.process_time() - started - recording
    raw = (N_STEPS + 1) * (nodes.nbytes + 8 * mesh.nelements)
    print(f"{len(nodes)} nodes, {mesh.nelements} tetrahedra, {N_STEPS + 1} steps")
    print(f"solver {solver:.1f} s, recording {recording:.1f} s: {100 * recording / solver:.1f} %")
    print(f"{output} has {encoder.size_bytes} bytes, {raw / encoder.size_bytes:.0f} times fewer")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--out", type=Path, default=Path("twist.reel"), help="the file to write")
    parser.add_argument("--across", type=int, default=4, help="cells across the bar (default 4)")
    options = parser.parse_args()
    twist(options.out, options.across)
