"""Verdicts on the paper's claims from the results of a sequence."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from meshreel.evaluation.runs.store import Result, done
from meshreel.paper.study.results import (
    PaperResults,
    extrapolated_basis,
    label_of_result,
    method_of_result,
)
from meshreel.paper.sweeps import (
    CHOICE_NAMES,
    COEFFICIENTS,
    FINE_ANCHORS,
    QUANTIZED_DELTAS,
    RANDOM_ANCHORS,
    RANDOM_COEFFICIENTS,
)
from meshreel.runtime.counting import duration_text

FIGURES = (("kg_error_percent", "KG"), ("sted", "STED"), ("nmsve_mean", "NMSVE"))
"""Compared errors and their names."""

MAX_EQUAL_DIFFERENCE = 0.001
"""Largest relative difference of errors at which two variants have equal quality."""

SMALL_GAIN = 0.1
"""More rows have little effect if STED falls by less than this fraction."""

FEWER_BITS_RATIO = 0.9
"""Ratio of bits below which something needs fewer bits."""

SMALL_EFFECT = 0.05
"""Random anchors have little effect if errors change by at most this fraction."""

MIN_SIMILAR_CORRELATION = 0.5
"""Smallest correlation of errors per frame that follow a similar pattern."""

PER_MESH_VERTICES = 20000
"""Vertices beyond which the paper considers the per-mesh solve infeasible."""

MAX_FEASIBLE_S = 24 * 3600.0
"""Longest time of the decompositions of all frames that is feasible: a day."""

MIN_EXTRAPOLATED_VERTS = 2000
"""Fewest vertices from which the time of larger meshes is extrapolated."""

PRINTED_DICTIONARY_BITS = (8.5, 10.6)
"""Bits per entry implied by the printed q_d of `blocks`, for Samba and for Handstand."""


@dataclass(frozen=True)
class Finding:
    """A claim of the paper and the verdict of a sequence's results.

    Attributes
    ----------
    holds : bool or None
        None if the results do not allow a verdict.
    evidence : str
        The measured values, in a sentence or two.
    figure : str
        The deciding value, for a table.
    """

    claim: str
    holds: bool | None
    evidence: str
    figure: str = ""

    @property
    def verdict(self) -> str:
        """The verdict as text."""
        return {True: "holds", False: "does not hold", None: "not judged"}[self.holds]

    @property
    def text(self) -> str:
        """Claim, verdict and evidence as Markdown."""
        return f"**{self.claim}: {self.verdict}.** {self.evidence}"


def findings(results: PaperResults) -> list[Finding]:
    """Return a finding for each claim of the paper that the results of a sequence cover."""
    checks: tuple[Callable[[PaperResults], Finding | None], ...] = (
        _anchor_values_of_pca_qp,
        _anchor_values_of_blocks,
        _anchor_bits,
        _anchors_help,
        _few_anchors,
        _anchor_choice,
        _deltas_against_vertices,
        _quantized_deltas,
        _lowest_error,
        _similar_pattern,
        _rows_enough,
        _serial_equals_parallel,
        _serial_artifacts,
        _serial_seconds,
        _blocks_encode_seconds,
        _blocks_decode_seconds,
        _blocks_long_encode_seconds,
        _blocks_long_decode_seconds,
        _blocks_quality,
        _differences,
        _quiet_blocks,
        _steadiness,
        _per_mesh_size,
    )
    return [finding for check in checks if (finding := check(results)) is not None]


def _anchor_values_of_pca_qp(results: PaperResults) -> Finding | None:
    return _anchor_values(results, "pca-qp", "PCA+qp")


def _anchor_values_of_blocks(results: PaperResults) -> Finding | None:
    return _anchor_values(results, "blocks", "blocks")


def _anchor_values(results: PaperResults, method: str, name: str) -> Finding | None:
    positions = results.variant(method)
    coefficients = results.variant(f"{method} ({CHOICE_NAMES[COEFFICIENTS]})")
    if positions is None or coefficients is None:
        return None
    errors = [_error(result, "kg_error_percent") for result in (positions, coefficients)]
    rates = [result["rate_order_dropped_bpvf"] for result in (positions, coefficients)]
    overlap = results.at_equal_rate("kg_error_percent", method, label_of_result(coefficients))
    ratio = errors[0] / (errors[1] or 1.0) if overlap is None else overlap.error_ratio
    condition = "at the settings of the tables" if overlap is None else "at equal rate"
    return Finding(
        f"Positions of anchors in all frames (Eq. 12) beat their coefficients, {name}",
        ratio < 1,
        f"KG {errors[0]:.3g} % at {rates[0]:.3g} bpvf with positions, {errors[1]:.3g} % at "
        f"{rates[1]:.3g} with coefficients; {ratio:.2f} times the error {condition}.",
        f"KG {ratio:.2f} times",
    )


def _anchor_bits(results: PaperResults) -> Finding | None:
    default = results.variant("pca-qp")
    fine = results.variant(f"pca-qp ({CHOICE_NAMES[FINE_ANCHORS]})")
    if default is None or fine is None:
        return None
    errors = [_error(result, "kg_error_percent") for result in (fine, default)]
    rates = [result["rates"]["stored"]["q_a"] for result in (fine, default)]
    printed = fine["rates"]["eq13"]["q_a"]
    return Finding(
        "Anchors need 16 bits for each position",
        errors[1] > 1.02 * errors[0],
        f"With 16 bits KG is {errors[0]:.3g} % and q_a in the stream {rates[0]:.4f} "
        f"(16 n_c / n is {printed:.4f}); with 4 bits more than the deltas, {errors[1]:.3g} % "
        f"and {rates[1]:.4f}.",
        f"KG {100 * (errors[1] / errors[0] - 1):+.1f} %, q_a {rates[0]:.3f} to {rates[1]:.3f}",
    )


def _anchors_help(results: PaperResults) -> Finding | None:
    without, anchored = results.variant("pca-q"), results.variant("pca-qp")
    if without is None or anchored is None:
        return None
    claim = "Anchors raise the level of detail"
    pairs = [(name, _error(without, key), _error(anchored, key)) for key, name in FIGURES]
    listed = ", ".join(f"{name} {before:.3g} to {after:.3g}" for name, before, after in pairs)
    extra = anchored["rate_order_dropped_bpvf"] - without["rate_order_dropped_bpvf"]
    if all(after == before for _, before, after in pairs):
        return Finding(claim, None, "1 % of the vertices is at most one per component.")
    return Finding(
        claim,
        all(after < before for _, before, after in pairs),
        f"From `pca-q` to `pca-qp`: {listed}, for {extra:.3g} bpvf more.",
        f"KG {pairs[0][1]:.3g} to {pairs[0][2]:.3g} %",
    )


def _few_anchors(results: PaperResults) -> Finding | None:
    few, default = results.variant("pca-qp (0.5 %)"), results.variant("pca-qp")
    if few is None or default is None:
        return None
    errors = [_error(result, "kg_error_percent") for result in (default, few)]
    return Finding(
        "1 % of the vertices as anchors are better than 0.5 %",
        errors[0] < errors[1],
        f"0.5 % instead of 1 %: KG {errors[1]:.3g} % instead of {errors[0]:.3g} %, STED "
        f"{_error(few, 'sted'):.3g} instead of {_error(default, 'sted'):.3g}, "
        f"{few['rate_order_dropped_bpvf']:.3g} bpvf instead of "
        f"{default['rate_order_dropped_bpvf']:.3g}.",
        f"KG {errors[0]:.3g} against {errors[1]:.3g} %",
    )


def _anchor_choice(results: PaperResults) -> Finding | None:
    sets = (
        ("pca-qp", RANDOM_ANCHORS),
        (f"pca-qp ({CHOICE_NAMES[COEFFICIENTS]})", RANDOM_COEFFICIENTS),
    )
    positions, coefficients = (_random_changes(results, *arguments) for arguments in sets)
    if not positions:
        return None
    listed, others = (
        ", ".join(f"{100 * change:+.1f} %" for change in changes)
        for changes in (positions, coefficients)
    )
    return Finding(
        "The choice of anchors hardly affects the results",
        max(map(abs, positions)) <= SMALL_EFFECT,
        f"KG with random anchors against farthest points, by seed: {listed} (hardly: up to "
        f"{100 * SMALL_EFFECT:.0f} %)."
        + (f" With coefficients instead of positions: {others}." if others else ""),
        f"KG {listed}" + (f" (coefficients {others})" if others else ""),
    )


def _random_changes(
    results: PaperResults, label: str, random_choices: Sequence[str]
) -> list[float]:
    """Relative change of the KG error with random anchors, by seed."""
    default = results.variant(label)
    others = [results.variant(f"pca-qp ({CHOICE_NAMES[choices]})") for choices in random_choices]
    if default is None:
        return []
    reference = _error(default, "kg_error_percent") or 1.0
    return [_error(r, "kg_error_percent") / reference - 1 for r in others if r is not None]


def _deltas_against_vertices(results: PaperResults) -> Finding | None:
    texts, gains = [], []
    for label in ("pca-qp", f"pca-qp ({CHOICE_NAMES[COEFFICIENTS]})", "pca-q", "blocks"):
        overlaps = [results.at_equal_rate(figure, label, "v2v") for figure, _ in FIGURES]
        if label == "pca-qp":
            gains = [overlap.error_ratio < 1 for overlap in overlaps if overlap is not None]
        if any(overlap is not None for overlap in overlaps):
            texts.append(f"`{label}` {_ratios_text(results, label, 'v2v')}")
    if not texts:
        return None
    return Finding(
        "Deltas on eigen-trajectories beat vertices (v2v) at equal rate, by every measure",
        all(gains) if gains else None,
        f"Errors relative to `v2v` (below 1 is better): {'; '.join(texts)}. The verdict refers to "
        "`pca-qp`.",
        _ratios_figure(results, "pca-qp", "v2v"),
    )


def _quantized_deltas(results: PaperResults) -> Finding | None:
    projected = results.variant("pca-q")
    first = results.variant(f"pca-q ({CHOICE_NAMES[QUANTIZED_DELTAS]})")
    if projected is None or first is None:
        return None
    texts = [
        f"q {result['rates']['stored']['q']:.4f}, KG {_error(result, 'kg_error_percent'):.3g} %, "
        f"STED {_error(result, 'sted'):.3g}"
        for result in (projected, first)
    ]
    figures = ("kg_error_percent", "sted")
    is_smaller = first["rates"]["stored"]["q"] < projected["rates"]["stored"]["q"]
    is_better = all(_error(first, key) <= _error(projected, key) for key in figures)
    return Finding(
        "Variant (ii) read as the projection of quantized deltas is better than Eq. 10",
        is_smaller and is_better,
        f"Quantized after the projection (Eq. 10): {texts[0]}. Deltas of all frames quantized "
        f"with as many bits, then projected: {texts[1]}.",
        f"q {projected['rates']['stored']['q']:.2f} to {first['rates']['stored']['q']:.2f}, KG "
        f"{_error(projected, 'kg_error_percent'):.3g} to {_error(first, 'kg_error_percent'):.3g} %",
    )


def _lowest_error(results: PaperResults) -> Finding | None:
    finished = sorted(done(results.variants), key=lambda result: _error(result, "nmsve_mean"))
    labels = [label_of_result(result) for result in finished]
    if len(finished) < 2 or not {"pca-qs", "pca-qp"} & set(labels):
        return None
    listed = ", ".join(
        f"`{label}` {_error(result, 'nmsve_mean'):.2e} at {result['rate_order_dropped_bpvf']:.2g}"
        for label, result in zip(labels, finished, strict=True)
    )
    return Finding(
        "PCA+qs and PCA+qp have the lowest NMSVE at the settings of the tables",
        labels[0] in ("pca-qs", "pca-qp"),
        f"Mean NMSVE at bpvf, the lowest first: {listed}.",
        labels[0],
    )


def _similar_pattern(results: PaperResults) -> Finding | None:
    curves = {
        label_of_result(result): np.array(result["quality"]["nmsve"], float)
        for result in done(results.variants)
        if method_of_result(result) not in ("gft", "pca-qs")
    }
    varying = {label: curve for label, curve in curves.items() if np.ptp(curve) > 0}
    if len(varying) < 2:
        return None
    correlations = [_correlation(*pair) for pair in combinations(varying.values(), 2)]
    low, high = min(correlations), max(correlations)
    return Finding(
        "NMSVE per frame follows a similar pattern in all temporal methods",
        low >= MIN_SIMILAR_CORRELATION,
        f"Correlations of pairs: {low:.2f} to {high:.2f}, mean {np.mean(correlations):.2f} "
        f"(similar: at least {MIN_SIMILAR_CORRELATION:g}).",
        f"{low:.2f} to {high:.2f}",
    )


def _rows_enough(results: PaperResults) -> Finding | None:
    rows = {result["identity"]["setting"]["n_modes"]: result for result in done(results.rows)}
    if 20 not in rows or 30 not in rows:
        return None
    listed = ", ".join(
        f"{n_modes}: {_error(result, 'kg_error_percent'):.3g} % and {_error(result, 'sted'):.3g}"
        for n_modes, result in sorted(rows.items())
    )
    gain = 1 - _error(rows[30], "sted") / (_error(rows[20], "sted") or 1.0)
    return Finding(
        "More than 20 rows improve little",
        gain < SMALL_GAIN,
        f"STED changes by {-100 * gain:+.1f} % from 20 to 30 rows (little: a fall of less than "
        f"{100 * SMALL_GAIN:.0f} %). KG and STED by k_l, 8 bits: {listed}.",
        f"STED {-100 * gain:+.0f} % from 20 to 30",
    )


def _serial_equals_parallel(results: PaperResults) -> Finding | None:
    serial, parallel = results.variant("pca-qs"), results.variant("pca-qp")
    if serial is None or parallel is None:
        return None
    differences = _relative_differences(serial, parallel, FIGURES)
    return Finding(
        "PCA+qs and PCA+qp have equal quality",
        max(differences.values()) <= MAX_EQUAL_DIFFERENCE,
        f"Relative differences: {_listed(differences)} (equal: up to {MAX_EQUAL_DIFFERENCE:g}).",
        f"differ by {max(differences.values()):.1g}",
    )


def _serial_artifacts(results: PaperResults) -> Finding | None:
    serial, parallel = results.variant("pca-qs"), results.variant("pca-qp")
    if serial is None or parallel is None:
        return None
    key = "sted_temporal"
    (difference,) = _relative_differences(serial, parallel, ((key, key),)).values()
    return Finding(
        "PCA+qs has temporal artifacts that PCA+qp does not have",
        _error(serial, key) > (1 + MAX_EQUAL_DIFFERENCE) * _error(parallel, key),
        f"The temporal part of STED is {_error(serial, key):.4g} and {_error(parallel, key):.4g}, "
        f"a relative difference of {difference:.1g}: the same stream, solved frame by frame, "
        "gives the same frames.",
        f"T differs by {difference:.1g}",
    )


def _serial_seconds(results: PaperResults) -> Finding | None:
    serial, parallel = results.variant("pca-qs"), results.variant("pca-qp")
    if serial is None or parallel is None:
        return None
    slow, fast = (result["seconds"]["decode_processor"] for result in (serial, parallel))
    return Finding(
        "PCA+qs is much slower to reconstruct than PCA+qp",
        slow > 2 * fast,
        f"{slow:.3g} s of processor time against {fast:.3g} s, {slow / fast:.3g} times.",
        f"{slow / fast:.0f} times",
    )


def _blocks_encode_seconds(results: PaperResults) -> Finding | None:
    return _blocks_seconds(results, "encode", "encode")


def _blocks_decode_seconds(results: PaperResults) -> Finding | None:
    return _blocks_seconds(results, "decode", "reconstruct")


def _blocks_seconds(results: PaperResults, phase: str, verb: str) -> Finding | None:
    blocks, whole = results.variant("blocks"), results.variant("pca-qp")
    if blocks is None or whole is None:
        return None
    seconds, other = (result["seconds"][f"{phase}_processor"] for result in (blocks, whole))
    n_frames = results.sequence["n_frames"]
    return _faster(seconds, other, f"Blocks are faster to {verb} than PCA+qp", n_frames)


def _blocks_long_encode_seconds(results: PaperResults) -> Finding | None:
    return _blocks_long_seconds(results, "encode", "encode")


def _blocks_long_decode_seconds(results: PaperResults) -> Finding | None:
    return _blocks_long_seconds(results, "decode", "reconstruct")


def _blocks_long_seconds(results: PaperResults, phase: str, verb: str) -> Finding | None:
    result = results.claims.get("long sequence")
    if result is None or "refused" in result:
        return None
    seconds, other = (result[name][f"{phase}_processor"] for name in ("blocks", "pca-qp"))
    claim = f"Blocks are faster to {verb} than PCA+qp beyond 1,000 frames"
    return _faster(seconds, other, claim, result["n_frames"])


def _faster(seconds: float, other: float, claim: str, n_frames: int) -> Finding:
    return Finding(
        claim,
        seconds < other,
        f"{n_frames} frames: {seconds:.3g} s of processor time against {other:.3g} s, "
        f"{seconds / other:.2f} times.",
        f"{seconds / other:.2f} times",
    )


def _blocks_quality(results: PaperResults) -> Finding | None:
    blocks, whole = results.variant("blocks"), results.variant("pca-qp")
    if blocks is None or whole is None:
        return None
    errors = [_error(result, "kg_error_percent") for result in (blocks, whole)]
    rates = [result["rate_order_dropped_bpvf"] for result in (blocks, whole)]
    overlap = results.at_equal_rate("kg_error_percent", "blocks", "pca-qp")
    is_inferior = errors[0] > errors[1] if overlap is None else overlap.error_ratio > 1
    return Finding(
        "Blocks are inferior to PCA+qp in quality, by KG",
        is_inferior,
        f"At the settings of the tables: {errors[0]:.3g} % at {rates[0]:.3g} bpvf against "
        f"{errors[1]:.3g} % at {rates[1]:.3g}. At equal rate, errors relative to `pca-qp`: "
        f"{_ratios_text(results, 'blocks', 'pca-qp')}.",
        _ratios_figure(results, "blocks", "pca-qp"),
    )


def _differences(results: PaperResults) -> Finding | None:
    bits = results.claims.get("dictionaries")
    if bits is None or "refused" in bits or bits["kept_whole"] is None:
        return None
    return Finding(
        "Differences U[i+1] - U[i] need fewer bits than dictionaries",
        bits["kept_difference_plain"] < bits["kept_whole_plain"],
        f"Coded entry by entry, {bits['kept_difference_plain']:.1f} bits against "
        f"{bits['kept_whole_plain']:.1f} with the columns in the stream, "
        f"{bits['all_difference_plain']:.1f} against {bits['all_whole_plain']:.1f} with all. "
        f"Coded as curves over time, as in streams, {bits['kept_difference']:.1f} "
        f"against {bits['kept_whole']:.1f} and {bits['all_difference']:.1f} against "
        f"{bits['all_whole']:.1f}. The paper's q_d implies {PRINTED_DICTIONARY_BITS[0]} to "
        f"{PRINTED_DICTIONARY_BITS[1]}.",
        f"{bits['kept_whole_plain']:.1f} to {bits['kept_difference_plain']:.1f} bits (as curves "
        f"{bits['kept_whole']:.1f} to {bits['kept_difference']:.1f})",
    )


def _quiet_blocks(results: PaperResults) -> Finding | None:
    result = results.claims.get("quiet blocks")
    if result is None or "refused" in result or len(result["bits"]) < 3:
        return None
    motion, bits = np.array(result["motion_percent"]), np.array(result["bits"])
    order = np.argsort(motion, kind="stable")
    third = max(1, len(order) // 3)
    quiet, fast = (float(bits[part].mean()) for part in (order[:third], order[-third:]))
    return Finding(
        "Blocks with little motion need fewer bits for the same error",
        quiet < FEWER_BITS_RATIO * fast,
        f"The third of the blocks with the least motion (RMS {motion[order[:third]].mean():.2g} % "
        f"of the diagonal per frame) takes {quiet:.3g} bits per vertex and frame of a coordinate, "
        f"the third with the most motion ({motion[order[-third:]].mean():.2g} %) {fast:.3g}. "
        f"Rank correlation of motion and bits: {_rank_correlation(motion, bits):.2f}.",
        f"{quiet:.2f} against {fast:.2f} bits",
    )


def _steadiness(results: PaperResults) -> Finding | None:
    graph, temporal = results.variant("gft"), results.variant("pca-qp")
    if graph is None or temporal is None:
        return None
    spread, spread_other = (
        float(np.std(errors) / np.mean(errors))
        for errors in (np.array(result["quality"]["nmsve"], float) for result in (graph, temporal))
    )
    return Finding(
        "Per mesh has nearly the same NMSVE in every frame",
        spread < 0.1,
        f"Its standard deviation over the frames is {100 * spread:.1f} % of the mean (nearly the "
        f"same: below 10 %), that of `pca-qp` {100 * spread_other:.1f} %.",
        f"deviates by {100 * spread:.0f} %",
    )


def _per_mesh_size(results: PaperResults) -> Finding | None:
    full = results.full_decomposition
    if full is None or "refused" in full:
        return None
    basis = extrapolated_basis(full, PER_MESH_VERTICES, results.sequence["n_frames"])
    is_judged = full["n_verts"] >= MIN_EXTRAPOLATED_VERTS
    return Finding(
        f"Per mesh is infeasible beyond {PER_MESH_VERTICES:,} vertices",
        basis.seconds > MAX_FEASIBLE_S if is_judged else None,
        f"{basis.text} All frequencies are counted; infeasible: more than "
        f"{duration_text(MAX_FEASIBLE_S)}. L is the same in all frames, so that one decomposition "
        "is enough."
        + ("" if is_judged else f" A verdict needs {MIN_EXTRAPOLATED_VERTS:,} measured vertices."),
        f"{duration_text(basis.seconds)}, extrapolated; {duration_text(basis.seconds_each)} with "
        "one decomposition",
    )


def _ratios_text(results: PaperResults, label: str, other: str) -> str:
    """Error ratios of each metric with their range of rates, as text."""
    texts: list[str] = []
    for figure, name in FIGURES:
        overlap = results.at_equal_rate(figure, label, other)
        if overlap is None:
            texts.append(f"{name} has no rates in common")
            continue
        rates = f"{overlap.low_bpvf:.2g} to {overlap.high_bpvf:.2g} bpvf"
        texts.append(f"{name} {overlap.error_ratio:.2f} ({rates})")
    if all("no rates" in text for text in texts):
        return "no rates in common, not compared"
    return ", ".join(texts)


def _ratios_figure(results: PaperResults, label: str, other: str) -> str:
    """Error ratios at equal rate, for a table: "KG 0.71, STED 0.34"; empty without common rates."""
    overlaps = [(name, results.at_equal_rate(figure, label, other)) for figure, name in FIGURES]
    return ", ".join(
        f"{name} {overlap.error_ratio:.2f}" for name, overlap in overlaps if overlap is not None
    )


def _relative_differences(
    first: Result, second: Result, figures: Sequence[tuple[str, str]]
) -> dict[str, float]:
    return {
        name: abs(_error(first, key) - _error(second, key)) / (_error(second, key) or 1.0)
        for key, name in figures
    }


def _listed(differences: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.1g}" for name, value in differences.items())


def _rank_correlation(first: np.ndarray, second: np.ndarray) -> float:
    """Spearman's rank correlation."""
    ranks = [np.argsort(np.argsort(values, kind="stable")) for values in (first, second)]
    return _correlation(*ranks)


def _correlation(first: np.ndarray, second: np.ndarray) -> float:
    return float(np.corrcoef(np.stack([first, second]))[0, 1])


def _error(result: Result, key: str) -> float:
    value = result["quality"][key]
    return float("inf") if value is None else float(value)
