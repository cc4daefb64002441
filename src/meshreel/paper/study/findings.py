"""The paper's claims, each judged by the results of a sequence."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from meshreel.evaluation.runs.store import Result, done
from meshreel.paper.study.results import PaperResults, label_of_result, method_of_result
from meshreel.paper.sweeps import (
    COEFFICIENTS,
    FINE_ANCHORS,
    LOW_FREQUENCIES,
    QUANTIZED_DELTAS,
    RANDOM_ANCHORS,
    RANDOM_COEFFICIENTS,
    WORDS,
)

FIGURES = (("kg_error_percent", "KG"), ("sted", "STED"), ("nmsve_mean", "NMSVE"))
"""Errors that are compared, and their names."""

EQUAL_WITHIN = 0.001
"""Relative difference of errors up to which two variants count as of equal quality."""

SMALL_GAIN = 0.1
"""Share by which STED may fall while more rows count as showing little."""

FEW_BITS = 0.9
"""Share of the bits of others below which something needs fewer bits."""

SMALL_EFFECT = 0.05
"""Share by which the errors of random anchors may differ while they hardly matter."""

SIMILAR = 0.5
"""Least correlation of errors per frame that follow a similar pattern."""

PER_MESH_VERTICES = 20000
"""Vertices beyond which the paper finds the per-mesh solve out of reach."""

PRINTED_DICTIONARY_BITS = (8.5, 10.6)
"""Bits of an entry that the printed q_d of `blocks` imply, for Samba and for Handstand."""


@dataclass(frozen=True)
class Finding:
    """A claim of the paper and what the results of a sequence say about it.

    Attributes
    ----------
    holds : bool or None
        None where the results cannot judge it, or there is nothing to judge.
    evidence : str
        The figures, in a sentence or two.
    figure : str
        The figure that decides, for a table.
    """

    claim: str
    holds: bool | None
    evidence: str
    figure: str = ""

    @property
    def verdict(self) -> str:
        """The judgment in words."""
        return {True: "holds", False: "does not hold", None: "not judged"}[self.holds]

    @property
    def text(self) -> str:
        """Claim, verdict and evidence as Markdown."""
        return f"**{self.claim}: {self.verdict}.** {self.evidence}"


def findings(results: PaperResults) -> list[Finding]:
    """Judge each claim of the paper that the results of a sequence can judge."""
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
    coefficients = results.variant(f"{method} ({WORDS[COEFFICIENTS]})")
    if positions is None or coefficients is None:
        return None
    errors = [_error(one, "kg_error_percent") for one in (positions, coefficients)]
    rates = [one["rate_order_dropped_bpvf"] for one in (positions, coefficients)]
    overlap = results.at_equal_rate("kg_error_percent", method, label_of_result(coefficients))
    ratio = errors[0] / (errors[1] or 1.0) if overlap is None else overlap.error_ratio
    where = "at the settings of the tables" if overlap is None else "at equal rate"
    return Finding(
        f"Positions of anchors in all frames (Eq. 12) beat their coefficients, {name}",
        ratio < 1,
        f"KG {errors[0]:.3g} % at {rates[0]:.3g} bpvf with positions, {errors[1]:.3g} % at "
        f"{rates[1]:.3g} with coefficients; {ratio:.2f} times the error {where}.",
        f"KG {ratio:.2f} times",
    )


def _anchor_bits(results: PaperResults) -> Finding | None:
    usual, fine = results.variant("pca-qp"), results.variant(f"pca-qp ({WORDS[FINE_ANCHORS]})")
    if usual is None or fine is None:
        return None
    errors = [_error(one, "kg_error_percent") for one in (fine, usual)]
    rates = [one["paper_count"]["q_a"] for one in (fine, usual)]
    printed = usual["paper_count"]["q_a_printed"]
    return Finding(
        "Anchors need 16 bits for each position",
        errors[1] > 1.02 * errors[0],
        f"At 16 bits KG is {errors[0]:.3g} % and the stream carries q_a = {rates[0]:.4f} "
        f"(16 n_c / n is {printed:.4f}); at 4 bits more than the deltas have, {errors[1]:.3g} % "
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
    more = anchored["rate_order_dropped_bpvf"] - without["rate_order_dropped_bpvf"]
    if all(after == before for _, before, after in pairs):
        return Finding(claim, None, "1 % of the vertices are no more than one for each component.")
    return Finding(
        claim,
        all(after < before for _, before, after in pairs),
        f"From `pca-q` to `pca-qp`: {listed}, for {more:.3g} bpvf more.",
        f"KG {pairs[0][1]:.3g} to {pairs[0][2]:.3g} %",
    )


def _few_anchors(results: PaperResults) -> Finding | None:
    few, usual = results.variant("pca-qp (0.5 %)"), results.variant("pca-qp")
    if few is None or usual is None:
        return None
    errors = [_error(one, "kg_error_percent") for one in (usual, few)]
    return Finding(
        "1 % of the vertices as anchors serve better than 0.5 %",
        errors[0] < errors[1],
        f"0.5 % instead of 1 %: KG {errors[1]:.3g} % instead of {errors[0]:.3g} %, STED "
        f"{_error(few, 'sted'):.3g} instead of {_error(usual, 'sted'):.3g}, "
        f"{few['rate_order_dropped_bpvf']:.3g} bpvf instead of "
        f"{usual['rate_order_dropped_bpvf']:.3g}.",
        f"KG {errors[0]:.3g} against {errors[1]:.3g} %",
    )


def _anchor_choice(results: PaperResults) -> Finding | None:
    sets = (("pca-qp", RANDOM_ANCHORS), (f"pca-qp ({WORDS[COEFFICIENTS]})", RANDOM_COEFFICIENTS))
    positions, coefficients = (_random_changes(results, *one) for one in sets)
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
    usual = results.variant(label)
    others = [results.variant(f"pca-qp ({WORDS[choices]})") for choices in random_choices]
    if usual is None:
        return []
    reference = _error(usual, "kg_error_percent") or 1.0
    return [_error(one, "kg_error_percent") / reference - 1 for one in others if one is not None]


def _deltas_against_vertices(results: PaperResults) -> Finding | None:
    judged, gains = [], []
    for label in ("pca-qp", f"pca-qp ({WORDS[COEFFICIENTS]})", "pca-q", "blocks"):
        overlaps = [results.at_equal_rate(figure, label, "v2v") for figure, _ in FIGURES]
        if label == "pca-qp":
            gains = [one.error_ratio < 1 for one in overlaps if one is not None]
        if any(overlap is not None for overlap in overlaps):
            judged.append(f"`{label}` {_ratios_text(results, label, 'v2v')}")
    if not judged:
        return None
    return Finding(
        "Deltas on eigen-trajectories beat vertices (v2v) at equal rate, by every measure",
        all(gains) if gains else None,
        f"Errors over those of `v2v` (below 1 is better): {'; '.join(judged)}. The verdict is on "
        "`pca-qp`.",
        _ratios_figure(results, "pca-qp", "v2v"),
    )


def _quantized_deltas(results: PaperResults) -> Finding | None:
    projected = results.variant("pca-q")
    first = results.variant(f"pca-q ({WORDS[QUANTIZED_DELTAS]})")
    if projected is None or first is None:
        return None
    texts = [
        f"q {one['paper_count']['q']:.4f}, KG {_error(one, 'kg_error_percent'):.3g} %, STED "
        f"{_error(one, 'sted'):.3g}"
        for one in (projected, first)
    ]
    figures = ("kg_error_percent", "sted")
    is_smaller = first["paper_count"]["q"] < projected["paper_count"]["q"]
    is_better = all(_error(first, key) <= _error(projected, key) for key in figures)
    return Finding(
        "Variant (ii) read as the projection of quantized deltas serves better than Eq. 10",
        is_smaller and is_better,
        f"Quantized after the projection (Eq. 10): {texts[0]}. Deltas of all frames quantized "
        f"with as many bits, then projected: {texts[1]}.",
        f"q {projected['paper_count']['q']:.2f} to {first['paper_count']['q']:.2f}, KG "
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
    found = [_correlation(*pair) for pair in combinations(varying.values(), 2)]
    return Finding(
        "NMSVE per frame follows a similar pattern in all temporal methods",
        min(found) >= SIMILAR,
        f"Correlations of pairs: {min(found):.2f} to {max(found):.2f}, mean {np.mean(found):.2f} "
        f"(similar: at least {SIMILAR:g}).",
        f"{min(found):.2f} to {max(found):.2f}",
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
        "More than 20 rows show little more",
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
        "PCA+qs and PCA+qp are of equal quality",
        max(differences.values()) <= EQUAL_WITHIN,
        f"Relative differences: {_listed(differences)} (equal: up to {EQUAL_WITHIN:g}).",
        f"differ by {max(differences.values()):.1g}",
    )


def _serial_artifacts(results: PaperResults) -> Finding | None:
    serial, parallel = results.variant("pca-qs"), results.variant("pca-qp")
    if serial is None or parallel is None:
        return None
    key = "sted_temporal"
    (difference,) = _relative_differences(serial, parallel, ((key, key),)).values()
    return Finding(
        "PCA+qs has temporal artifacts that PCA+qp has not",
        _error(serial, key) > (1 + EQUAL_WITHIN) * _error(parallel, key),
        f"The temporal part of STED is {_error(serial, key):.4g} and {_error(parallel, key):.4g}, "
        f"a relative difference of {difference:.1g}: the same stream, solved frame by frame, "
        "gives the same frames.",
        f"T differs by {difference:.1g}",
    )


def _serial_seconds(results: PaperResults) -> Finding | None:
    serial, parallel = results.variant("pca-qs"), results.variant("pca-qp")
    if serial is None or parallel is None:
        return None
    slow, fast = (one["seconds"]["decode_processor"] for one in (serial, parallel))
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
    mine, other = (one["seconds"][f"{phase}_processor"] for one in (blocks, whole))
    n_frames = results.sequence["n_frames"]
    return _faster(mine, other, f"Blocks are faster to {verb} than PCA+qp", n_frames)


def _blocks_long_encode_seconds(results: PaperResults) -> Finding | None:
    return _blocks_long_seconds(results, "encode", "encode")


def _blocks_long_decode_seconds(results: PaperResults) -> Finding | None:
    return _blocks_long_seconds(results, "decode", "reconstruct")


def _blocks_long_seconds(results: PaperResults, phase: str, verb: str) -> Finding | None:
    found = results.claims.get("long sequence")
    if found is None or "refused" in found:
        return None
    mine, other = (found[name][f"{phase}_processor"] for name in ("blocks", "pca-qp"))
    claim = f"Blocks are faster to {verb} than PCA+qp beyond 1,000 frames"
    return _faster(mine, other, claim, found["n_frames"])


def _faster(mine: float, other: float, claim: str, n_frames: int) -> Finding:
    return Finding(
        claim,
        mine < other,
        f"{n_frames} frames: {mine:.3g} s of processor time against {other:.3g} s, "
        f"{mine / other:.2f} times.",
        f"{mine / other:.2f} times",
    )


def _blocks_quality(results: PaperResults) -> Finding | None:
    blocks, whole = results.variant("blocks"), results.variant("pca-qp")
    if blocks is None or whole is None:
        return None
    errors = [_error(result, "kg_error_percent") for result in (blocks, whole)]
    rates = [result["rate_order_dropped_bpvf"] for result in (blocks, whole)]
    overlap = results.at_equal_rate("kg_error_percent", "blocks", "pca-qp")
    inferior = errors[0] > errors[1] if overlap is None else overlap.error_ratio > 1
    return Finding(
        "Blocks are inferior to PCA+qp in quality, by KG",
        inferior,
        f"At the settings of the tables: {errors[0]:.3g} % at {rates[0]:.3g} bpvf against "
        f"{errors[1]:.3g} % at {rates[1]:.3g}. At equal rate, errors over those of `pca-qp`: "
        f"{_ratios_text(results, 'blocks', 'pca-qp')}.",
        _ratios_figure(results, "blocks", "pca-qp"),
    )


def _differences(results: PaperResults) -> Finding | None:
    found = results.claims.get("dictionaries")
    if found is None or "refused" in found or found["kept_whole"] is None:
        return None
    return Finding(
        "Differences U[i+1] - U[i] need fewer bits than dictionaries",
        found["kept_difference_plain"] < found["kept_whole_plain"],
        f"Coded entry by entry, {found['kept_difference_plain']:.1f} bits against "
        f"{found['kept_whole_plain']:.1f} with the columns that are kept, "
        f"{found['all_difference_plain']:.1f} against {found['all_whole_plain']:.1f} with all. "
        f"Streams code columns as curves over time, which leaves {found['kept_difference']:.1f} "
        f"against {found['kept_whole']:.1f} and {found['all_difference']:.1f} against "
        f"{found['all_whole']:.1f}. The paper's q_d implies {PRINTED_DICTIONARY_BITS[0]} to "
        f"{PRINTED_DICTIONARY_BITS[1]}.",
        f"{found['kept_whole_plain']:.1f} to {found['kept_difference_plain']:.1f} bits (as curves "
        f"{found['kept_whole']:.1f} to {found['kept_difference']:.1f})",
    )


def _quiet_blocks(results: PaperResults) -> Finding | None:
    found = results.claims.get("quiet blocks")
    if found is None or "refused" in found or len(found["bits"]) < 3:
        return None
    motion, bits = np.array(found["motion_percent"]), np.array(found["bits"])
    order = np.argsort(motion, kind="stable")
    third = max(1, len(order) // 3)
    quiet, fast = (float(bits[part].mean()) for part in (order[:third], order[-third:]))
    return Finding(
        "Blocks with little motion need fewer bits for the same error",
        quiet < FEW_BITS * fast,
        f"The third of the blocks that moves least (RMS {motion[order[:third]].mean():.2g} % of "
        f"the diagonal a frame) takes {quiet:.3g} bits a vertex and frame of a coordinate, the "
        f"third that moves most ({motion[order[-third:]].mean():.2g} %) {fast:.3g}. "
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
        f"Over the frames it deviates by {100 * spread:.1f} % of its mean (nearly the same: below "
        f"10 %), that of `pca-qp` by {100 * spread_other:.1f} %.",
        f"deviates by {100 * spread:.0f} %",
    )


def _per_mesh_size(results: PaperResults) -> Finding | None:
    graph, found = results.variant("gft"), results.decompositions
    if graph is None or found is None or "refused" in found:
        return None
    n_verts, n_frames = results.sequence["n_verts"], results.sequence["n_frames"]
    total = n_frames * found["seconds_each"]
    share = found["n_modes"] / n_verts
    return Finding(
        f"Per mesh is out of reach beyond {PER_MESH_VERTICES:,} vertices",
        None if n_verts <= PER_MESH_VERTICES else False,
        f"{n_verts:,} vertices: the lowest {100 * share:.0f} % of the frequencies take "
        f"{found['seconds_each']:.3g} s for one decomposition, {total:.3g} s with one for each "
        "frame as in the paper. "
        + (
            "A larger mesh is needed to judge the claim."
            if n_verts <= PER_MESH_VERTICES
            else f"A sparse solver finds {100 * LOW_FREQUENCIES[0]:.0f} % or more of them."
        ),
        f"{found['seconds_each']:.2g} s for {found['n_modes']} frequencies",
    )


def _ratios_text(results: PaperResults, label: str, other: str) -> str:
    """Error ratios with the rates they are over, by figure; says where no rate is common."""
    found: list[str] = []
    for figure, name in FIGURES:
        overlap = results.at_equal_rate(figure, label, other)
        if overlap is None:
            found.append(f"{name} has no rates in common")
            continue
        rates = f"{overlap.low_bpvf:.2g} to {overlap.high_bpvf:.2g} bpvf"
        found.append(f"{name} {overlap.error_ratio:.2f} ({rates})")
    if all("no rates" in text for text in found):
        return "no rates in common, not compared"
    return ", ".join(found)


def _ratios_figure(results: PaperResults, label: str, other: str) -> str:
    """Error ratios at equal rate, for a table: "KG 0.71, STED 0.34"; empty without common rates."""
    overlaps = [(name, results.at_equal_rate(figure, label, other)) for figure, name in FIGURES]
    return ", ".join(f"{name} {one.error_ratio:.2f}" for name, one in overlaps if one is not None)


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
    """Spearman's: the correlation of ranks."""
    ranks = [np.argsort(np.argsort(values, kind="stable")) for values in (first, second)]
    return _correlation(*ranks)


def _correlation(first: np.ndarray, second: np.ndarray) -> float:
    return float(np.corrcoef(np.stack([first, second]))[0, 1])


def _error(result: Result, key: str) -> float:
    value = result["quality"][key]
    return float("inf") if value is None else float(value)
