"""The sequences that speeds are measured on: files, the embedded flag, and a waving sphere.

Each is a function that makes the sequence, so that a run holds one at a time and a child process
can make its own.
"""

import argparse
from collections.abc import Callable
from functools import partial

import numpy as np
import numpy.typing as npt

import meshreel

Source = Callable[[], meshreel.MeshSequence]
Floats = npt.NDArray[np.float64]

# Each travels along its vector, which is its angular wavenumber in a unit sphere.
WAVE_VECTORS = np.array([[3.0, 1.0, 0.0], [0.0, 4.0, 2.0], [-2.0, 0.0, 6.0], [5.0, -5.0, 3.0]])
WAVE_HEIGHTS = np.array([0.08, 0.05, 0.03, 0.015])
WAVES_PER_S = np.array([0.5, 0.8, 1.1, 1.7])
FPS = 30.0


def add_inputs(parser: argparse.ArgumentParser) -> None:
    """Give a command line the arguments that `sources` reads."""
    parser.add_argument("inputs", nargs="*", help="files or frames; default: the embedded flag")
    parser.add_argument("--flag", type=int, action="append", default=[], metavar="FRAMES")
    parser.add_argument("--sphere", type=int, nargs=2, action="append", default=[],
                        metavar=("SUBDIVISIONS", "FRAMES"))  # fmt: skip


def sources(options: argparse.Namespace) -> list[Source]:
    """What was asked for: files first, then flags, then spheres."""
    found: list[Source] = [partial(meshreel.load, path) for path in options.inputs]
    found += [partial(meshreel.simulate_flag, n_frames) for n_frames in options.flag]
    found += [partial(waving_sphere, *counts) for counts in options.sphere]
    return found or [meshreel.simulate_flag]


def waving_sphere(n_subdivisions: int, n_frames: int) -> meshreel.MeshSequence:
    """A unit icosphere of 10 4^n + 2 vertices, whose radius a few sine waves travel through."""
    directions, faces = icosphere(n_subdivisions)
    phases = directions @ WAVE_VECTORS.T
    vertices = np.empty((n_frames, len(directions), 3), np.float32)
    for i, frame in enumerate(vertices):
        radius = 1 + np.sin(phases - 2 * np.pi * WAVES_PER_S * i / FPS) @ WAVE_HEIGHTS
        frame[:] = radius[:, None] * directions
    return meshreel.MeshSequence(vertices, faces, FPS, f"sphere{n_subdivisions}")


def icosphere(n_subdivisions: int) -> tuple[Floats, npt.NDArray[np.int32]]:
    """Unit vectors of shape (V, 3) and outward faces, an icosahedron cut in four n times."""
    golden = (1 + 5**0.5) / 2
    corners = [(-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0)]
    vertices = unit(np.concatenate([np.roll(corners, turn, axis=1) for turn in range(3)]))
    ring = [11, 5, 1, 7, 10, 11]
    other = [4, 9, 8, 6, 2, 4]
    triangles = []
    for i in range(5):
        a, b, c, d = ring[i], ring[i + 1], other[i], other[i + 1]
        triangles += [(0, a, b), (b, a, c), (b, c, d), (3, d, c)]
    faces = np.array(triangles)
    for _ in range(n_subdivisions):
        vertices, faces = subdivided(vertices, faces)
    return vertices, faces.astype(np.int32)


def subdivided(
    vertices: Floats, faces: npt.NDArray[np.int64]
) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Every face cut in four at the middles of its edges, which are moved onto the sphere."""
    ends = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]], axis=-1)
    edges, edge_of_side = np.unique(ends @ [len(vertices), 1], return_inverse=True)
    first, second = np.divmod(edges, len(vertices))
    middles = len(vertices) + edge_of_side.reshape(-1, 3)
    (a, b, c), (ab, bc, ca) = faces.T, middles.T
    quarters = np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3)
    return np.concatenate([vertices, unit(vertices[first] + vertices[second])]), quarters


def unit(vectors: Floats) -> Floats:
    """The vectors at length 1."""
    scaled: Floats = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return scaled
