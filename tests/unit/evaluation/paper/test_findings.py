import pytest

from meshreel.evaluation.paper.findings import findings


def finding(sentences, words):
    return next(sentence for sentence in sentences if words in sentence)


@pytest.mark.parametrize(
    ("error", "verdict"), [(1.0005, "quality: holds."), (1.01, "quality: does not hold.")]
)
def test_serial_is_judged_equal_when_its_errors_are(made_sequence, made_result, error, verdict):
    variants = [made_result("pca-qs", error=error), made_result("pca-qp", error=1.0)]
    assert verdict in finding(findings(made_sequence("x", variants)), "PCA+qs and PCA+qp")


@pytest.mark.parametrize(
    ("seconds", "verdict"),
    [((0.1, 0.1), "phases: holds."), ((0.1, 2.0), "phases: does not hold.")],
)
def test_blocks_are_judged_faster_when_both_times_are_lower(
    made_sequence, made_result, seconds, verdict
):
    variants = [made_result("blocks", seconds=seconds), made_result("pca-qp")]
    assert verdict in finding(findings(made_sequence("x", variants)), "Blocks are faster")


def test_methods_are_compared_at_equal_rate_when_their_envelopes_overlap(
    made_sequence, made_result
):
    sweep = [
        made_result(method, anchors=anchors, rate=rate, error=factor / rate)
        for method, anchors, factor in (("pca-qp", 0.01, 1.0), ("v2v", 0.0, 4.0))
        for rate in (0.5, 1.0, 2.0)
    ]
    sentence = finding(findings(made_sequence("x", sweep=sweep)), "against v2v")
    assert "`pca-qp` KG 0.25 (0.5 to 2 bpvf), STED 0.25 (0.5 to 2 bpvf)" in sentence


def test_finding_says_so_when_envelopes_do_not_overlap(made_sequence, made_result):
    sweep = [made_result("v2v", anchors=0.0, rate=rate, error=1 / rate) for rate in (1, 2)]
    sweep += [made_result("pca-qp", rate=rate, error=1 / rate) for rate in (4, 5)]
    assert "no rates in common, not compared" in finding(
        findings(made_sequence("x", sweep=sweep)), "against v2v"
    )


def test_nothing_is_found_when_nothing_can_be_compared(made_sequence, made_result):
    assert findings(made_sequence("x", [made_result("pca")])) == []


@pytest.mark.parametrize(("error", "verdict"), [(0.5, "does not hold"), (2.0, "holds")])
def test_lowest_error_is_judged_when_another_variant_has_a_lower(
    made_sequence, made_result, error, verdict
):
    variants = [made_result("pca", anchors=0.0, error=error), made_result("pca-qp")]
    found = finding(findings(made_sequence("x", variants)), "lowest NMSVE")
    assert f"NMSVE: {verdict}**" in found


def test_anchors_are_not_judged_when_they_change_nothing(made_sequence, made_result):
    variants = [made_result("pca-q", anchors=0.0), made_result("pca-qp")]
    assert "not to be judged" in finding(findings(made_sequence("x", variants)), "Anchors raise")


@pytest.mark.parametrize(("factor", "verdict"), [(0.5, "does not hold"), (2.0, "holds")])
def test_blocks_are_judged_at_equal_rate_when_their_settings_differ_in_rate(
    made_sequence, made_result, factor, verdict
):
    sweep = [made_result("blocks", rate=rate, error=factor / rate) for rate in (1, 2, 4)]
    sweep += [made_result("pca-qp", rate=rate, error=1 / rate) for rate in (1, 2, 4)]
    variants = [made_result("blocks", error=factor), made_result("pca-qp")]
    found = finding(findings(made_sequence("x", variants, sweep=sweep)), "inferior")
    assert f"quality: {verdict}**, by KG at equal rate" in found
