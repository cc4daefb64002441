"""Bytes of the tracks of simulation results, against the best of SZ3, zfp and pcodec.

    python bench/fields.py results/*.vtu wave.pvd disk_out_ref.ex2 --bound 0.1

Every float track of nodes and cells is encoded within this percentage of its range with
`meshreel.encode(file, bound=...)`. The others code each column at the same largest error of a
value (columns of vectors at the bound divided by the square root of their number), as rows over
time or one step after another, with items in the given order or along a space-filling curve; the
smallest result counts, without its order. Needs the extra [peers].
"""

import argparse
import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import numpy as np

import meshreel
from meshreel.evaluation.peers import pcodec_bytes, sz3_bytes, zfp_bytes
from meshreel.model.surface import Domain
from meshreel.studies.study import markdown_row

HEADER = ["file", "track", "items", "of", "columns", "steps", "bytes", "others", "best", "ratio"]
ALGORITHMS = "INTERP_LORENZO", "LORENZO_REG"


def morton_order(points: np.ndarray) -> np.ndarray:
    """Return the order of points along a Z-order curve of 2^20 cells per axis."""
    low, span = points.min(axis=0), np.ptp(points, axis=0).max() or 1.0
    cells = ((points - low) / span * ((1 << 20) - 1)).astype(np.uint64)
    code = np.zeros(len(points), np.uint64)
    for bit, axis in product(range(20), range(3)):
        code |= (cells[:, axis] >> np.uint64(bit) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return np.argsort(code, kind="stable")


def points_of(sequence: meshreel.MeshSequence, domain: Domain) -> np.ndarray:
    """Return the vertices, or the centers of the cells or triangles, of the first frame."""
    points = np.asarray(sequence.vertices[0], np.float64)
    if domain is Domain.VERTEX:
        return points
    cells = sequence.surface.cells
    if domain is Domain.CELL and cells is not None:
        sums = np.add.reduceat(points[cells.nodes], cells.starts[:-1], axis=0)
        return np.asarray(sums / np.diff(cells.starts)[:, None])
    return np.asarray(points[sequence.faces].mean(axis=1))


def coded_bytes(column: np.ndarray, tolerance: float) -> Iterator[tuple[int, str]]:
    """Yield the bytes and the coder of a column, of shape (T, N), in each layout."""
    quantized = np.rint(column / (2.0 * tolerance)).astype(np.int64)
    for array, integers in ((column, quantized), (column.ravel(), quantized.ravel())):
        for algorithm in ALGORITHMS:
            yield len(sz3_bytes(array, tolerance, algorithm)), "SZ3"
        yield len(zfp_bytes(array, tolerance)), "zfp"
        yield len(pcodec_bytes(integers)), "pcodec"


def best_of_others(values: np.ndarray, points: np.ndarray, bound: float) -> tuple[int, str]:
    """Return the fewest bytes of the other coders, and the coder of the first column."""
    _, n_items, n_columns = values.shape
    orders = [np.arange(n_items)]
    if len(points) == n_items:
        orders.append(morton_order(points))
    best = [
        min(
            result
            for order in orders
            for result in coded_bytes(column[:, order], bound / np.sqrt(n_columns))
        )
        for column in np.moveaxis(values, 2, 0)
    ]
    return sum(size for size, _ in best), best[0][1]


def main() -> None:
    """Print a row for each track, and the geometric mean of the ratios."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--bound", type=float, default=0.1, help="percent of the range")
    arguments = parser.parse_args()
    ratios: list[float] = []
    print(markdown_row(HEADER), markdown_row(["---"] * len(HEADER)), sep="\n")
    for path in arguments.files:
        try:
            sequence = meshreel.load(path)
        except meshreel.MeshReelError as error:
            print(f"{path}: {error}", file=sys.stderr)
            continue
        data = meshreel.encode(sequence, bound=arguments.bound)
        for info in meshreel.info(data).tracks:
            track = sequence.tracks[info.name]
            values = track.read(0, track.shape[0]).astype(np.float64)
            span = float(np.linalg.norm(np.ptp(values, axis=(0, 1))))
            if track.dtype.kind != "f" or not 0.0 < span < np.inf:
                continue
            bound = arguments.bound / 100.0 * span
            other, name = best_of_others(values, points_of(sequence, track.domain), bound)
            ratios.append(info.size_bytes / other)
            n_frames, n_items, n_columns = track.shape
            numbers = n_items, track.domain.value, n_columns, n_frames
            row = path.name, info.name, *numbers, info.size_bytes, other, name, f"{ratios[-1]:.2f}"
            print(markdown_row(map(str, row)), flush=True)
    mean = float(np.exp(np.mean(np.log(ratios))))
    larger = sum(ratio > 1.0 for ratio in ratios)
    print(f"\n{len(ratios)} tracks: geometric mean {mean:.3f}, {larger} larger than the best other")


if __name__ == "__main__":
    main()
