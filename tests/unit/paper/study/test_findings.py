"""Claims of the paper, judged on synthetic results."""

import pytest

from meshreel.paper.study.findings import Finding, findings
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


def test_text_has_claim_verdict_and_evidence():
    assert Finding("It rains", False, "Dry.").text == "**It rains: does not hold.** Dry."
    assert Finding("It rains", None, "Unseen.").verdict == "not judged"


@pytest.mark.every_case
@pytest.mark.parametrize(("error", "holds"), [(1.0005, True), (1.01, False)])
def test_serial_is_judged_equal_by_its_errors(made_sequence, made_result, error, holds):
    variants = [made_result("pca-qs", error=error), made_result("pca-qp", error=1.0)]
    found = judged(made_sequence("x", variants), "PCA+qs and PCA+qp have equal quality")
    assert found.holds is holds


@pytest.mark.every_case
@pytest.mark.parametrize(("temporal", "holds"), [(0.02, False), (0.021, True)])
def test_artifacts_of_serial_are_judged_by_the_temporal_part_of_sted(
    made_sequence, made_result, temporal, holds
):
    variants = [made_result("pca-qs", temporal=temporal), made_result("pca-qp", temporal=0.02)]
    assert judged(made_sequence("x", variants), "PCA+qs has temporal artifacts").holds is holds


def test_phases_of_blocks_are_judged_separately_by_processor_time(made_sequence, made_result):
    variants = [made_result("blocks", seconds=(0.1, 2.0)), made_result("pca-qp")]
    results = made_sequence("x", variants)
    faster = [
        judged(results, f"Blocks are faster to {verb} than PCA+qp")
        for verb in ("encode", "reconstruct")
    ]
    assert [finding.holds for finding in faster] == [True, False]
    assert "0.2 s of processor time against 2 s" in faster[0].evidence


def test_blocks_are_judged_on_long_sequences_too(made_sequence, made_result):
    seconds = {"encode_processor": 1.0, "decode_processor": 3.0}
    long = {
        "n_frames": 1200,
        "blocks": seconds,
        "pca-qp": {"encode_processor": 4.0, "decode_processor": 2.0},
    }
    results = made_sequence("x", [], claims={"long sequence": long})
    found = [finding for finding in findings(results) if "1,000 frames" in finding.claim]
    assert [finding.holds for finding in found] == [True, False]
    assert found[0].evidence.startswith("1200 frames: 1 s of processor time against 4 s, 0.25")


def test_deltas_are_compared_with_vertices_at_equal_rate(made_sequence, made_result):
    sweep = sweep_of(made_result, ("pca-qp", 1.0, ""), ("v2v", 4.0, ""))
    found = judged(made_sequence("x", sweep=sweep), "Deltas on eigen-trajectories")
    assert "`pca-qp` KG 0.25 (0.5 to 2 bpvf), STED 0.25 (0.5 to 2 bpvf)" in found.evidence
    assert found.holds is True
    sweep = sweep_of(made_result, ("pca-qp", 4.0, ""), ("v2v", 1.0, ""))
    assert judged(made_sequence("x", sweep=sweep), "Deltas on").holds is False


def test_deltas_without_common_rates_are_not_judged(made_sequence, made_result):
    sweep = [made_result("v2v", anchors=0.0, rate=rate, error=1 / rate) for rate in (1, 2)]
    sweep += [made_result("pca-qp", rate=rate, error=1 / rate) for rate in (4, 5)]
    assert findings(made_sequence("x", sweep=sweep)) == []


def test_results_without_comparisons_give_no_findings(made_sequence, made_result):
    assert findings(made_sequence("x", [made_result("pca", anchors=0.0)])) == []


@pytest.mark.every_case
@pytest.mark.parametrize(("error", "holds"), [(0.5, False), (2.0, True)])
def test_lowest_error_names_its_variant(made_sequence, made_result, error, holds):
    variants = [made_result("pca", anchors=0.0, error=error), made_result("pca-qp")]
    found = judged(made_sequence("x", variants), "PCA+qs and PCA+qp have the lowest NMSVE")
    assert found.holds is holds


def test_anchors_without_effect_are_not_judged(made_sequence, made_result):
    variants = [made_result("pca-q", anchors=0.0), made_result("pca-qp")]
    assert judged(made_sequence("x", variants), "Anchors raise").holds is None


@pytest.mark.every_case
@pytest.mark.parametrize(("factor", "holds"), [(0.5, False), (2.0, True)])
def test_blocks_are_judged_at_equal_rate_if_rates_overlap(
    made_sequence, made_result, factor, holds
):
    sweep = sweep_of(made_result, ("blocks", factor, ""), ("pca-qp", 1.0, ""))
    variants = [made_result("blocks", error=factor), made_result("pca-qp")]
    found = judged(made_sequence("x", variants, sweep=sweep), "Blocks are inferior")
    assert found.holds is holds


@pytest.mark.every_case
@pytest.mark.parametrize(("factor", "holds"), [(0.5, True), (2.0, False)])
def test_anchor_positions_are_judged_against_coefficients_at_equal_rate(
    made_sequence, made_result, factor, holds
):
    sweep = sweep_of(made_result, ("pca-qp", factor, ""), ("pca-qp", 1.0, COEFFICIENTS))
    results = made_sequence(
        "x",
        [made_result("pca-qp", error=factor)],
        alternatives=[made_result("pca-qp", choices=COEFFICIENTS)],
        sweep=sweep,
    )
    found = judged(results, "Positions of anchors in all frames (Eq. 12) beat")
    assert found.holds is holds
    assert f"{factor:.2f} times the error at equal rate" in found.evidence


