"""Simulate a cloth that falls over a sphere and folds: a sequence that is mostly shape.

    python bench/falling_cloth.py --out cloth.npz
    python bench/falling_cloth.py --frames 30 --side 60

It has few frames, and folds that never recur, so it needs many modes: a hard case for a codec that
exploits repeated motion. Prints sizes and errors of the default and of the paper's method.

Position-based dynamics in small substeps (Macklin et al. 2019, "Small Steps in Physics
Simulation"). The cloth does not collide with itself.
"""

import argparse
from pathlib import Path

import numpy as np
import numpy.typing as npt

import meshreel

Floats = npt.NDArray[np.float64]
Links = tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], float, float]

SIDE_M, FPS, SUBSTEPS = 1.6, 30.0, 16
SPHERE_M, RADIUS_M, FLOOR_M = np.array([0.12, 0.0, -0.07]), 0.3, -0.42
GRAVITY_M_PER_S2, DRAG_PER_S = 9.81, 0.6
STRETCH, SHEAR, BENDING = 1.0, 0.25, 0.25
"""Fraction of the change of a link's length that a substep corrects."""
FRICTION = 0.35
"""Fraction of a vertex's motion along the sphere or the floor that is removed."""


def links_of(side: int) -> list[Links]:
    """Return ends, rest length and stiffness of sets of links without common vertices."""
    number = np.arange(side * side).reshape(side, side)
    row, column = np.divmod(number, side)
    spacing_m = SIDE_M / (side - 1)
    links = []
    for down, across, stiffness in (
        (0, 1, STRETCH), (1, 0, STRETCH), (1, 1, SHEAR), (1, -1, SHEAR),
        (0, 2, BENDING), (2, 0, BENDING),
    ):  # fmt: skip
        reach = down or across
        is_odd = ((row if down else column) // reach) % 2 == 1
        is_inside = (row + down < side) & (column + across < side) & (column + across >= 0)
        for half in (~is_odd, is_odd):
            first = number[half & is_inside]
            last = first + down * side + across
            links.append((first, last, spacing_m * float(np.hypot(down, across)), stiffness))
    return links


def collide(positions: Floats, before: Floats) -> None:
    """Apply friction to vertices that touch the sphere or the floor, and move them outside."""
    touching = (distances_m(positions) < RADIUS_M) | (positions[:, 1] < FLOOR_M)
    positions[touching] -= FRICTION * (positions - before)[touching]
    distance_m = distances_m(positions)
    inside = distance_m < RADIUS_M
    positions[inside] -= SPHERE_M
    positions[inside] *= (RADIUS_M / distance_m[inside])[:, None]
    positions[inside] += SPHERE_M
    np.maximum(positions[:, 1], FLOOR_M, out=positions[:, 1])


def distances_m(positions: Floats) -> Floats:
    """Return the distances from the center of the sphere."""
    offset = positions - SPHERE_M
    return np.asarray(np.sqrt(np.einsum("va,va->v", offset, offset)))


def simulate_cloth(n_frames: int = 60, side: int = 90) -> meshreel.MeshSequence:
    """Return the cloth in meters, y up, with `side` x `side` vertices. Deterministic."""
    across, down = np.meshgrid(*2 * [np.linspace(-0.5, 0.5, side) * SIDE_M])
    # Slightly curved, to break the symmetry of the fall.
    height = 0.33 + 0.01 * np.sin(9 * across + 4 * down) + 0.006 * np.cos(23 * down - 14 * across)
    positions = np.stack([across, height, down], axis=2).reshape(-1, 3)
    velocities = np.zeros_like(positions)
    links = links_of(side)
    substep_s = 1 / (FPS * SUBSTEPS)
    frames = np.empty((n_frames, *positions.shape), np.float32)
    for frame in frames:
        frame[:] = positions
        for _ in range(SUBSTEPS):
            before = positions.copy()
            velocities[:, 1] -= GRAVITY_M_PER_S2 * substep_s
            velocities *= 1 - DRAG_PER_S * substep_s
            positions += substep_s * velocities
            for first, last, rest_m, stiffness in links:
                span = positions[last] - positions[first]
                length_m = np.sqrt(np.einsum("la,la->l", span, span)) + 1e-9
                span *= (0.5 * stiffness * (1 - rest_m / length_m))[:, None]
                positions[first] += span
                positions[last] -= span
            collide(positions, before)
            velocities = (positions - before) / substep_s
    corner = np.arange(side * side).reshape(side, side)
    a, b, c, d = (
        x.ravel() for x in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:])
    )
    faces = np.concatenate([np.stack([a, c, b], 1), np.stack([b, c, d], 1)])
    return meshreel.MeshSequence(frames, faces, fps=FPS, name="cloth")


def main() -> None:
    """Simulate the cloth, optionally save it, and print sizes and errors."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--side", type=int, default=90, help="vertices along each side")
    parser.add_argument("--out", type=Path, help="a file of any format that meshreel writes")
    arguments = parser.parse_args()
    cloth = simulate_cloth(arguments.frames, arguments.side)
    print(cloth)
    if arguments.out:
        meshreel.save(cloth, arguments.out)
    for method in ("reel", "pca-qp"):
        data = meshreel.encode(cloth, method=method)
        errors = meshreel.compare(cloth, data)
        print(f"{method:>7} {len(data) / 1000:8.1f} kB  {errors}")


if __name__ == "__main__":
    main()
