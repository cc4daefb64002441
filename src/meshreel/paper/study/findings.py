"""The paper's claims as a table: measure, thresholds, and verdicts from a sequence's results."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np

from meshreel.paper.study.results import (
    ENTROPY_RATE,
    ERRORS,
    RATE,
    PaperResults,
    extrapolated_basis,
    label_of_result,
    method_of_result,
    value_of,
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
from meshreel.studies.rate_distortion import error_at_equal_rate
from meshreel.studies.runs import Result, usable

KG, STED, NMSVE = ERRORS.values()

PER_MESH_VERTICES = 20000
"""Vertices beyond which the paper considers the per-mesh solve infeasible."""

RATIO = 0.9, 0.98
"""Thresholds of all ratios: at most the first is better, below the second slightly better."""

DAY_S = 24 * 3600.0

MIN_EXTRAPOLATED_VERTS = 2000
"""Fewest vertices from which the time of larger meshes is extrapolated."""

NOT_JUDGED = "not judged"

PRINTED_DICTIONARY_BITS = (8.5, 10.6)
"""Bits per entry implied by the printed q_d of `blocks`, for Samba and for Handstand."""


@dataclass(frozen=True)
class Evidence:
    """Evidence for or against a claim in the results of a sequence."""

    value: float | None
    """The claim's measure; None if the results do not allow a verdict."""
    text: str
    """The measured values, in a sentence or two."""
    figure: str
    """The deciding values, for a table."""


@dataclass(frozen=True)
class Claim:
    """A claim of the paper, or one of ours on what it leaves open, with its thresholds."""

    text: str
    measure: str
    """The number that decides, in words."""
    yes: float
    weakly: float
    """The verdict is "yes" if the measure is at most `yes`, "weakly" if it is below `weakly`, else
    "no". If `yes` exceeds `weakly`: at least `yes`, above `weakly`.
    """
    needs: str
    """Methods whose results it takes, separated by spaces."""
    evidence: Callable[[PaperResults], Evidence | None]
    """Returns the evidence of a sequence's results; None if they do not contain it."""
    in_quick: bool = True
    """Whether a quick study measures it."""

    @property
    def threshold(self) -> str:
        """The thresholds as text."""
        if self.yes <= self.weakly:
            return f"yes: up to {self.yes:g}; weakly: below {self.weakly:g}"
        return f"yes: {self.yes:g} or more; weakly: above {self.weakly:g}"

    def verdict(self, value: float | None) -> str:
        """Return "yes", "weakly", "no", or `NOT_JUDGED` without a value."""
        if value is None or not np.isfinite(value):
            return NOT_JUDGED
        sign = 1 if self.yes <= self.weakly else -1
        if sign * value <= sign * self.yes:
            return "yes"
        return "weakly" if sign * value < sign * self.weakly else "no"

    def why_not_judged(self, results: PaperResults) -> str:
        """Why results contain no evidence."""
        missing = set(self.needs.split()) - {*map(method_of_result, results.variants)}
        if missing:
            return f"It needs {', '.join(sorted(missing))}, which the study did not run."
        if results.is_quick and not self.in_quick:
            return "A quick study does not measure it."
        return "Its runs were refused, or have nothing to compare, such as common rates."


@dataclass(frozen=True)
class Finding:
    """A claim judged by the results of a sequence."""

    claim: Claim
    evidence: Evidence
    """What decides, or why nothing does."""
    is_quick: bool = False
    """Whether it is from a quick study."""

    @property
    def verdict(self) -> str:
        """Return "yes", "weakly", "no" or "not judged"."""
        return self.claim.verdict(self.evidence.value)

    @property
    def text(self) -> str:
        """Claim, verdict, evidence and thresholds as Markdown."""
        mark = " (quick)" if self.is_quick else ""
        return (
            f"**{self.claim.text}: {self.verdict}{mark}.** {self.evidence.text} (Measure: "
            f"{self.claim.measure}; {self.claim.threshold}.)"
        )

    def as_dict(self) -> dict[str, Any]:
        """The finding in plain types."""
        return {
            "claim": self.claim.text,
            "measure": self.claim.measure,
            "threshold": self.claim.threshold,
            "value": self.evidence.value,
            "verdict": self.verdict,
            "evidence": self.evidence.text,
            "figure": self.evidence.figure,
        }


