"""Claims of the paper, judged on synthetic results."""

import pytest

from meshreel.paper.study.findings import CLAIMS, Claim, findings
from meshreel.paper.sweeps import (
    COEFFICIENTS,
    FINE_ANCHORS,
    QUANTIZED_DELTAS,
    RANDOM_ANCHORS,
)


def judged(results, words):
    """Return the only finding whose claim begins with this text."""
    (found,) = [finding for finding in findings(results) if finding.claim.startswith(words)]
    return found


def sweep_of(made_result, *curves):
    """Points at three rates of each of (method, factor, choices): the error is factor / rate."""
    return [
        made_result(
            method,
            anchors=0.0 if method == "v2v" else 0.01,
            rate=rate,
            error=factor / rate,
            choices=choices,
        )
        for method, factor, choices in curves
        for rate in (0.5, 1.0, 2.0)
    ]


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("limits", "verdicts"),
    [
        ((0.9, 1.0), {0.9: "yes", 0.95: "weakly", 1.0: "no", 2.0: "no"}),
        ((0.8, 0.5), {0.8: "yes", 0.6: "weakly", 0.5: "no", -1.0: "no"}),
        ((10.0, 20.0), {None: "not judged", float("inf"): "not judged", -5.0: "yes"}),
    ],
)
def test_verdict_follows_the_thresholds(limits, verdicts):
    claim = Claim("It rains", "liters", limits[0], limits[1], lambda _: None)
    assert {value: claim.verdict(value) for value in verdicts} == verdicts


def test_thresholds_are_stated_in_both_directions():
    thresholds = [Claim("", "", *pair, lambda _: None).threshold for pair in ((1, 2), (2, 1))]
    assert thresholds == ["yes: up to 1; weakly: below 2", "yes: 2 or more; weakly: above 1"]


def test_claims_differ_and_none_rests_on_a_bare_comparison():
    assert len({claim.text for claim in CLAIMS}) == len(CLAIMS)
    assert all(claim.yes != claim.weakly for claim in CLAIMS)


def test_text_has_claim_verdict_evidence_and_threshold(made_sequence, made_result):
    text = judged(made_sequence("x", [made_result("pca-qp")]), "The quality is not").text
    assert text.startswith("**The quality is not noticeably affected (PCA+qp, settings of the")
    assert "tables): weakly.** At the settings of the tables (1 bpvf)" in text
    assert text.endswith("degrees; yes: up to 2; weakly: below 5.)")


@pytest.mark.every_case
@pytest.mark.parametrize(("error", "verdict"), [(1.0005, "yes"), (1.005, "weakly"), (1.02, "no")])
def test_serial_is_judged_equal_by_its_errors(made_sequence, made_result, error, verdict):
    variants = [made_result("pca-qs", error=error), made_result("pca-qp", error=1.0)]
    found = judged(made_sequence("x", variants), "PCA+qs and PCA+qp have equal quality")
    assert found.verdict == verdict


@pytest.mark.every_case
@pytest.mark.parametrize(("temporal", "verdict"), [(0.02, "no"), (0.021, "weakly"), (0.03, "yes")])
def test_artifacts_of_serial_are_judged_by_the_temporal_part_of_sted(
    made_sequence, made_result, temporal, verdict
):
    variants = [made_result("pca-qs", temporal=temporal), made_result("pca-qp", temporal=0.02)]
    assert judged(made_sequence("x", variants), "PCA+qs has temporal artifacts").verdict == verdict


def test_phases_of_blocks_are_judged_separately_by_processor_time(made_sequence, made_result):
    variants = [made_result("blocks", seconds=(0.1, 2.0)), made_result("pca-qp")]
    results = made_sequence("x", variants)
    faster = [
        judged(results, f"Blocks are faster to {verb} than PCA+qp")
        for verb in ("encode", "reconstruct")
    ]
    assert [finding.verdict for finding in faster] == ["yes", "no"]
    assert "0.2 s of processor time with `blocks`, 2 s with `pca-qp`" in faster[0].evidence


def test_blocks_are_judged_on_long_sequences_too(made_sequence, made_result):
    seconds = {"encode_processor": 1.0, "decode_processor": 3.0}
    long = {
        "n_frames": 1200,
        "blocks": seconds,
        "pca-qp": {"encode_processor": 4.0, "decode_processor": 2.0},
    }
    results = made_sequence("x", [], claims={"long sequence": long})
    found = [finding for finding in findings(results) if "1,000 frames" in finding.claim]
    assert [finding.verdict for finding in found] == ["yes", "no"]
    assert found[0].evidence.startswith("1200 frames: 1 s of processor time with `blocks`, 4 s")


def test_deltas_are_compared_with_vertices_at_equal_rate(made_sequence, made_result):
    sweep = sweep_of(made_result, ("pca-qp", 1.0, ""), ("v2v", 4.0, ""))
    found = judged(made_sequence("x", sweep=sweep), "Deltas on eigen-trajectories beat vertices (")
    assert "relative to `v2v`: KG 0.25 (0.5 to 2 bpvf), STED 0.25 (0.5 to 2 bpvf)" in found.evidence
    assert found.verdict == "yes"
    sweep = sweep_of(made_result, ("pca-qp", 4.0, ""), ("v2v", 1.0, ""))
    found = judged(made_sequence("x", sweep=sweep), "Deltas on eigen-trajectories beat vertices (")
    assert found.verdict == "no"