@pytest.mark.every_case
@pytest.mark.parametrize(("error", "holds"), [(1.01, False), (1.05, True)])
def test_bits_of_anchors_are_needed_if_the_error_rises_without(
    made_sequence, made_result, error, holds
):
    results = made_sequence(
        "x",
        [made_result("pca-qp", error=error)],
        alternatives=[made_result("pca-qp", choices=FINE_ANCHORS)],
    )
    assert judged(results, "Anchors need 16 bits").holds is holds


@pytest.mark.every_case
@pytest.mark.parametrize(("error", "holds"), [(1.04, True), (0.9, False)])
def test_choice_of_anchors_is_judged_by_the_seed_that_differs_most(
    made_sequence, made_result, error, holds
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
    assert found.holds is holds
    assert f"+0.0 %, {100 * (error - 1):+.1f} %, +1.0 %" in found.evidence


@pytest.mark.every_case
@pytest.mark.parametrize(("q", "error", "holds"), [(0.2, 0.9, True), (0.9, 0.9, False)])
def test_quantized_deltas_are_judged_by_bits_and_error(made_sequence, made_result, q, error, holds):
    results = made_sequence(
        "x",
        [made_result("pca-q", anchors=0.0)],
        alternatives=[
            made_result("pca-q", anchors=0.0, choices=QUANTIZED_DELTAS, q=q, error=error)
        ],
    )
    assert judged(results, "Variant (ii)").holds is holds


@pytest.mark.every_case
@pytest.mark.parametrize(("other", "holds"), [((2, 4, 6, 9), True), ((4, 3, 2, 1), False)])
def test_errors_per_frame_are_similar_if_they_correlate(made_sequence, made_result, other, holds):
    variants = [
        made_result("pca-qp", nmsve=(1, 2, 3, 4)),
        made_result("v2v", anchors=0.0, nmsve=other),
    ]
    assert judged(made_sequence("x", variants), "NMSVE per frame").holds is holds


@pytest.mark.every_case
@pytest.mark.parametrize(("error", "holds"), [(0.95, True), (0.85, False)])
def test_more_rows_show_little_if_sted_hardly_falls(made_sequence, made_result, error, holds):
    rows = [made_result("pca-qp", n_modes=20), made_result("pca-qp", n_modes=30, error=error)]
    assert judged(made_sequence("x", rows=rows), "More than 20 rows").holds is holds


@pytest.mark.every_case
@pytest.mark.parametrize(("difference", "holds"), [(12.0, True), (14.5, False)])
def test_differences_of_dictionaries_are_judged_entry_by_entry(made_sequence, difference, holds):
    bits = {"kept_whole": 12.0, "kept_difference": 13.0, "all_whole": 15.0, "all_difference": 15.1}
    plain = {f"{name}_plain": one + 2 for name, one in bits.items()}
    plain["kept_difference_plain"] = difference
    results = made_sequence("x", claims={"dictionaries": {**bits, **plain}})
    assert judged(results, "Differences U").holds is holds


def test_dictionaries_of_one_block_are_not_judged(made_sequence):
    claims = {"dictionaries": {"kept_whole": None, "kept_difference": None}}
    assert findings(made_sequence("x", claims=claims)) == []


@pytest.mark.every_case
@pytest.mark.parametrize(("bits", "holds"), [((0.5, 0.8, 1.0), True), ((1.0, 0.8, 1.0), False)])
def test_quiet_blocks_are_judged_by_the_bits_of_thirds(made_sequence, bits, holds):
    claims = {"quiet blocks": {"motion_percent": [0.1, 0.5, 2.0], "bits": list(bits)}}
    assert judged(made_sequence("x", claims=claims), "Blocks with little motion").holds is holds


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("n_verts", "seconds", "holds"),
    [(10_000, 62.0, True), (10_000, 61.0, False), (1999, 62.0, None)],
)
def test_per_mesh_is_judged_by_all_frequencies_of_20000_vertices(
    made_sequence, n_verts, seconds, holds
):
    """At 10,000 vertices 61.7 s, times 2^3 and 175 frames, are a day."""
    full = {"n_verts": n_verts, "seconds": seconds, "processor_seconds": 1.0, "memory_bytes": 1.6e9}
    results = made_sequence("x", n_verts=n_verts, full_decomposition=full)
    found = judged(results, "Per mesh is infeasible")
    assert found.holds is holds
    assert found.evidence.startswith("Extrapolated from one decomposition of")
    assert ("6.4 GB" in found.evidence) == (n_verts == 10_000)


def test_random_anchors_are_judged_against_farthest_points(made_sequence, made_result):
    random = [made_result("pca-qp", choices=one, error=error)
              for one, error in zip(RANDOM_ANCHORS, (5.0, 3.0, 4.0), strict=True)]  # fmt: skip
    found = judged(made_sequence("x", [made_result("pca-qp", error=4.0), *random]), "The choice of")
    assert "by seed: +25.0 %, -25.0 %, +0.0 %" in found.evidence
    assert found.holds is False
