"""Closest points on triangle meshes: the core compared with libigl, in one thread.

    python bench/closest_points.py samba.npz --remesh
    python bench/closest_points.py liam/

Two neighboring frames: the vertices and face centroids of the second are searched on the first.
Printed are medians of processor milliseconds to build the tree, and microseconds per point.
"""

import argparse
from functools import partial
from statistics import median

import igl
import numpy as np

from measuring import print_table
from meshreel.kernel.closest import TriangleTree
from meshreel.studies.timing import timed_once
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

    seconds: dict[str, list[tuple[float, float]]] = {"core": [], "libigl": []}
    for _ in range(arguments.repeats):
        tree, build = timed_once(partial(TriangleTree, vertices, faces))
        closest, search = timed_once(partial(tree.closest, points))
        seconds["core"].append((build.processor, search.processor))
        tree_of_igl = igl.AABB()
        _, build = timed_once(partial(tree_of_igl.init, vertices, faces))
        (squares, *_), search = timed_once(
            partial(tree_of_igl.squared_distance, vertices, faces, points)
        )
        seconds["libigl"].append((build.processor, search.processor))
    largest = np.abs(np.sqrt(squares) - closest.distances).max() / np.ptp(vertices, axis=0).max()
    print(f"{len(faces)} faces, {len(points)} points; distances differ by {largest:.1g} sides")
    rows = []
    for name, times in seconds.items():
        build_ms, search_ms = (1e3 * median(column) for column in zip(*times, strict=True))
        each_us = 1e3 * search_ms / len(points)
        rows.append([name, f"{build_ms:.1f}", f"{each_us:.2f}", f"{build_ms + search_ms:.1f}"])
    print_table("", ["", "build, ms", "search, us per point", "both, ms"], rows)


if __name__ == "__main__":
    main()