def test_deltas_and_vertices_are_compared_by_zero_order_entropy_too(made_sequence, made_result):
    """Our coder may favor one of the two: here only files with it favor vertices."""
    sweep = [
        made_result(method, anchors=anchors, rate=rate, entropy_rate=factor * rate, error=1 / rate)
        for method, anchors, factor in (("pca-qp", 0.01, 1.0), ("v2v", 0.0, 2.0))
        for rate in (0.5, 1.0, 2.0)
    ]
    results = made_sequence("x", sweep=sweep)
    assert judged(results, "Deltas on eigen-trajectories beat vertices (").verdict == "no"
    assert judged(results, "Deltas on eigen-trajectories beat vertices at the").verdict == "yes"


@pytest.mark.every_case
@pytest.mark.parametrize(("factor", "verdict"), [(2.0, "yes"), (1.05, "weakly"), (0.5, "no")])
def test_central_claim_compares_with_per_mesh_at_equal_rate(
    made_sequence, made_result, factor, verdict
):
    sweep = sweep_of(made_result, ("pca-qp", 1.0, ""), ("gft", factor, ""))
    found = judged(made_sequence("x", sweep=sweep), "Deltas on eigen-trajectories beat spatial")
    assert found.verdict == verdict


@pytest.mark.every_case
@pytest.mark.parametrize(("share", "verdict"), [(96.0, "yes"), (90.0, "weakly"), (50.0, "no")])
def test_sparsity_is_judged_by_entries_near_zero(made_sequence, share, verdict):
    claims = {"sparsity": {"below_percent": share, "below_permille": 40.0}}
    found = judged(made_sequence("x", claims=claims), "The projected deltas are very sparse")
    assert found.verdict == verdict


def test_deltas_without_common_rates_are_not_judged(made_sequence, made_result):
    sweep = [made_result("v2v", anchors=0.0, rate=rate, error=1 / rate) for rate in (1, 2)]
    sweep += [made_result("pca-qp", rate=rate, error=1 / rate) for rate in (4, 5)]
    assert findings(made_sequence("x", sweep=sweep)) == []


def test_results_without_comparisons_give_no_findings(made_sequence, made_result):
    assert findings(made_sequence("x", [made_result("pca", anchors=0.0)])) == []


@pytest.mark.every_case
@pytest.mark.parametrize(("error", "verdict"), [(0.5, "no"), (2.0, "yes")])
def test_lowest_error_names_its_variant(made_sequence, made_result, error, verdict):
    variants = [made_result("pca", anchors=0.0, error=error), made_result("pca-qp")]
    found = judged(made_sequence("x", variants), "PCA+qs and PCA+qp have the lowest NMSVE")
    assert found.verdict == verdict


def test_anchors_without_effect_are_not_judged(made_sequence, made_result):
    variants = [made_result("pca-q", anchors=0.0), made_result("pca-qp")]
    assert judged(made_sequence("x", variants), "Anchors raise").verdict == "not judged"


@pytest.mark.every_case
@pytest.mark.parametrize(("factor", "verdict"), [(0.5, "no"), (2.0, "yes")])
def test_blocks_are_judged_at_equal_rate_if_rates_overlap(
    made_sequence, made_result, factor, verdict
):
    sweep = sweep_of(made_result, ("blocks", factor, ""), ("pca-qp", 1.0, ""))
    variants = [made_result("blocks", error=factor), made_result("pca-qp")]
    found = judged(made_sequence("x", variants, sweep=sweep), "PCA+qp is better than blocks")
    assert found.verdict == verdict


@pytest.mark.every_case
@pytest.mark.parametrize(("factor", "verdict"), [(0.5, "yes"), (2.0, "no")])
def test_anchor_positions_are_judged_against_coefficients_at_equal_rate(
    made_sequence, made_result, factor, verdict
):
    sweep = sweep_of(made_result, ("pca-qp", factor, ""), ("pca-qp", 1.0, COEFFICIENTS))
    results = made_sequence(
        "x",
        [made_result("pca-qp", error=factor)],
        alternatives=[made_result("pca-qp", choices=COEFFICIENTS)],
        sweep=sweep,
    )
    found = judged(results, "Positions of anchors in all frames (Eq. 12) beat")
    assert found.verdict == verdict
    assert f"has {factor:.2f} times the KG error of" in found.evidence


@pytest.mark.every_case
@pytest.mark.parametrize(("error", "verdict"), [(1.01, "no"), (1.05, "weakly"), (1.2, "yes")])
def test_bits_of_anchors_are_needed_if_the_error_rises_without(
    made_sequence, made_result, error, verdict
):
    results = made_sequence(
        "x",
        [made_result("pca-qp", error=error)],
        alternatives=[made_result("pca-qp", choices=FINE_ANCHORS)],
    )
    assert judged(results, "Anchors need 16 bits").verdict == verdict


