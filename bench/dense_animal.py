"""Simulate a trotting animal with fine wrinkles: a sequence that is mostly shape.

    python bench/dense_animal.py --out animal.npz
    python bench/dense_animal.py --frames 24 --subdivisions 5

Some 40,000 vertices follow a few joints, with static detail: most of a file is the shape of one
frame. Prints sizes and errors of the default and of the paper's method.
"""

import argparse
from pathlib import Path

import numpy as np
import numpy.typing as npt

import meshreel

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

FPS, CYCLE_S = 24.0, 1.0
LENGTHS = np.array([1.0, 0.42, 0.3])
"""Semi-axes of the body: length, height, width."""
LIMBS = (
    # direction of the root on the unit sphere, end point, width, phase of the step
    ((0.62, -0.65, 0.44), (0.55, -1.05, 0.24), 0.20, 0.00),
    ((0.62, -0.65, -0.44), (0.55, -1.05, -0.24), 0.20, 0.50),
    ((-0.62, -0.65, 0.44), (-0.6, -1.05, 0.24), 0.22, 0.50),
    ((-0.62, -0.65, -0.44), (-0.6, -1.05, -0.24), 0.22, 0.00),
    ((0.93, 0.36, 0.0), (1.5, 0.75, 0.0), 0.34, 0.25),
)
"""Four legs, and the neck with the head."""
WRINKLES = ((14.0, 0.0100), (29.0, 0.0045), (61.0, 0.0020), (119.0, 0.0008))
"""Waves per unit of length, and their amplitude."""


def sphere(subdivisions: int) -> tuple[Floats, Integers]:
    """Return points and faces of a repeatedly subdivided icosahedron."""
    golden = (1 + 5**0.5) / 2
    corners = [(-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0)]
    points = np.array([np.roll(corner, turn) for turn in range(3) for corner in corners])
    distances = np.linalg.norm(points[:, None] - points, axis=2)
    near = np.abs(distances - 2) < 1e-6
    faces = np.array(
        [
            (a, b, c) if np.dot(points[a], np.cross(points[b], points[c])) > 0 else (a, c, b)
            for a in range(12) for b in range(a + 1, 12) for c in range(b + 1, 12)
            if near[a, b] and near[b, c] and near[a, c]
        ]
    )  # fmt: skip
    for _ in range(subdivisions):
        edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        ends, edge = np.unique(edges, axis=0, return_inverse=True)
        ab, bc, ca = (len(points) + edge.reshape(-1, 3)).T
        points = np.concatenate([points, points[ends].sum(axis=1)])
        a, b, c = faces.T
        faces = np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3)
        points = points / np.linalg.norm(points, axis=1)[:, None]
    return points / np.linalg.norm(points, axis=1)[:, None], faces


def normals_of(points: Floats, faces: Integers) -> Floats:
    """Return unit normals of the vertices."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    sums = np.stack([np.bincount(faces.ravel(), np.repeat(x, 3)) for x in normals.T], axis=1)
    return np.asarray(sums / np.linalg.norm(sums, axis=1)[:, None])


def wrinkled(points: Floats, faces: Integers) -> Floats:
    """Displace points along their normals by waves of several lengths and directions."""
    height = np.zeros(len(points))
    for size, (per_unit, strength) in enumerate(WRINKLES):
        for number in range(6):
            # Multiples of irrational roots spread evenly.
            turn = (1 + number + 6 * size) * np.sqrt([2.0, 3.0, 5.0]) % 1
            direction = np.sin(2 * np.pi * turn) + 0.1
            direction *= 2 * np.pi * per_unit * (0.7 + 0.1 * number) / np.linalg.norm(direction)
            along = np.einsum("va,a->v", points, direction) / (2 * np.pi)
            height += strength / np.sqrt(6) * np.sin(along + 9 * turn[0])
    return points + height[:, None] * normals_of(points, faces)


def animal(n_frames: int = 48, subdivisions: int = 6) -> meshreel.MeshSequence:
    """Return the animal, with 10 x 4^subdivisions + 2 vertices; y is up. Deterministic."""
    directions, faces = sphere(subdivisions)
    shape = LENGTHS * directions
    shares = []
    for direction, end, width, _ in LIMBS:
        axis = np.array(direction) / np.linalg.norm(direction)
        distance = np.linalg.norm(directions - axis, axis=1) / width
        share = np.exp(-(distance**2)) ** 0.75
        root = LENGTHS * axis
        shape = shape + share[:, None] * (np.array(end) - root) * 0.95
        shares.append(share)
    shape = wrinkled(shape, faces)
    frames = np.empty((n_frames, *shape.shape), np.float32)
    for number in range(n_frames):
        phase = number / FPS / CYCLE_S
        posed = shape.copy()
        for (_, end, _, start), share in zip(LIMBS, shares, strict=True):
            angle = 2 * np.pi * (phase + start)
            root = np.array([end[0], -0.25 if end[1] < 0 else 0.2, end[2]])
            swing = share * (0.55 * np.sin(angle) if end[1] < 0 else 0.12 * np.sin(2 * angle))
            offset = posed - root
            cosine, sine = np.cos(swing), np.sin(swing)
            x, y = offset[:, 0], offset[:, 1]
            posed[:, :2] = root[:2] + np.stack([cosine * x - sine * y, sine * x + cosine * y], 1)
            posed[:, 1] += 0.08 * share * np.maximum(0, np.cos(angle)) * (end[1] < 0)
        posed[:, 2] += 0.05 * np.sin(2 * np.pi * phase + 2.5 * shape[:, 0])
        posed[:, 1] += 0.03 * np.sin(4 * np.pi * phase) + 0.02 * np.sin(
            2 * np.pi * phase + 3 * shape[:, 0]
        )
        frames[number] = posed
    return meshreel.MeshSequence(frames, faces.astype(np.int32), fps=FPS, name="animal")


def main() -> None:
    """Simulate the animal, optionally save it, and print sizes and errors."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=48)
    parser.add_argument("--subdivisions", type=int, default=6)
    parser.add_argument("--out", type=Path, help="a file of any format that meshreel writes")
    arguments = parser.parse_args()
    sequence = animal(arguments.frames, arguments.subdivisions)
    print(sequence)
    if arguments.out:
        meshreel.save(sequence, arguments.out)
    for method in ("reel", "pca-qp"):
        data = meshreel.encode(sequence, method=method)
        errors = meshreel.compare(sequence, data)
        print(f"{method:>7} {len(data) / 1000:8.1f} kB  {errors}")


if __name__ == "__main__":
    main()
