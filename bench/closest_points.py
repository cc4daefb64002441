"""Closest points on triangle meshes: the core compared with libigl, in one thread.

    python bench/closest_points.py samba.npz --remesh
    python bench/closest_points.py liam/

Two neighboring frames: the vertices and face centroids of the second are searched on the first.
Printed are medians of processor milliseconds to build the tree, and microseconds per point.
"""

import argparse
import time
from collections.abc import Callable
from functools import partial
from statistics import median
from typing import Any

import igl
import numpy as np

from meshreel.kernel.closest import TriangleTree
from registration import frames_of, remeshed

FIRST = 4


def timed(function: Callable[[], Any]) -> tuple[float, Any]:
    """Return processor seconds, and the result."""
    begin = time.process_time()
    result = function()
    return time.process_time() - begin, result


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
        build, tree = timed(partial(TriangleTree, vertices, faces))
        search, found = timed(partial(tree.closest, points))
        seconds["core"].append((build, search))
        tree = igl.AABB()
        build, _ = timed(partial(tree.init, vertices, faces))
        search, (squares, *_) = timed(partial(tree.squared_distance, vertices, faces, points))
        seconds["libigl"].append((build, search))
    largest = np.abs(np.sqrt(squares) - found.distances).max() / np.ptp(vertices, axis=0).max()
    print(f"{len(faces)} faces, {len(points)} points; distances differ by {largest:.1g} sides")
    print("| | build, ms | search, us per point | both, ms |\n|---|---|---|---|")
    for name, times in seconds.items():
        build, search = (1e3 * median(column) for column in zip(*times, strict=True))
        each = 1e3 * search / len(points)
        print(f"| {name} | {build:.1f} | {each:.2f} | {build + search:.1f} |")


if __name__ == "__main__":
    main()
