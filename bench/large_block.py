"""A volume result of millions of nodes: bytes, processor seconds and memory, beside SZ3's speed.

    python bench/large_block.py --folder /tmp/block --memory 9GiB       # 2 million nodes, 100 steps
    python bench/large_block.py --folder /tmp/block --nodes 200000 --steps 60

A bent block of hexahedra with temperature, stress and velocity of its nodes, known in closed form,
is written once as `.npy` files, which are mapped into memory. SZ3 compresses one column of each
array at the same bound. Needs the extra [peers], and 3.3 GB on disk per million nodes.
"""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.format import open_memmap

import meshreel
from measuring import machine_text, peak_mib, print_table
from meshreel.evaluation.peers import sz3_bytes
from meshreel.studies.timing import timed_once

HEXAHEDRON = 12
WIDTHS = {"positions": 3, "temperature": 1, "stress": 1, "velocity": 3}
BOUND = 0.1
"""Percent of the diagonal, or of the range of a result."""


def corners(n: int) -> np.ndarray:
    """Corners of the hexahedra of a block of 3 n x n x n, of shape (3 n^3, 8)."""
    numbers = np.arange((3 * n + 1) * (n + 1) ** 2, dtype=np.int32).reshape(3 * n + 1, n + 1, n + 1)
    low, high = slice(None, -1), slice(1, None)
    around = [(low, low), (high, low), (high, high), (low, high)]
    return np.stack([numbers[x, y, z].ravel() for z in (low, high) for x, y in around], axis=1)


def simulate(n: int, n_steps: int, folder: Path) -> None:
    """Write the positions and results of a block of 3 n x n x n hexahedra."""
    ticks = [np.linspace(0, length, length * n + 1) for length in (3, 1, 1)]
    rest = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, 3)
    rest += np.random.default_rng(0).normal(size=rest.shape) * 0.064 / n
    x, y, z = rest[:, 0], rest[:, 1] - 0.5, rest[:, 2]
    arrays = {
        name: open_memmap(folder / f"{name}.npy", "w+", np.float32, (n_steps, len(rest), width))
        for name, width in WIDTHS.items()
    }
    for step in range(n_steps):
        swing = np.sin(np.pi * step / 20)
        angle, wave = 0.25 * swing * (x / 3.75) ** 2, 0.03 * np.sin(6 * x - 0.5 * step)
        bent = x * np.cos(angle / 2) - y * np.sin(angle), y * np.cos(angle) + x * angle / 2 + wave
        positions = np.stack([*bent, z * (1 + 0.05 * np.sin(0.2 * step + 3 * x))], axis=1)
        arrays["positions"][step] = positions
        arrays["temperature"][step, :, 0] = 20 + 60 * np.exp(-2 * ((x - 0.03 * step) ** 2 + y**2))
        stress = 1e6 * np.abs(y) * swing * (3 - x) + 1e3 * np.sin(9 * x + 0.3 * step)
        arrays["stress"][step, :, 0] = stress
        before = arrays["positions"][max(step - 1, 0)]
        arrays["velocity"][step] = 25 * (positions - before) + 0.01 * np.sin(5 * x)[:, None]


def measured(name: str, raw_bytes: int, work: Callable[[], bytes]) -> list[str]:
    """Return cells: bytes, ratio, seconds, speed, and the peak memory of the process so far."""
    data, (_, seconds) = timed_once(work)
    peak = peak_mib() * 2**10 / 1e6
    sizes = [f"{len(data):,}", f"{raw_bytes / len(data):.0f}"]
    return [name, *sizes, f"{seconds:.0f}", f"{raw_bytes / 1e6 / seconds:.1f}", f"{peak:.1f}"]


def sz3(name: str, array: Any) -> list[str]:
    """Return the row of SZ3 for the first column of an array."""
    low, high = (getattr(array.reshape(-1, array.shape[2]), end)(axis=0) for end in ("min", "max"))
    bound = BOUND / 100 * float(np.linalg.norm(high - low)) / np.sqrt(array.shape[2])
    column = np.ascontiguousarray(array[..., 0])
    return measured(
        f"SZ3, a column of {name}",
        column.nbytes,
        lambda: sz3_bytes(column, bound, "INTERP_LORENZO"),
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--nodes", type=int, default=2_000_000)
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--memory", help="as for encode, such as 9GiB")
    arguments = parser.parse_args()
    n = round((arguments.nodes / 3) ** (1 / 3))
    folder = arguments.folder / f"{n}_{arguments.steps}"
    if not folder.exists():
        folder.mkdir(parents=True)
        simulate(n, arguments.steps, folder)
    arrays = {name: np.load(folder / f"{name}.npy", mmap_mode="r") for name in WIDTHS}
    nodes = corners(n)
    cells = meshreel.Cells(np.full(len(nodes), HEXAHEDRON, np.uint8), nodes.ravel())
    positions, *results = arrays.values()
    tracks = {name: meshreel.Track(arrays[name]) for name in list(WIDTHS)[1:]}
    sequence = meshreel.MeshSequence(positions, fps=25, cells=cells, tracks=tracks)
    print(sequence, machine_text(), flush=True)
    raw_bytes = positions.nbytes + sum(result.nbytes for result in results)
    options = {"bound": BOUND, "memory": arguments.memory}
    rows = [measured("meshreel", raw_bytes, lambda: meshreel.encode(sequence, **options))]
    rows += [sz3(name, array) for name, array in arrays.items()]
    header = ["", "bytes", "ratio", "processor s", "MB/s", "peak memory, GB"]
    print_table("", header, rows)


if __name__ == "__main__":
    main()
