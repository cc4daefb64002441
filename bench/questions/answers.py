"""Answers to the open questions of the paper's Section V, from the points of `search`."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from meshreel.paper.sweeps import BITS, MODES
from meshreel.studies.rate_distortion import Point, bd_rate, lower_envelope, rate_at_error
from meshreel.studies.runs import Result
from questions.search import ERRORS, SEARCHES

RATES = (0.25, 0.5, 1.0, 2.0)
"""Rates in bpvf at which tables list the best rows and bits."""

MIN_KNEE = 0.1
"""A curve has a knee if it runs below its chord by this fraction of its height on log axes."""

Answer = dict[str, Any]


def search_answers(results: Mapping[str, Result]) -> dict[str, Answer]:
    """The answers of one sequence, from the results of its searches, by question."""
    functions = {"rows": rows_answer, "blocks": blocks_answer}
    return {question: functions[question](results[question]) for question in SEARCHES}


def envelope(points: Sequence[Answer], error: str) -> list[Answer]:
    """The points on the lower convex hull of log error over rate, by ascending rate.

    Each minimizes the log error plus a multiple of the rate. Pareto-optimal points above the hull
    are omitted: settings between its points, which a search skips, are usually better.
    """
    by_pair = dict(zip(_pairs(points, error), points, strict=True))
    hull: list[Point] = []
    for rate, value in lower_envelope(list(by_pair)):
        while len(hull) > 1 and _slope(hull[-2], hull[-1]) >= _slope(hull[-2], (rate, value)):
            hull.pop()
        hull.append((rate, value))
    return [by_pair[pair] for pair in hull]


def _slope(first: Point, second: Point) -> float:
    return float(np.log(second[1] / first[1])) / (second[0] - first[0])


def knee(curve: Sequence[Point]) -> tuple[int, float] | None:
    """The point of a falling curve that is farthest below its chord, on log axes.

    Both axes are scaled to 0..1 between the ends of the curve.

    Parameters
    ----------
    curve : sequence of pairs of positive numbers, by ascending first

    Returns
    -------
    index of the point and its distance, or None for fewer than 3 points

    References
    ----------
    V. Satopaa, J. Albrecht, D. Irwin, B. Raghavan, "Finding a 'kneedle' in a haystack", ICDCS
    Workshops, 2011; there on linear axes.
    """
    if len(curve) < 3:
        return None
    x, y = np.log(np.array(curve, np.float64)).T
    below = (x[-1] - x) / (x[-1] - x[0]) - (y - y[-1]) / (y[0] - y[-1])
    return int(np.argmax(below)), float(below.max())


def shown_knee(found: Answer | None) -> Answer | None:
    """A knee that is at least `MIN_KNEE` below the chord, or None."""
    return found if found is not None and found["distance"] >= MIN_KNEE else None


def rows_answer(figures: Result) -> Answer:
    """The ideal numbers of rows and bits, for each error.

    Returns
    -------
    dict by error: "best", the rows and bits of the envelope at each of `RATES`; "growth", the
    exponent of the rate to which the rows of the envelope are proportional; "knee" of the envelope
    and "row_knee" of the error over the rows with 8 bits; and in percent of the rate of the
    envelope at equal error: "table", 20 rows and 8 bits, "table_rows", 20 rows with any bits, and
    "table_bits", any rows with 8 bits.
    """
    return {error: _rows_answer(figures["points"], error) for error in ERRORS}


def _rows_answer(points: Sequence[Answer], error: str) -> Answer:
    points = [point for point in points if point[error]]
    best = envelope(points, error)
    pairs = _pairs(best, error)
    at_rates = [[one for one in best if one["rate_bpvf"] <= rate][-1:] for rate in RATES]
    of_rows = [point for point in points if point["modes"] == MODES]
    of_bits = [point for point in points if point["bits"] == BITS]
    by_rows = [(float(bit["modes"]), float(bit[error])) for bit in of_bits]
    losses = [
        100 * (row["rate_bpvf"] / least - 1)
        for row in of_rows
        if row["bits"] == BITS and (least := rate_at_error(pairs, row[error])) is not None
    ]
    return {
        "best": [_rows_and_bits(*found) if found else None for found in at_rates],
        "growth": _exponent([(one["rate_bpvf"], float(one["modes"])) for one in best]),
        "knee": _with_distance(best, knee(pairs)),
        "row_knee": _with_distance(of_bits, knee(by_rows)),
        "table": losses[0] if losses else None,
        "table_rows": bd_rate(_pairs(envelope(of_rows, error), error), pairs).percent,
        "table_bits": bd_rate(_pairs(envelope(of_bits, error), error), pairs).percent,
    }


def _pairs(points: Sequence[Answer], error: str) -> list[Point]:
    return [(point["rate_bpvf"], point[error]) for point in points]


def _rows_and_bits(point: Answer) -> Answer:
    return {name: point[name] for name in ("rate_bpvf", "modes", "bits")}


def _with_distance(points: Sequence[Answer], found: tuple[int, float] | None) -> Answer | None:
    if found is None:
        return None
    return {**_rows_and_bits(points[found[0]]), "distance": found[1]}


def _exponent(pairs: Sequence[Point]) -> float | None:
    """Least-squares slope on log axes."""
    if len(pairs) < 2:
        return None
    x, y = np.log(np.array(pairs)).T
    return float(np.cov(x, y, bias=True)[0, 1] / np.var(x))


def blocks_answer(figures: Result) -> Answer:
    """The ideal number of blocks.

    Returns
    -------
    dict with "rates", the BD-rate in percent by number of blocks, relative to one block at equal KG
    error (None if not comparable); "best", the number with the lowest; and "usual" of 25 frames
    """
    by_count: dict[int, list[Answer]] = {}
    for one in figures["points"]:
        if one["kg_error_percent"]:
            by_count.setdefault(one["blocks"], []).append(one)
    curves = {
        n_blocks: _pairs(envelope(points, "kg_error_percent"), "kg_error_percent")
        for n_blocks, points in by_count.items()
    }
    rates = {
        n_blocks: 0.0 if n_blocks == 1 else bd_rate(curve, curves.get(1, [])).percent
        for n_blocks, curve in curves.items()
    }
    comparable = {n_blocks: rate for n_blocks, rate in rates.items() if rate is not None}
    return {
        "rates": {str(n_blocks): rate for n_blocks, rate in rates.items()},
        "best": min(comparable, key=lambda n_blocks: comparable[n_blocks], default=None),
        "usual": figures["usual_blocks"],
    }
