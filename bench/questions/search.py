"""Runs that search for the open questions of the paper's Section V: rows and blocks."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import info
from meshreel.codec.paper_options import TRACKED_BLOCK_FRAMES
from meshreel.metrics.position_errors import position_errors
from meshreel.metrics.sted import sted
from meshreel.model.sequence import MeshSequence
from meshreel.paper.sweeps import ANCHORS
from meshreel.runtime.progress import Progress
from meshreel.studies.runs import Outcome, Run, finite

ROWS = (2, 3, 5, 8, 12, 20, 30, 50, 80)
BIT_COUNTS = (5, 6, 7, 8, 9, 10, 11, 12)

BLOCK_COUNTS = (1, 2, 3, 4, 6, 8, 12, 16)
BLOCK_ROWS = (2, 5, 12, 30)
BLOCK_BIT_COUNTS = (6, 8, 10)

MIN_IMPROVEMENT = 0.01
"""More rows or more bits are not tried if the last of them reduced no error by this fraction."""

ERRORS = ("kg_error_percent", "sted")

SEARCHES = ("rows", "blocks")
"""The questions."""

Point = dict[str, Any]


def search_runs(sequence: MeshSequence) -> dict[str, Run]:
    """The searches by question: "rows" and "blocks"."""
    return {"rows": rows_run(sequence), "blocks": blocks_run(sequence)}


def rows_run(sequence: MeshSequence) -> Run:
    """A run that measures `pca-qp` by rows and bits; its figures are "points"."""
    rows = sorted({min(count, sequence.n_frames) for count in ROWS})
    setting = {"modes": rows, "bits": list(BIT_COUNTS), "anchors": ANCHORS}

    def measure(progress: Progress) -> Outcome:
        def point(modes: int, bits: int) -> Point:
            progress(f"{modes} rows, {bits} bits", 0.0)
            data = encode(sequence, "pca-qp", n_modes=modes, bits=bits, anchors=ANCHORS)
            return {"modes": modes, "bits": bits, **measured(sequence, data)}

        return Outcome({"points": list(grid_points(rows, BIT_COUNTS, point))})

    return Run("rows and bits", "search_rows", setting, measure)


def blocks_run(sequence: MeshSequence) -> Run:
    """A run that measures `blocks` by number of blocks, rows and bits, without STED.

    n_b blocks have ceil(k / n_b) of the k frames each, the last one fewer. The figures are "points"
    and "usual_blocks", the number of blocks of about 25 frames.
    """
    usual = -(-sequence.n_frames // TRACKED_BLOCK_FRAMES)
    counts = dict[int, int]()
    for n_blocks in sorted({*BLOCK_COUNTS, usual}):
        counts.setdefault(-(-sequence.n_frames // n_blocks), n_blocks)
    setting = {
        "frames": list(counts), "modes": list(BLOCK_ROWS), "bits": list(BLOCK_BIT_COUNTS),
        "anchors": ANCHORS,
    }  # fmt: skip

    def measure(progress: Progress) -> Outcome:
        points: list[Point] = []
        for frames, n_blocks in counts.items():

            def point(modes: int, bits: int, frames: int = frames, n: int = n_blocks) -> Point:
                progress(f"{n} blocks, {modes} rows, {bits} bits", 0.0)
                data = encode(
                    sequence,
                    "blocks",
                    n_modes=modes,
                    bits=bits,
                    block_frames=frames,
                    anchors=ANCHORS,
                )
                errors = measured(sequence, data, ("kg_error_percent",))
                return {"blocks": n, "modes": modes, "bits": bits, **errors}

            rows = sorted({min(count, frames) for count in BLOCK_ROWS})
            points += grid_points(rows, BLOCK_BIT_COUNTS, point)
        return Outcome({"points": points, "usual_blocks": usual})

    return Run("numbers of blocks", "search_blocks", setting, measure)


def measured(sequence: MeshSequence, data: bytes, errors: Sequence[str] = ERRORS) -> Point:
    """The rate of a stream without the order of vertices and faces, and errors of its frames."""
    # The order is a separate section; all others are the same without it.
    size = len(data) - info(data).budget_bytes.get("order", 0)
    original, decoded = sequence.vertices, decode(data).vertices
    values: dict[str, Callable[[], float]] = {
        "kg_error_percent": lambda: position_errors(original, decoded).kg_error_percent,
        "sted": lambda: sted(original, decoded, sequence.faces).sted,
    }
    rate = 8 * size / (sequence.n_verts * sequence.n_frames)
    return {"rate_bpvf": rate, **finite({name: values[name]() for name in errors})}


def grid_points(
    rows: Sequence[int], bit_counts: Sequence[int], point: Callable[[int, int], Point]
) -> Iterator[Point]:
    """Yield the points of pairs of rows and bits, except pairs that would only add rate.

    A larger number of rows with the same bits, and of bits with the same rows, is omitted if the
    last step in this direction reduced no error by 1 %.

    Parameters
    ----------
    rows, bit_counts : sequences of int, ascending
    point : callable
        Measures a pair of rows and bits.
    """
    results: dict[tuple[int, int], Point] = {}
    for bits in bit_counts:
        for modes in rows:
            if _is_saturated([result for (_, same), result in results.items() if same == bits]):
                break
            if _is_saturated([result for (same, _), result in results.items() if same == modes]):
                continue
            results[modes, bits] = point(modes, bits)
            yield results[modes, bits]


def _is_saturated(points: Sequence[Point]) -> bool:
    """Whether the last point has hardly smaller errors than the one before."""
    if len(points) < 2:
        return False
    errors = [[point.get(name) for name in ERRORS] for point in points[-2:]]
    pairs = [(before, last) for before, last in zip(*errors, strict=True) if last is not None]
    return all(
        before is not None and last > (1 - MIN_IMPROVEMENT) * before for before, last in pairs
    )