def findings(results: PaperResults) -> list[Finding]:
    """Return a finding for each claim; those that the results do not cover say why."""
    return [
        Finding(claim, claim.evidence(results) or Evidence(None, claim.why_not_judged(results), ""),
                results.is_quick)
        for claim in CLAIMS
    ]  # fmt: skip


def _at_equal_rate(
    results: PaperResults,
    first: str,
    second: str,
    *,
    errors: Sequence[str] = tuple(ERRORS),
    rate: str = RATE,
) -> Evidence | None:
    """The errors of a variant relative to another at equal rate; the largest ratio decides."""
    ratios, texts = {}, []
    for name in errors:
        points = results.points(name, rate)
        change = error_at_equal_rate(points.get(first, []), points.get(second, []))
        if change.percent is not None:
            ratios[name] = 1 + change.percent / 100
            rates = f"{change.low_error:.2g} to {change.high_error:.2g} bpvf"
            texts.append(f"{name} {ratios[name]:.2f} ({rates})")
    if not ratios:
        return None
    return Evidence(
        max(ratios.values()),
        f"Errors of `{first}` relative to `{second}`: {', '.join(texts)}. "
        + results.sweep_text(first, second),
        ", ".join(f"{name} {ratio:.2f}" for name, ratio in ratios.items()),
    )


Pair = Sequence[float]
"""A figure of a variant and of another."""


def _ratio(pairs: Sequence[Pair]) -> float:
    """The largest ratio."""
    return max(first / (second or 1.0) for first, second in pairs)


def _difference(pairs: Sequence[Pair]) -> float:
    """The largest relative difference, in percent."""
    return max(100 * abs(first - second) / (second or 1.0) for first, second in pairs)


def _increase(pairs: Sequence[Pair]) -> float:
    """The increase of the first figure, in percent."""
    first, second = pairs[0]
    return 100 * (first / (second or 1.0) - 1)


def _compare(
    results: PaperResults,
    first: str,
    second: str,
    *,
    figures: dict[str, str] = ERRORS,
    measure: Callable[[Sequence[Pair]], float] = _ratio,
    run: str = "",
) -> Evidence | None:
    """Figures of a variant against those of another, at the settings of the tables.

    Parameters
    ----------
    figures : dict of str to str
        Keys of the figures by name, as for `_value`.
    measure : callable
        Returns the number that decides, given the pairs of all figures.
    run : str
        The run of `results.claims` that contains both; empty for the settings of the tables.
    """
    labels, timing = (first, second), results.claims.get(run)
    pair = [
        timing and {"seconds": timing[label]} if run else results.variant(label) for label in labels
    ]
    found = [result for result in pair if result is not None]
    if len(found) < 2:
        return None
    values = {name: [value_of(result, keys) for result in found] for name, keys in figures.items()}
    texts = [
        f"{name} {' against '.join(_with_spread(result, figures[name]) for result in found)}"
        for name in values
    ]
    rates = "" if timing else " and ".join(f"{value_of(result, RATE):.3g}" for result in found)
    setting = f"{timing['n_frames']} frames" if timing else f"{rates} bpvf"
    return Evidence(
        measure(list(values.values())),
        f"`{first}` against `{second}`, {setting}: {', '.join(texts)}.",
        texts[0],
    )


def _with_spread(result: Result, keys: str) -> str:
    """A figure, and for a median of seconds their range."""
    text = f"{value_of(result, keys):.3g}"
    group, name = keys.rsplit(".", 1)
    runs = (
        result[group].get(f"{name.removesuffix('_processor')}_runs") if group == "seconds" else ()
    )
    return f"{text} ({min(runs):.3g} to {max(runs):.3g})" if runs else text