@pytest.mark.every_case
@pytest.mark.parametrize(("error", "verdict"), [(1.04, "yes"), (0.9, "weakly"), (1.3, "no")])
def test_choice_of_anchors_is_judged_by_the_seed_that_differs_most(
    made_sequence, made_result, error, verdict
):
    errors = (1.0, error, 1.01)
    results = made_sequence(
        "x",
        [made_result("pca-qp")],
        alternatives=[
            made_result("pca-qp", choices=choices, error=one)
            for choices, one in zip(RANDOM_ANCHORS, errors, strict=True)
        ],
    )
    found = judged(results, "The choice of anchors")
    assert found.verdict == verdict
    assert f"+0.0 %, {100 * (error - 1):+.1f} %, +1.0 %" in found.evidence


@pytest.mark.every_case
@pytest.mark.parametrize(("q", "error", "verdict"), [(0.2, 0.8, "yes"), (0.9, 0.8, "no")])
def test_quantized_deltas_are_judged_by_bits_and_error(
    made_sequence, made_result, q, error, verdict
):
    results = made_sequence(
        "x",
        [made_result("pca-q", anchors=0.0)],
        alternatives=[
            made_result("pca-q", anchors=0.0, choices=QUANTIZED_DELTAS, q=q, error=error)
        ],
    )
    assert judged(results, "Variant (ii)").verdict == verdict


@pytest.mark.every_case
@pytest.mark.parametrize(("other", "verdict"), [((2, 4, 6, 9), "yes"), ((4, 3, 2, 1), "no")])
def test_errors_per_frame_are_similar_if_they_correlate(made_sequence, made_result, other, verdict):
    variants = [
        made_result("pca-qp", nmsve=(1, 2, 3, 4)),
        made_result("v2v", anchors=0.0, nmsve=other),
    ]
    assert judged(made_sequence("x", variants), "NMSVE per frame").verdict == verdict


@pytest.mark.every_case
@pytest.mark.parametrize(("error", "verdict"), [(0.95, "yes"), (0.85, "weakly"), (0.75, "no")])
def test_more_rows_show_little_if_sted_hardly_falls(made_sequence, made_result, error, verdict):
    rows = [made_result("pca-qp", n_modes=20), made_result("pca-qp", n_modes=30, error=error)]
    assert judged(made_sequence("x", rows=rows), "More than 20 rows").verdict == verdict


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("difference", "verdict"), [(12.0, "yes"), (13.3, "weakly"), (13.8, "no"), (14.5, "no")]
)
def test_differences_of_dictionaries_are_judged_entry_by_entry(made_sequence, difference, verdict):
    bits = {"kept_whole": 12.0, "kept_difference": 13.0, "all_whole": 15.0, "all_difference": 15.1}
    plain = {f"{name}_plain": one + 2 for name, one in bits.items()}
    plain["kept_difference_plain"] = difference
    results = made_sequence("x", claims={"dictionaries": {**bits, **plain}})
    assert judged(results, "Differences U").verdict == verdict


def test_dictionaries_of_one_block_are_not_judged(made_sequence):
    claims = {"dictionaries": {"kept_whole": None, "kept_difference": None}}
    assert findings(made_sequence("x", claims=claims)) == []


@pytest.mark.every_case
@pytest.mark.parametrize(("bits", "verdict"), [((0.5, 0.8, 1.0), "yes"), ((1.0, 0.8, 1.0), "no")])
def test_quiet_blocks_are_judged_by_the_bits_of_thirds(made_sequence, bits, verdict):
    claims = {"quiet blocks": {"motion_percent": [0.1, 0.5, 2.0], "bits": list(bits)}}
    assert judged(made_sequence("x", claims=claims), "Blocks with little motion").verdict == verdict


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("n_verts", "seconds", "verdict"),
    [
        (10_000, 62.0, "yes"),
        (10_000, 61.0, "weakly"),
        (10_000, 5.0, "no"),
        (1999, 62.0, "not judged"),
    ],
)
def test_per_mesh_is_judged_by_all_frequencies_of_20000_vertices(
    made_sequence, n_verts, seconds, verdict
):
    """At 10,000 vertices 61.7 s, times 2^3 and 175 frames, are a day."""
    full = {"n_verts": n_verts, "seconds": seconds, "processor_seconds": 1.0, "memory_bytes": 1.6e9}
    results = made_sequence("x", n_verts=n_verts, full_decomposition=full)
    found = judged(results, "Per mesh is infeasible")
    assert found.verdict == verdict
    assert found.evidence.startswith("Extrapolated from one decomposition of")
    assert ("6.4 GB" in found.evidence) == (n_verts == 10_000)


def test_random_anchors_are_judged_against_farthest_points(made_sequence, made_result):
    random = [made_result("pca-qp", choices=one, error=error)
              for one, error in zip(RANDOM_ANCHORS, (5.0, 3.0, 4.0), strict=True)]  # fmt: skip
    found = judged(made_sequence("x", [made_result("pca-qp", error=4.0), *random]), "The choice of")
    assert "by seed: +25.0 %, -25.0 %, +0.0 %" in found.evidence
    assert found.verdict == "no"
