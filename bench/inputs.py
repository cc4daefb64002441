"""Sequences for speed measurements: files, the embedded flag, and a waving sphere.

Each source is a function that returns the sequence, so that only one is in memory at a time.
"""

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt

import meshreel

Source = Callable[[], meshreel.MeshSequence]
Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

# Angular wave vectors in a unit sphere.
WAVE_VECTORS = np.array([[3.0, 1.0, 0.0], [0.0, 4.0, 2.0], [-2.0, 0.0, 6.0], [5.0, -5.0, 3.0]])
WAVE_HEIGHTS = np.array([0.08, 0.05, 0.03, 0.015])
WAVES_PER_S = np.array([0.5, 0.8, 1.1, 1.7])
FPS = 30.0


def add_inputs(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that `sources` reads to a command line."""
    parser.add_argument("inputs", nargs="*", help="files or frames; default: the embedded flag")
    parser.add_argument("--subdivided", action="append", default=[], metavar="FILE",
                        help="a file, with every face split in four")  # fmt: skip
    parser.add_argument("--flag", type=int, action="append", default=[], metavar="FRAMES")
    parser.add_argument("--sphere", type=int, nargs=2, action="append", default=[],
                        metavar=("SUBDIVISIONS", "FRAMES"))  # fmt: skip


def sources(options: argparse.Namespace) -> list[Source]:
    """Sources of the requested sequences: files, then flags, then spheres."""
    requested: list[Source] = [partial(meshreel.load, path) for path in options.inputs]
    requested += [partial(subdivided_once, path) for path in options.subdivided]
    requested += [partial(meshreel.simulate_flag, n_frames) for n_frames in options.flag]
    requested += [partial(waving_sphere, *counts) for counts in options.sphere]
    return requested or [meshreel.simulate_flag]


def first_frames(sequence: meshreel.MeshSequence, n_frames: int) -> meshreel.MeshSequence:
    """The first frames of a sequence, at most this many."""
    vertices = sequence.vertices[:n_frames]
    return meshreel.MeshSequence(vertices, sequence.faces, sequence.fps, sequence.name)


def subdivided_once(path: str | Path) -> meshreel.MeshSequence:
    """A sequence whose faces are split in four at the midpoints of their edges."""
    coarse = meshreel.load(path)
    ends, faces = quartered(coarse.faces.astype(np.int64), coarse.n_verts)
    middles = coarse.vertices[:, ends].mean(axis=2)
    vertices = np.concatenate([coarse.vertices, middles], axis=1)
    name = f"{coarse.name}, subdivided"
    return meshreel.MeshSequence(vertices, faces.astype(np.int32), coarse.fps, name)


def waving_sphere(n_subdivisions: int, n_frames: int) -> meshreel.MeshSequence:
    """A unit icosphere of 10 4^n + 2 vertices, whose radius is modulated by traveling waves."""
    directions, faces = icosphere(n_subdivisions)
    phases = directions @ WAVE_VECTORS.T
    vertices = np.empty((n_frames, len(directions), 3), np.float32)
    for i, frame in enumerate(vertices):
        radius = 1 + np.sin(phases - 2 * np.pi * WAVES_PER_S * i / FPS) @ WAVE_HEIGHTS
        frame[:] = radius[:, None] * directions
    return meshreel.MeshSequence(vertices, faces, FPS, f"sphere{n_subdivisions}")


def icosphere(n_subdivisions: int) -> tuple[Floats, npt.NDArray[np.int32]]:
    """Unit vectors of shape (V, 3) and outward faces: an icosahedron subdivided n times."""
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
        ends, faces = quartered(faces, len(vertices))
        vertices = np.concatenate([vertices, unit(vertices[ends].sum(axis=1))])
    return vertices, faces.astype(np.int32)


def quartered(faces: Integers, n_verts: int) -> tuple[Integers, Integers]:
    """Split faces in four: edges of shape (E, 2) and new faces, with vertex V + e on edge e."""
    sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]], axis=-1)
    edges, edge_of_side = np.unique(sides @ [n_verts, 1], return_inverse=True)
    ends = np.stack(np.divmod(edges, n_verts), axis=1)
    (a, b, c), (ab, bc, ca) = faces.T, n_verts + edge_of_side.reshape(-1, 3).T
    quarters = [a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca]
    return ends, np.stack(quarters, axis=1).reshape(-1, 3)


def unit(vectors: Floats) -> Floats:
    """The vectors normalized to length 1."""
    scaled: Floats = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return scaled
