"""The paper's claims judged by the results, each with its numbers."""

from collections.abc import Callable

import numpy as np

from meshreel.evaluation.paper.results import PaperResults, label_of_result
from meshreel.evaluation.runs.store import Result, done

FIGURES = (("kg_error_percent", "KG"), ("sted", "STED"), ("nmsve_mean", "NMSVE"))
"""Errors that are compared, and their names."""

EQUAL_WITHIN = 0.001
"""Relative difference of errors up to which two variants count as of equal quality."""

SMALL_GAIN = 0.1
"""Share by which STED may fall while more rows count as showing little."""


def findings(results: PaperResults) -> list[str]:
    """A sentence for each claim of the paper that the results of a sequence can judge."""
    checks: tuple[Callable[[PaperResults], str | None], ...] = (
        _serial_equals_parallel,
        _serial_seconds,
        _lowest_error,
        _blocks_seconds,
        _blocks_quality,
        _deltas_against_vertices,
        _anchors_help,
        _few_anchors,
        _rows_enough,
        _steadiness,
    )
    return [sentence for check in checks if (sentence := check(results)) is not None]


def _serial_equals_parallel(results: PaperResults) -> str | None:
    serial, parallel = results.variant("pca-qs"), results.variant("pca-qp")
    if serial is None or parallel is None:
        return None
    differences = {
        name: abs(_error(serial, key) - _error(parallel, key)) / (_error(parallel, key) or 1.0)
        for key, name in (*FIGURES, ("sted_temporal", "temporal part of STED"))
    }
    holds = max(differences.values()) <= EQUAL_WITHIN
    listed = ", ".join(f"{name} {value:.1g}" for name, value in differences.items())
    return (
        f"**PCA+qs and PCA+qp are of equal quality: {_verdict(holds)}.** "
        f"Relative differences: {listed} (equal: up to {EQUAL_WITHIN:g})."
    )


def _serial_seconds(results: PaperResults) -> str | None:
    serial, parallel = results.variant("pca-qs"), results.variant("pca-qp")
    if serial is None or parallel is None:
        return None
    slow, fast = serial["seconds"]["decode"], parallel["seconds"]["decode"]
    return (
        f"**PCA+qs is much slower to reconstruct: {_verdict(slow > 2 * fast)}.** "
        f"{slow:.3g} s against {fast:.3g} s, {slow / fast:.3g} times."
    )


def _lowest_error(results: PaperResults) -> str | None:
    finished = sorted(done(results.variants), key=lambda result: _error(result, "nmsve_mean"))
    labels = [label_of_result(result) for result in finished]
    if len(finished) < 2 or not {"pca-qs", "pca-qp"} & set(labels):
        return None
    listed = ", ".join(
        f"`{label}` {_error(result, 'nmsve_mean'):.2e} at {result['rate_order_dropped_bpvf']:.2g}"
        for label, result in zip(labels, finished, strict=True)
    )
    return (
        "**PCA+qs and PCA+qp have the lowest NMSVE: "
        f"{_verdict(labels[0] in ('pca-qs', 'pca-qp'))}** at the settings of the tables. Mean "
        f"NMSVE at bpvf, the lowest first: {listed}."
    )


def _blocks_seconds(results: PaperResults) -> str | None:
    blocks, whole = results.variant("blocks"), results.variant("pca-qp")
    if blocks is None or whole is None:
        return None
    pairs = [(blocks["seconds"][part], whole["seconds"][part]) for part in ("encode", "decode")]
    fastest = all(mine < other for mine, other in pairs)
    return (
        f"**Blocks are faster than PCA+qp in both phases: {_verdict(fastest)}.** Encoding "
        f"{pairs[0][0]:.3g} s against {pairs[0][1]:.3g} s, reconstruction {pairs[1][0]:.3g} s "
        f"against {pairs[1][1]:.3g} s."
    )


def _blocks_quality(results: PaperResults) -> str | None:
    blocks, whole = results.variant("blocks"), results.variant("pca-qp")
    if blocks is None or whole is None:
        return None
    errors = [_error(result, "kg_error_percent") for result in (blocks, whole)]
    rates = [result["rate_order_dropped_bpvf"] for result in (blocks, whole)]
    overlap = results.at_equal_rate("kg_error_percent", "blocks", "pca-qp")
    inferior = errors[0] > errors[1] if overlap is None else overlap.error_ratio > 1
    where = "at the settings of the tables" if overlap is None else "at equal rate"
    return (
        f"**Blocks are inferior in quality: {_verdict(inferior)}**, by KG {where}. At the settings "
        f"of the tables: {errors[0]:.3g} % at {rates[0]:.3g} bpvf against {errors[1]:.3g} % at "
        f"{rates[1]:.3g}. At equal rate, errors as multiples of those of `pca-qp`: "
        f"{_ratios_text(results, 'blocks', 'pca-qp')}."
    )


