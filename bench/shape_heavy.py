"""Bits of `reel` against those of the paper's `pca-qp` at equal KG error and at equal STED.

    python examples/falling_cloth.py --out cloth.npz
    python bench/shape_heavy.py cloth.npz samba.npz

Made for sequences in which the shape itself is most of the file. Bjontegaard rates in percent, of
whole files without the order, over the errors that both reach: a quality every 12 points against
the best of 5 to 40 modes with 6 to 10 bits and of both kinds of anchors.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from pathlib import Path
from typing import Any

import meshreel
from meshreel.evaluation.rate_distortion import bd_rate

QUALITIES = (36, 48, 60, 72, 84, 96)
MODES, BITS = (5, 10, 20, 40), (6, 8, 10)
ANCHORS = (None, "anchor-values=coefficients")


def point(sequence: meshreel.MeshSequence, **options: Any) -> tuple[float, float, float]:
    """Rate, KG error and STED of a stream."""
    data = meshreel.encode(sequence, order="vertices", **options)
    found = meshreel.compare(sequence, meshreel.decode(data))
    size = len(data) - meshreel.info(data).budget_bytes["order"]
    rate = 8.0 * size / (sequence.n_verts * sequence.n_frames)
    return rate, found.kg_error_percent, found.sted


def row(source: str) -> str:
    """A row of the table."""
    sequence = meshreel.load(source)
    ours = [point(sequence, quality=quality) for quality in QUALITIES]
    theirs = [
        point(sequence, method="pca-qp", n_modes=n_modes, bits=bits, choices=choices)
        for n_modes, bits, choices in product(MODES, BITS, ANCHORS)
    ]
    cells = [Path(source).stem]
    for column in (1, 2):
        curves = ([(one[0], one[column]) for one in points] for points in (ours, theirs))
        found = bd_rate(*curves)
        percent = "-" if found.percent is None else f"{found.percent:+.1f}"
        cells += [percent, f"{found.low_error:.2g} to {found.high_error:.2g}"]
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    """Measure, and print a Markdown table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sources", nargs="+")
    parser.add_argument("--workers", type=int)
    arguments = parser.parse_args()
    print("| | at equal KG | KG % | at equal STED | STED |\n|---|---|---|---|---|")
    with ProcessPoolExecutor(arguments.workers) as pool:
        for line in pool.map(row, arguments.sources):
            print(line, flush=True)


if __name__ == "__main__":
    main()