def _anchor_choice(results: PaperResults) -> Evidence | None:
    changes = _random_changes(results, "pca-qp", RANDOM_ANCHORS)
    others = _random_changes(results, _QP_COEFFICIENTS, RANDOM_COEFFICIENTS)
    if not changes:
        return None
    texts, coefficient_texts = (
        ", ".join(f"{change:+.1f} %" for change in group) for group in (changes, others)
    )
    return Evidence(
        max(map(abs, changes)),
        f"KG with random anchors against farthest points, by seed: {texts}."
        + (f" With coefficients instead of positions: {coefficient_texts}." if others else ""),
        f"KG {texts}",
    )


def _random_changes(results: PaperResults, label: str, choices: Sequence[str]) -> list[float]:
    """Change of the KG error with random anchors in percent, by seed."""
    default = results.variant(label)
    others = [results.variant(f"pca-qp ({CHOICE_NAMES[text]})") for text in choices]
    return [
        _increase([(value_of(other, KG), value_of(default, KG))])
        for other in others
        if default is not None and other is not None
    ]


def _lowest_error(results: PaperResults) -> Evidence | None:
    ranked = sorted(usable(results.variants), key=lambda result: value_of(result, NMSVE))
    best: dict[bool, float] = {}
    for result in reversed(ranked):
        best[method_of_result(result) in ("pca-qs", "pca-qp")] = value_of(result, NMSVE)
    if len(best) < 2:
        return None
    texts = ", ".join(
        f"`{label_of_result(result)}` {value_of(result, NMSVE):.2e} at {value_of(result, RATE):.2g}"
        for result in ranked
    )
    ratio = best[True] / (best[False] or 1.0)
    lowest = label_of_result(ranked[0])
    return Evidence(
        ratio, f"Mean NMSVE at bpvf, the lowest first: {texts}.", f"{ratio:.2f}, lowest {lowest}"
    )


def _similar_pattern(results: PaperResults) -> Evidence | None:
    curves = [
        np.array(result["quality"]["nmsve"], float)
        for result in usable(results.variants)
        if method_of_result(result) not in ("gft", "pca-qs")
    ]
    varying = [curve for curve in curves if np.ptp(curve) > 0]
    if len(varying) < 2:
        return None
    pairs = [float(np.corrcoef(*pair)[0, 1]) for pair in combinations(varying, 2)]
    span = f"{min(pairs):.2f} to {max(pairs):.2f}"
    return Evidence(min(pairs), f"Correlations of pairs: {span}, mean {np.mean(pairs):.2f}.", span)


def _rows_enough(results: PaperResults) -> Evidence | None:
    rows = {result["identity"]["setting"]["n_modes"]: result for result in usable(results.rows)}
    if 20 not in rows or 30 not in rows:
        return None
    texts = ", ".join(
        f"{n_modes}: {value_of(result, KG):.3g} % and {value_of(result, STED):.3g}"
        for n_modes, result in sorted(rows.items())
    )
    fall = -_increase([(value_of(rows[30], STED), value_of(rows[20], STED))])
    return Evidence(fall, f"KG and STED by k_l, 8 bits: {texts}.", f"STED {-fall:+.0f} %")


def _differences(results: PaperResults) -> Evidence | None:
    bits = results.claims.get("dictionaries")
    if bits is None or bits["kept_whole"] is None:
        return None
    low, high = PRINTED_DICTIONARY_BITS
    plain, curves = (
        [f"{bits[f'{name}{coding}']:.1f}"
         for name in ("kept_whole", "kept_difference", "all_whole", "all_difference")]
        for coding in ("_plain", "")
    )  # fmt: skip
    return Evidence(
        bits["kept_difference_plain"] / bits["kept_whole_plain"],
        f"Coded entry by entry, {plain[1]} bits against {plain[0]} with the columns in the stream, "
        f"{plain[3]} against {plain[2]} with all. Coded as curves over time, as in streams, "
        f"{curves[1]} against {curves[0]} and {curves[3]} against {curves[2]}. The paper's q_d "
        f"implies {low} to {high}.",
        f"{plain[0]} to {plain[1]} bits (as curves {curves[0]} to {curves[1]})",
    )


