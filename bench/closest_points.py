"""Closest points on triangle meshes: the core compared with libigl, in one thread.

    python bench/closest_points.py samba.npz --remesh
    python bench/closest_points.py liam/

Two neighboring frames: the vertices and face centroids of the second are searched on the first.
Printed are medians of processor milliseconds to build the tree, and microseconds per point.
"""

import argparse
from collections.abc import Callable
from functools import partial
from typing import Any

import igl
import numpy as np

from measuring import medians, print_table, rounds
from meshreel.kernel.closest import TriangleTree
from registration import frames_of, remeshed

FIRST = 4


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("source", help="a raw capture, or a sequence with --remesh")
    parser.add_argument("--remesh", action="store_true")
    parser.add_argument("--repeats", type=int, default=11)
    arguments = parser.parse_args()
    frames = frames_of(arguments.source, slice(FIRST, FIRST + 2))
    target, other = remeshed(frames) if arguments.remesh else frames
    vertices, faces = target.vertices.astype(np.float64, order="C"), target.faces
    points = other.vertices.astype(np.float64, order="C")
    points = np.concatenate([points, points[other.faces].mean(axis=1)])

    core, libigl = TriangleTree(vertices, faces), igl.AABB()
    libigl.init(vertices, faces)
    search_libigl = partial(libigl.squared_distance, vertices, faces, points)
    tasks: dict[tuple[str, str], Callable[[], Any]] = {
        ("core", "build"): partial(TriangleTree, vertices, faces),
        ("core", "search"): partial(core.closest, points),
        ("libigl", "build"): lambda: igl.AABB().init(vertices, faces),
        ("libigl", "search"): search_libigl,
    }
    distances = core.closest(points).distances
    squares, *_ = search_libigl()
    seconds = medians(rounds(tasks, arguments.repeats))
    largest = np.abs(np.sqrt(squares) - distances).max() / np.ptp(vertices, axis=0).max()
    print(f"{len(faces)} faces, {len(points)} points; distances differ by {largest:.1g} sides")
    rows = []
    for name in ("core", "libigl"):
        build_ms, search_ms = (1e3 * seconds[name, step].processor for step in ("build", "search"))
        each_us = 1e3 * search_ms / len(points)
        rows.append([name, f"{build_ms:.1f}", f"{each_us:.2f}", f"{build_ms + search_ms:.1f}"])
    print_table("", ["", "build, ms", "search, us per point", "both, ms"], rows)


if __name__ == "__main__":
    main()