def _deltas_against_vertices(results: PaperResults) -> str | None:
    if "v2v" not in results.points("sted"):
        return None
    judged = [
        f"`{method}` {_ratios_text(results, method, 'v2v')}"
        for method in ("pca-qp", "pca-q", "blocks")
        if method in results.points("sted")
    ]
    if not judged:
        return None
    return (
        "**Laplacian variants against v2v at equal rate.** Errors as multiples of those of `v2v` "
        f"(below 1: better): {'; '.join(judged)}."
    )


def _anchors_help(results: PaperResults) -> str | None:
    without, anchored = results.variant("pca-q"), results.variant("pca-qp")
    if without is None or anchored is None:
        return None
    pairs = [(name, _error(without, key), _error(anchored, key)) for key, name in FIGURES]
    listed = ", ".join(f"{name} {before:.3g} to {after:.3g}" for name, before, after in pairs)
    if all(after == before for _, before, after in pairs):
        return (
            "**Anchors raise the level of detail: not to be judged.** Each component has one "
            "anyhow, and 1 % of the vertices is no more than that."
        )
    holds = all(after < before for _, before, after in pairs)
    more = anchored["rate_order_dropped_bpvf"] - without["rate_order_dropped_bpvf"]
    return (
        f"**Anchors raise the level of detail: {_verdict(holds)}.** From `pca-q` to `pca-qp`: "
        f"{listed}, for {more:.3g} bpvf more."
    )


def _few_anchors(results: PaperResults) -> str | None:
    few, usual = results.variant("pca-qp 0.5 %"), results.variant("pca-qp")
    if few is None or usual is None:
        return None
    return (
        "**Half of the anchors.** 0.5 % instead of 1 %: KG "
        f"{_error(few, 'kg_error_percent'):.3g} % instead of "
        f"{_error(usual, 'kg_error_percent'):.3g} %, STED {_error(few, 'sted'):.3g} instead of "
        f"{_error(usual, 'sted'):.3g}, {few['rate_order_dropped_bpvf']:.3g} bpvf instead of "
        f"{usual['rate_order_dropped_bpvf']:.3g}."
    )


def _rows_enough(results: PaperResults) -> str | None:
    rows = {result["identity"]["setting"]["n_modes"]: result for result in done(results.rows)}
    if 20 not in rows or 30 not in rows:
        return None
    listed = ", ".join(
        f"{n_modes}: {_error(result, 'kg_error_percent'):.3g} % and {_error(result, 'sted'):.3g}"
        for n_modes, result in sorted(rows.items())
    )
    gain = 1 - _error(rows[30], "sted") / (_error(rows[20], "sted") or 1.0)
    return (
        f"**More than 20 rows show little more: {_verdict(gain < SMALL_GAIN)}** (STED falls by "
        f"less than {100 * SMALL_GAIN:.0f} %). From 20 to 30 rows it falls by {100 * gain:.1f} %. "
        f"KG and STED by k_l, 8 bits: {listed}."
    )


def _steadiness(results: PaperResults) -> str | None:
    graph, temporal = results.variant("gft"), results.variant("pca-qp")
    if graph is None or temporal is None:
        return None
    spread, spread_other = (
        float(np.std(errors) / np.mean(errors))
        for errors in (np.array(result["quality"]["nmsve"], float) for result in (graph, temporal))
    )
    return (
        f"**Per mesh has nearly the same NMSVE in every frame: {_verdict(spread < 0.1)}** (a "
        f"deviation below 10 % of the mean). Over the frames it deviates by {100 * spread:.1f} % "
        f"of its mean, that of `pca-qp` by {100 * spread_other:.1f} %."
    )


def _ratios_text(results: PaperResults, method: str, other: str) -> str:
    """Error ratios with the rates they are over, by figure; says where no rate is common."""
    found: list[str] = []
    for figure, name in FIGURES:
        overlap = results.at_equal_rate(figure, method, other)
        if overlap is None:
            found.append(f"{name} has no rates in common")
            continue
        rates = f"{overlap.low_bpvf:.2g} to {overlap.high_bpvf:.2g} bpvf"
        found.append(f"{name} {overlap.error_ratio:.2f} ({rates})")
    if all("no rates" in text for text in found):
        return "no rates in common, not compared"
    return ", ".join(found)


def _error(result: Result, key: str) -> float:
    value = result["quality"][key]
    return float("inf") if value is None else float(value)


def _verdict(holds: bool) -> str:
    return "holds" if holds else "does not hold"
