"""Rates of `reel` relative to the paper's `pca-qp` at equal KG error and at equal STED.

    python bench/falling_cloth.py --out cloth.npz
    python bench/shape_heavy.py cloth.npz samba.npz

For sequences whose files are dominated by the shape. Bjontegaard rates in percent, of whole files
without vertex order, over the common range of errors: qualities in steps of 12 against the best of
5 to 40 modes with 6 to 10 bits and both kinds of anchors.
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
    errors = meshreel.compare(sequence, meshreel.decode(data))
    size = len(data) - meshreel.info(data).budget_bytes["order"]
    rate = 8.0 * size / (sequence.n_verts * sequence.n_frames)
    return rate, errors.kg_error_percent, errors.sted


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
        curves = ([(p[0], p[column]) for p in points] for points in (ours, theirs))
        difference = bd_rate(*curves)
        percent = "-" if difference.percent is None else f"{difference.percent:+.1f}"
        cells += [percent, f"{difference.low_error:.2g} to {difference.high_error:.2g}"]
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