def _quiet_blocks(results: PaperResults) -> Evidence | None:
    result = results.claims.get("quiet blocks")
    if result is None or len(result["bits"]) < 3:
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
    pair = results.variant("gft"), results.variant("pca-qp")
    curves = [np.array(result["quality"]["nmsve"], float) for result in pair if result is not None]
    if len(curves) < 2:
        return None
    spread, other = (100 * float(np.std(curve) / np.mean(curve)) for curve in curves)
    return Evidence(
        spread,
        f"The standard deviation over the frames is {spread:.1f} % of the mean, that of `pca-qp` "
        f"{other:.1f} %.",
        f"{spread:.0f} %",
    )


def _per_mesh_size(results: PaperResults) -> Evidence | None:
    full = results.full_basis
    if full is None:
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
    if result is None:
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
    angle = value_of(result, "quality.normal_angle_mean_deg")
    return Evidence(
        angle,
        f"At the settings of the tables ({value_of(result, RATE):.3g} bpvf) the normals of faces "
        f"differ by {angle:.2f} degrees on average; STED is {value_of(result, STED):.3g}.",
        f"{angle:.1f} degrees",
    )


_QP_COEFFICIENTS, _BLOCKS_COEFFICIENTS = (
    f"{method} ({CHOICE_NAMES[COEFFICIENTS]})" for method in ("pca-qp", "blocks")
)
_RATES = "largest of KG, STED and NMSVE over those of the other, at equal rate"
_KG_RATE = "KG error over that of the other, at equal rate"
_SECONDS = "median processor seconds over those of the other"
_ENCODE, _DECODE = (
    {f"processor seconds to {verb}": f"seconds.{phase}_processor"}
    for verb, phase in (("encode", "encode"), ("reconstruct", "decode"))
)
_equal_kg = partial(_at_equal_rate, errors=("KG",))
_long = partial(_compare, first="blocks", second="pca-qp", run="long sequence")

