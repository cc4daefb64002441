"""The paper's claims as a table: measure, thresholds, and verdicts from a sequence's results."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations

import numpy as np

from meshreel.evaluation.rate_distortion import Overlap
from meshreel.evaluation.runs.store import Result, done
from meshreel.paper.study.results import (
    ENTROPY_RATE,
    RATE,
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

FIGURES = {"kg_error_percent": "KG", "sted": "STED", "nmsve_mean": "NMSVE"}
"""Names of the compared errors."""

PER_MESH_VERTICES = 20000
"""Vertices beyond which the paper considers the per-mesh solve infeasible."""

RATIO = 0.9, 0.98
"""Thresholds of all ratios: at most the first is better, below the second slightly better."""

DAY_S = 24 * 3600.0

MIN_EXTRAPOLATED_VERTS = 2000
"""Fewest vertices from which the time of larger meshes is extrapolated."""

PRINTED_DICTIONARY_BITS = (8.5, 10.6)
"""Bits per entry implied by the printed q_d of `blocks`, for Samba and for Handstand."""


@dataclass(frozen=True)
class Evidence:
    """What the results of a sequence say about a claim.

    Attributes
    ----------
    value : float or None
        The claim's measure; None if the results do not allow a verdict.
    text : str
        The measured values, in a sentence or two.
    figure : str
        The deciding values, for a table.
    """

    value: float | None
    text: str
    figure: str


@dataclass(frozen=True)
class Claim:
    """A claim of the paper, or one of ours on what it leaves open, with its thresholds.

    Attributes
    ----------
    text : str
    measure : str
        The number that decides, in words.
    yes, weakly : float
        The verdict is "yes" if the measure is at most `yes`, "weakly" if it is below `weakly`, else
        "no". If `yes` exceeds `weakly`: at least `yes`, above `weakly`.
    evidence : callable
        Returns the evidence of a sequence's results; None if they do not contain it.
    """

    text: str
    measure: str
    yes: float
    weakly: float
    evidence: Callable[[PaperResults], Evidence | None]

    @property
    def threshold(self) -> str:
        """The thresholds as text."""
        if self.yes <= self.weakly:
            return f"yes: up to {self.yes:g}; weakly: below {self.weakly:g}"
        return f"yes: {self.yes:g} or more; weakly: above {self.weakly:g}"

    def verdict(self, value: float | None) -> str:
        """Return "yes", "weakly", "no", or "not judged" without a value."""
        if value is None or not np.isfinite(value):
            return "not judged"
        sign = 1 if self.yes <= self.weakly else -1
        if sign * value <= sign * self.yes:
            return "yes"
        return "weakly" if sign * value < sign * self.weakly else "no"


@dataclass(frozen=True)
class Finding:
    """A claim judged by the results of a sequence.

    Attributes
    ----------
    verdict : str
        "yes", "weakly", "no" or "not judged".
    """

    claim: str
    measure: str
    threshold: str
    value: float | None
    verdict: str
    evidence: str
    figure: str

    @property
    def text(self) -> str:
        """Claim, verdict, evidence and thresholds as Markdown."""
        return (
            f"**{self.claim}: {self.verdict}.** {self.evidence} (Measure: {self.measure}; "
            f"{self.threshold}.)"
        )


def findings(results: PaperResults) -> list[Finding]:
    """Return a finding for each claim that the results of a sequence cover."""
    return [
        Finding(
            claim.text,
            claim.measure,
            claim.threshold,
            evidence.value,
            claim.verdict(evidence.value),
            evidence.text,
            evidence.figure,
        )
        for claim in CLAIMS
        if (evidence := claim.evidence(results)) is not None
    ]


def _error(result: Result, key: str) -> float:
    value = result["quality"][key]
    return float("inf") if value is None else float(value)


def _rate(result: Result) -> float:
    return float(result[RATE])


def _pair(results: PaperResults, first: str, second: str) -> tuple[Result, Result] | None:
    """The results of two labels; None unless both exist."""
    found = results.variant(first), results.variant(second)
    return None if found[0] is None or found[1] is None else (found[0], found[1])


def _at_equal_rate(
    results: PaperResults, first: str, second: str, *, rate: str = RATE
) -> Evidence | None:
    """The errors of a variant relative to another at equal rate; the largest ratio decides."""
    overlaps: dict[str, Overlap] = {}
    for key, name in FIGURES.items():
        overlap = results.at_equal_rate(key, first, second, rate)
        if overlap is not None:
            overlaps[name] = overlap
    if not overlaps:
        return None
    listed = ", ".join(
        f"{name} {overlap.error_ratio:.2f} ({overlap.low_bpvf:.2g} to {overlap.high_bpvf:.2g} bpvf)"
        for name, overlap in overlaps.items()
    )
    figure = ", ".join(f"{name} {overlap.error_ratio:.2f}" for name, overlap in overlaps.items())
    ratio = max(overlap.error_ratio for overlap in overlaps.values())
    return Evidence(ratio, f"Errors of `{first}` relative to `{second}`: {listed}.", figure)


def _kg_at_equal_rate(results: PaperResults, first: str, second: str) -> Evidence | None:
    """The KG error of a variant relative to another at equal rate."""
    overlap = results.at_equal_rate("kg_error_percent", first, second)
    if overlap is None:
        return None
    text = f"`{first}` has {overlap.error_ratio:.2f} times the KG error of `{second}`"
    if pair := _pair(results, first, second):
        errors = [f"{_error(one, 'kg_error_percent'):.3g} % at {_rate(one):.3g}" for one in pair]
        text += f"; at the settings of the tables, {errors[0]} bpvf against {errors[1]}"
    return Evidence(overlap.error_ratio, f"{text}.", f"KG {overlap.error_ratio:.2f}")


def _lower_errors(results: PaperResults, first: str, second: str) -> Evidence | None:
    """All errors of a variant over those of another at the settings of the tables."""
    pair = _pair(results, first, second)
    if pair is None:
        return None
    values = {name: [_error(one, key) for one in pair] for key, name in FIGURES.items()}
    listed = ", ".join(
        f"{name} {low:.3g} against {high:.3g}" for name, (low, high) in values.items()
    )
    ratio = max(low / (high or 1.0) for low, high in values.values())
    low, high = values["KG"]
    return Evidence(
        None if all(low == high for low, high in values.values()) else ratio,
        f"`{first}` against `{second}`: {listed}, at {_rate(pair[0]):.3g} and "
        f"{_rate(pair[1]):.3g} bpvf.",
        f"KG {low:.3g} against {high:.3g} %",
    )


def _anchor_bits(results: PaperResults) -> Evidence | None:
    pair = _pair(results, "pca-qp", f"pca-qp ({CHOICE_NAMES[FINE_ANCHORS]})")
    if pair is None:
        return None
    errors = [_error(result, "kg_error_percent") for result in pair]
    default, fine = (result["rates"]["stored"]["q_a"] for result in pair)
    increase = 100 * (errors[0] / (errors[1] or 1.0) - 1)
    return Evidence(
        increase,
        f"With 16 bits KG is {errors[1]:.3g} % and q_a in the stream {fine:.4f}; with 4 bits more "
        f"than the deltas, {errors[0]:.3g} % and {default:.4f}.",
        f"KG {increase:+.1f} %, q_a {fine:.3f} to {default:.3f}",
    )


def _anchor_choice(results: PaperResults) -> Evidence | None:
    changes = _random_changes(results, "pca-qp", RANDOM_ANCHORS)
    if not changes:
        return None
    coefficients = f"pca-qp ({CHOICE_NAMES[COEFFICIENTS]})"
    others = _random_changes(results, coefficients, RANDOM_COEFFICIENTS)
    listed, of_coefficients = (
        ", ".join(f"{change:+.1f} %" for change in found) for found in (changes, others)
    )
    return Evidence(
        max(map(abs, changes)),
        f"KG with random anchors against farthest points, by seed: {listed}."
        + (f" With coefficients instead of positions: {of_coefficients}." if others else ""),
        f"KG {listed}",
    )


def _random_changes(results: PaperResults, label: str, choices: Sequence[str]) -> list[float]:
    """Change of the KG error with random anchors in percent, by seed."""
    default = results.variant(label)
    others = [results.variant(f"pca-qp ({CHOICE_NAMES[text]})") for text in choices]
    if default is None:
        return []
    reference = _error(default, "kg_error_percent") or 1.0
    return [
        100 * (_error(other, "kg_error_percent") / reference - 1)
        for other in others
        if other is not None
    ]


def _quantized_deltas(results: PaperResults) -> Evidence | None:
    pair = _pair(results, f"pca-q ({CHOICE_NAMES[QUANTIZED_DELTAS]})", "pca-q")
    if pair is None:
        return None
    rates = [result["rates"]["stored"]["q"] for result in pair]
    errors = [[_error(result, key) for result in pair] for key in ("kg_error_percent", "sted")]
    ratios = [first / (second or 1.0) for first, second in (rates, *errors)]
    return Evidence(
        max(ratios),
        f"Deltas of all frames quantized, then projected: q {rates[0]:.4f}, KG {errors[0][0]:.3g} "
        f"%, STED {errors[1][0]:.3g}. Quantized after the projection with as many bits (Eq. 10): q "
        f"{rates[1]:.4f}, KG {errors[0][1]:.3g} %, STED {errors[1][1]:.3g}.",
        f"q {rates[1]:.2f} to {rates[0]:.2f}, KG {errors[0][1]:.3g} to {errors[0][0]:.3g} %",
    )


def _lowest_error(results: PaperResults) -> Evidence | None:
    finished = sorted(done(results.variants), key=lambda result: _error(result, "nmsve_mean"))
    best: dict[bool, float] = {}
    for result in reversed(finished):
        best[method_of_result(result) in ("pca-qs", "pca-qp")] = _error(result, "nmsve_mean")
    if len(best) < 2:
        return None
    listed = ", ".join(
        f"`{label_of_result(result)}` {_error(result, 'nmsve_mean'):.2e} at {_rate(result):.2g}"
        for result in finished
    )
    ratio = best[True] / (best[False] or 1.0)
    lowest = label_of_result(finished[0])
    return Evidence(
        ratio, f"Mean NMSVE at bpvf, the lowest first: {listed}.", f"{ratio:.2f}, lowest {lowest}"
    )


def _similar_pattern(results: PaperResults) -> Evidence | None:
    curves = [
        np.array(result["quality"]["nmsve"], float)
        for result in done(results.variants)
        if method_of_result(result) not in ("gft", "pca-qs")
    ]
    varying = [curve for curve in curves if np.ptp(curve) > 0]
    if len(varying) < 2:
        return None
    correlations = [_correlation(*pair) for pair in combinations(varying, 2)]
    low, high = min(correlations), max(correlations)
    mean = np.mean(correlations)
    return Evidence(
        low,
        f"Correlations of pairs: {low:.2f} to {high:.2f}, mean {mean:.2f}.",
        f"{low:.2f} to {high:.2f}",
    )


def _rows_enough(results: PaperResults) -> Evidence | None:
    rows = {result["identity"]["setting"]["n_modes"]: result for result in done(results.rows)}
    if 20 not in rows or 30 not in rows:
        return None
    listed = ", ".join(
        f"{n_modes}: {_error(result, 'kg_error_percent'):.3g} % and {_error(result, 'sted'):.3g}"
        for n_modes, result in sorted(rows.items())
    )
    fall = 100 * (1 - _error(rows[30], "sted") / (_error(rows[20], "sted") or 1.0))
    return Evidence(fall, f"KG and STED by k_l, 8 bits: {listed}.", f"STED {-fall:+.0f} %")


def _equal_quality(results: PaperResults) -> Evidence | None:
    pair = _pair(results, "pca-qs", "pca-qp")
    if pair is None:
        return None
    values = {name: [_error(one, key) for one in pair] for key, name in FIGURES.items()}
    differences = {name: 100 * abs(a - b) / (b or 1.0) for name, (a, b) in values.items()}
    listed = ", ".join(f"{name} {value:.1g} %" for name, value in differences.items())
    largest = max(differences.values())
    return Evidence(largest, f"Relative differences: {listed}.", f"differ by {largest:.1g} %")


def _temporal_artifacts(results: PaperResults) -> Evidence | None:
    pair = _pair(results, "pca-qp", "pca-qs")
    if pair is None:
        return None
    parallel, serial = (_error(result, "sted_temporal") for result in pair)
    return Evidence(
        parallel / (serial or 1.0),
        f"The temporal part of STED is {serial:.4g} with `pca-qs` and {parallel:.4g} with "
        "`pca-qp`: the same stream, solved frame by frame, gives the same frames.",
        f"T {serial:.4g} against {parallel:.4g}",
    )


def _faster(
    results: PaperResults, first: str, second: str, phase: str, run: str = ""
) -> Evidence | None:
    """Processor seconds of a phase of one method over those of another.

    Parameters
    ----------
    run : str
        The run of `results.claims` that contains both; empty for the settings of the tables.
    """
    if run:
        result = results.claims.get(run)
        if result is None or "refused" in result:
            return None
        seconds, n_frames = [result[name] for name in (first, second)], result["n_frames"]
    else:
        pair = _pair(results, first, second)
        if pair is None:
            return None
        seconds, n_frames = [one["seconds"] for one in pair], results.sequence["n_frames"]
    fast, slow = (one[f"{phase}_processor"] for one in seconds)
    ratio = fast / slow
    factor = f"{ratio:.2f}" if ratio > 0.1 else f"1/{1 / ratio:.0f}"
    return Evidence(
        ratio,
        f"{n_frames} frames: {fast:.3g} s of processor time with `{first}`, {slow:.3g} s with "
        f"`{second}`.",
        factor,
    )


def _differences(results: PaperResults) -> Evidence | None:
    bits = results.claims.get("dictionaries")
    if bits is None or "refused" in bits or bits["kept_whole"] is None:
        return None
    low, high = PRINTED_DICTIONARY_BITS
    return Evidence(
        bits["kept_difference_plain"] / bits["kept_whole_plain"],
        f"Coded entry by entry, {bits['kept_difference_plain']:.1f} bits against "
        f"{bits['kept_whole_plain']:.1f} with the columns in the stream, "
        f"{bits['all_difference_plain']:.1f} against {bits['all_whole_plain']:.1f} with all. "
        f"Coded as curves over time, as in streams, {bits['kept_difference']:.1f} against "
        f"{bits['kept_whole']:.1f} and {bits['all_difference']:.1f} against "
        f"{bits['all_whole']:.1f}. The paper's q_d implies {low} to {high}.",
        f"{bits['kept_whole_plain']:.1f} to {bits['kept_difference_plain']:.1f} bits (as curves "
        f"{bits['kept_whole']:.1f} to {bits['kept_difference']:.1f})",
    )


def _quiet_blocks(results: PaperResults) -> Evidence | None:
    result = results.claims.get("quiet blocks")
    if result is None or "refused" in result or len(result["bits"]) < 3:
        return None
    motion, bits = np.array(result["motion_percent"]), np.array(result["bits"])
    order = np.argsort(motion, kind="stable")
    third = max(1, len(order) // 3)
    quiet, fast = (float(bits[part].mean()) for part in (order[:third], order[-third:]))
    return Evidence(
        quiet / (fast or 1.0),
        f"The third of the blocks with the least motion (RMS {motion[order[:third]].mean():.2g} % "
        f"of the diagonal per frame) takes {quiet:.3g} bits per vertex and frame of a coordinate, "
        f"the third with the most motion ({motion[order[-third:]].mean():.2g} %) {fast:.3g}.",
        f"{quiet:.2f} against {fast:.2f} bits",
    )


def _steadiness(results: PaperResults) -> Evidence | None:
    pair = _pair(results, "gft", "pca-qp")
    if pair is None:
        return None
    curves = [np.array(result["quality"]["nmsve"], float) for result in pair]
    spread, other = (100 * float(np.std(curve) / np.mean(curve)) for curve in curves)
    return Evidence(
        spread,
        f"The standard deviation over the frames is {spread:.1f} % of the mean, that of `pca-qp` "
        f"{other:.1f} %.",
        f"{spread:.0f} %",
    )


def _per_mesh_size(results: PaperResults) -> Evidence | None:
    full = results.full_decomposition
    if full is None or "refused" in full:
        return None
    basis = extrapolated_basis(full, PER_MESH_VERTICES, results.sequence["n_frames"])
    is_judged = full["n_verts"] >= MIN_EXTRAPOLATED_VERTS
    return Evidence(
        basis.seconds / DAY_S if is_judged else None,
        f"{basis.text} All frequencies are counted. L is the same in all frames, so that one "
        "decomposition is enough."
        + ("" if is_judged else f" A verdict needs {MIN_EXTRAPOLATED_VERTS:,} measured vertices."),
        f"{duration_text(basis.seconds)}, extrapolated; {duration_text(basis.seconds_each)} with "
        "one decomposition",
    )


def _sparsity(results: PaperResults) -> Evidence | None:
    result = results.claims.get("sparsity")
    if result is None or "refused" in result:
        return None
    share, tiny = result["below_percent"], result["below_permille"]
    return Evidence(
        share,
        f"{share:.1f} % of the entries of x are at most 1 % of the largest, {tiny:.1f} % at most "
        "0.1 %.",
        f"{share:.1f} %",
    )


def _visible_error(results: PaperResults) -> Evidence | None:
    result = results.variant("pca-qp")
    if result is None:
        return None
    angle, sted = _error(result, "normal_angle_mean_deg"), _error(result, "sted")
    return Evidence(
        angle,
        f"At the settings of the tables ({_rate(result):.3g} bpvf) the normals of faces differ by "
        f"{angle:.2f} degrees on average; STED is {sted:.3g}.",
        f"{angle:.1f} degrees",
    )


def _correlation(first: np.ndarray, second: np.ndarray) -> float:
    return float(np.corrcoef(np.stack([first, second]))[0, 1])


_QP_COEFFICIENTS, _BLOCKS_COEFFICIENTS = (
    f"{method} ({CHOICE_NAMES[COEFFICIENTS]})" for method in ("pca-qp", "blocks")
)
_KG_RATIO = "KG error over that of the other, at equal rate"
_ALL_RATIOS = "largest of KG, STED and NMSVE over those of the other, at equal rate"
_SECONDS = "processor seconds over those of the other"
_LONG = "long sequence"

CLAIMS = (
    Claim(
        "Deltas on eigen-trajectories beat spatial coding of each mesh (PCA+qp, per mesh)",
        _ALL_RATIOS, *RATIO, partial(_at_equal_rate, first="pca-qp", second="gft"),
    ),
    Claim(
        "Deltas on eigen-trajectories beat vertices (PCA+qp, v2v)",
        _ALL_RATIOS, *RATIO, partial(_at_equal_rate, first="pca-qp", second="v2v"),
    ),
    Claim(
        "Deltas on eigen-trajectories beat vertices at the zero-order entropy of coefficients",
        _ALL_RATIOS, *RATIO,
        partial(_at_equal_rate, first="pca-qp", second="v2v", rate=ENTROPY_RATE),
    ),
    Claim(
        "The quality is not noticeably affected (PCA+qp, settings of the tables)",
        "mean angle between original and decoded normals, degrees", 2.0, 5.0, _visible_error,
    ),
    Claim(
        "The projected deltas are very sparse",
        "share of the entries of at most 1 % of the largest, percent", 95.0, 80.0, _sparsity,
    ),
    Claim(
        "More than 20 rows improve little",
        "fall of STED from 20 to 30 rows, percent", 10.0, 20.0, _rows_enough,
    ),
    Claim(
        "Anchors raise the level of detail (PCA+qp, PCA+q)",
        "largest of KG, STED and NMSVE over those without, at the settings of the tables",
        *RATIO, partial(_lower_errors, first="pca-qp", second="pca-q"),
    ),
    Claim(
        "1 % of the vertices as anchors are better than 0.5 %",
        "largest of KG, STED and NMSVE over those with 0.5 %, at the settings of the tables",
        *RATIO, partial(_lower_errors, first="pca-qp", second="pca-qp (0.5 %)"),
    ),
    Claim(
        "The choice of anchors hardly affects the results",
        "largest change of KG with three random sets, percent", 5.0, 15.0, _anchor_choice,
    ),
    Claim(
        "Positions of anchors in all frames (Eq. 12) beat their coefficients, PCA+qp",
        _KG_RATIO, *RATIO,
        partial(_kg_at_equal_rate, first="pca-qp", second=_QP_COEFFICIENTS),
    ),
    Claim(
        "Positions of anchors in all frames (Eq. 12) beat their coefficients, blocks",
        _KG_RATIO, *RATIO,
        partial(_kg_at_equal_rate, first="blocks", second=_BLOCKS_COEFFICIENTS),
    ),
    Claim(
        "Anchors need 16 bits for each position",
        "increase of KG with 12 bits, percent", 10.0, 2.0, _anchor_bits,
    ),
    Claim(
        "Variant (ii) read as the projection of quantized deltas is better than Eq. 10",
        "largest of q, KG and STED over those of Eq. 10", *RATIO, _quantized_deltas,
    ),
    Claim(
        "PCA+qs and PCA+qp have the lowest NMSVE at the settings of the tables",
        "their mean NMSVE over the lowest of the others", *RATIO, _lowest_error,
    ),
    Claim(
        "NMSVE per frame follows a similar pattern in all temporal methods",
        "smallest correlation of two methods", 0.8, 0.5, _similar_pattern,
    ),
    Claim(
        "Per mesh has nearly the same NMSVE in every frame",
        "standard deviation over the mean, percent", 10.0, 20.0, _steadiness,
    ),
    Claim(
        "PCA+qs and PCA+qp have equal quality",
        "largest difference of KG, STED and NMSVE, percent", 0.1, 1.0, _equal_quality,
    ),
    Claim(
        "PCA+qs has temporal artifacts that PCA+qp does not have",
        "temporal part of STED of PCA+qp over that of PCA+qs", *RATIO, _temporal_artifacts,
    ),
    Claim(
        "PCA+qp is much faster to reconstruct than PCA+qs",
        _SECONDS, 0.5, 1.0, partial(_faster, first="pca-qp", second="pca-qs", phase="decode"),
    ),
    Claim(
        "Blocks are faster to encode than PCA+qp",
        _SECONDS, *RATIO, partial(_faster, first="blocks", second="pca-qp", phase="encode"),
    ),
    Claim(
        "Blocks are faster to reconstruct than PCA+qp",
        _SECONDS, *RATIO, partial(_faster, first="blocks", second="pca-qp", phase="decode"),
    ),
    Claim(
        "Blocks are faster to encode than PCA+qp beyond 1,000 frames",
        _SECONDS, *RATIO,
        partial(_faster, first="blocks", second="pca-qp", phase="encode", run=_LONG),
    ),
    Claim(
        "Blocks are faster to reconstruct than PCA+qp beyond 1,000 frames",
        _SECONDS, *RATIO,
        partial(_faster, first="blocks", second="pca-qp", phase="decode", run=_LONG),
    ),
    Claim(
        "PCA+qp is better than blocks",
        _KG_RATIO, *RATIO, partial(_kg_at_equal_rate, first="pca-qp", second="blocks"),
    ),
    Claim(
        "Differences U[i+1] - U[i] need fewer bits than dictionaries",
        "bits per entry over those of whole dictionaries, entry by entry", *RATIO, _differences,
    ),
    Claim(
        "Blocks with little motion need fewer bits for the same error",
        "bits of the quietest third over those of the third with the most motion",
        *RATIO, _quiet_blocks,
    ),
    Claim(
        f"Per mesh is infeasible beyond {PER_MESH_VERTICES:,} vertices",
        "days for one decomposition per frame, extrapolated", 1.0, 0.1, _per_mesh_size,
    ),
)  # fmt: skip
"""In the order of the report: the central claims, rows, anchors, variants, blocks, per mesh."""