CLAIMS = tuple(
    Claim(*row)
    for row in (
        ("Deltas on eigen-trajectories beat spatial coding of each mesh (PCA+qp, per mesh)",
         _RATES, *RATIO, "pca-qp gft", partial(_at_equal_rate, first="pca-qp", second="gft")),
        ("Deltas on eigen-trajectories beat vertices (PCA+qp, v2v)",
         _RATES, *RATIO, "pca-qp v2v", partial(_at_equal_rate, first="pca-qp", second="v2v")),
        ("Deltas on eigen-trajectories beat vertices at the zero-order entropy of coefficients",
         _RATES, *RATIO, "pca-qp v2v",
         partial(_at_equal_rate, first="pca-qp", second="v2v", rate=ENTROPY_RATE)),
        ("The quality is not noticeably affected (PCA+qp, settings of the tables)",
         "mean angle between original and decoded normals, degrees (limits of ours)", 2.0, 5.0,
         "pca-qp", _visible_error),
        ("The projected deltas are very sparse",
         "share of the entries of at most 1 % of the largest, percent", 95.0, 80.0, "", _sparsity),
        ("More than 20 rows improve little",
         "fall of STED from 20 to 30 rows, percent", 10.0, 20.0, "pca-qp", _rows_enough),
        ("Anchors raise the level of detail (PCA+qp, PCA+q)",
         "largest of KG, STED and NMSVE over those without, at the settings of the tables",
         *RATIO, "pca-qp pca-q", partial(_compare, first="pca-qp", second="pca-q")),
        ("1 % of the vertices as anchors are better than 0.5 %",
         "largest of KG, STED and NMSVE over those with 0.5 %, at the settings of the tables",
         *RATIO, "pca-qp", partial(_compare, first="pca-qp", second="pca-qp (0.5 %)")),
        ("The choice of anchors hardly affects the results",
         "largest change of KG with three random sets, percent", 5.0, 15.0, "pca-qp",
         _anchor_choice, False),
        ("Positions of anchors in all frames (Eq. 12) beat their coefficients, PCA+qp",
         _KG_RATE, *RATIO, "pca-qp", partial(_equal_kg, first="pca-qp", second=_QP_COEFFICIENTS)),
        ("Positions of anchors in all frames (Eq. 12) beat their coefficients, blocks",
         _KG_RATE, *RATIO, "blocks",
         partial(_equal_kg, first="blocks", second=_BLOCKS_COEFFICIENTS)),
        ("Anchors need 16 bits for each position",
         "increase of KG with 12 bits, percent", 10.0, 2.0, "pca-qp",
         partial(_compare, first="pca-qp", second=f"pca-qp ({CHOICE_NAMES[FINE_ANCHORS]})",
                 figures={"KG": KG, "q_a": "rates.stored.q_a"}, measure=_increase), False),
        ("Variant (ii) read as the projection of quantized deltas is better than Eq. 10",
         "largest of q, KG and STED over those of Eq. 10", *RATIO, "pca-q",
         partial(_compare, first=f"pca-q ({CHOICE_NAMES[QUANTIZED_DELTAS]})", second="pca-q",
                 figures={"q": "rates.stored.q", "KG": KG, "STED": STED}), False),
        ("PCA+qs and PCA+qp have the lowest NMSVE at the settings of the tables",
         "their mean NMSVE over the lowest of the others", *RATIO, "pca-qs pca-qp", _lowest_error),
        ("NMSVE per frame follows a similar pattern in all temporal methods",
         "smallest correlation of two methods", 0.8, 0.5, "", _similar_pattern),
        ("Per mesh has nearly the same NMSVE in every frame",
         "standard deviation over the mean, percent", 10.0, 20.0, "gft pca-qp", _steadiness),
        ("PCA+qs and PCA+qp have equal quality",
         "largest difference of KG, STED and NMSVE, percent", 0.1, 1.0, "pca-qs pca-qp",
         partial(_compare, first="pca-qs", second="pca-qp", measure=_difference)),
        ("PCA+qs has temporal artifacts that PCA+qp does not have",
         "temporal part of STED of PCA+qp over that of PCA+qs", *RATIO, "pca-qs pca-qp",
         partial(_compare, first="pca-qp", second="pca-qs",
                 figures={"temporal part of STED": "quality.sted_temporal"})),
        ("PCA+qp is much faster to reconstruct than PCA+qs", _SECONDS, 0.5, 1.0, "pca-qs pca-qp",
         partial(_compare, first="pca-qp", second="pca-qs", figures=_DECODE)),
        ("Blocks are faster to encode than PCA+qp", _SECONDS, *RATIO, "blocks pca-qp",
         partial(_compare, first="blocks", second="pca-qp", figures=_ENCODE)),
        ("Blocks are faster to reconstruct than PCA+qp", _SECONDS, *RATIO, "blocks pca-qp",
         partial(_compare, first="blocks", second="pca-qp", figures=_DECODE)),
        ("Blocks are faster to encode than PCA+qp beyond 1,000 frames", _SECONDS, *RATIO,
         "blocks pca-qp", partial(_long, figures=_ENCODE), False),
        ("Blocks are faster to reconstruct than PCA+qp beyond 1,000 frames", _SECONDS, *RATIO,
         "blocks pca-qp", partial(_long, figures=_DECODE), False),
        ("PCA+qp is better than blocks", _KG_RATE, *RATIO, "blocks pca-qp",
         partial(_equal_kg, first="pca-qp", second="blocks")),
        ("Differences U[i+1] - U[i] need fewer bits than dictionaries",
         "bits per entry over those of whole dictionaries, entry by entry", *RATIO, "blocks",
         _differences),
        ("Blocks with little motion need fewer bits for the same error",
         "bits of the quietest third over those of the third with the most motion",
         *RATIO, "blocks", _quiet_blocks),
        (f"Per mesh is infeasible beyond {PER_MESH_VERTICES:,} vertices",
         "days for one decomposition per frame, extrapolated", 1.0, 0.1, "gft",
         _per_mesh_size, False),
    )
)  # fmt: skip
"""In the order of the report: the central claims, rows, anchors, variants, blocks, per mesh."""
