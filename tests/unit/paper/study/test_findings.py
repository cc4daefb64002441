"""Claims of the paper, judged on synthetic results and on runs of small sequences."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import meshreel
from meshreel.errors import InvalidInputError
from meshreel.paper.study import runs
from meshreel.paper.study.findings import CLAIMS, Claim, findings
from meshreel.paper.study.results import PaperResults
from meshreel.paper.study.runs import (
    dictionaries_run,
    full_decomposition_run,
    long_run,
    quiet_blocks_run,
)
from meshreel.paper.sweeps import (
    COEFFICIENTS,
    FINE_ANCHORS,
    QUANTIZED_DELTAS,
    RANDOM_ANCHORS,
    TableSettings,
)
from meshreel.runtime.progress import silent
from samples.meshes import waving_grid
from samples.paper_results import made_result, made_sequence


def judged(results, words):
    """Return the only finding whose claim has or begins with this text."""
    found = [each for each in findings(results) if each.claim.text.startswith(words)]
    [finding] = [each for each in found if each.claim.text == words] or found
    return finding


def tables(*variants, **others):
    """Results of variants at the settings of the tables."""
    return made_sequence("x", variants, **others)


def curve(method, factor, choices="", **others):
    """Points at three rates, with an error of factor / rate."""
    anchors = 0.0 if method == "v2v" else 0.01
    return [
        made_result(
            method, anchors=anchors, rate=rate, error=factor / rate, choices=choices, **others
        )
        for rate in (0.5, 1.0, 2.0)
    ]


def curves(*points, **others):
    """Results of a sweep."""
    return made_sequence("x", sweep=[each for curve in points for each in curve], **others)


def claim_run(name, **figures):
    """Results of a run for a single claim."""
    return made_sequence("x", claims={name: figures})


def dictionaries(difference):
    bits = {"kept_whole": 12.0, "kept_difference": 13.0, "all_whole": 15.0, "all_difference": 15.1}
    plain = {f"{name}_plain": number + 2 for name, number in bits.items()}
    plain["kept_difference_plain"] = difference
    return claim_run("dictionaries", **bits, **plain)


def random_anchors(error):
    return [
        made_result("pca-qp", choices=choices, error=each)
        for choices, each in zip(RANDOM_ANCHORS, (1.0, error, 1.01), strict=True)
    ]


def graph_basis(n_verts_and_seconds):
    n_verts, seconds = n_verts_and_seconds
    full = {"n_verts": n_verts, "seconds": seconds, "processor_seconds": 1.0, "memory_bytes": 1.6e9}
    return tables(n_verts=n_verts, full_decomposition=full)


PCA_QP = made_result("pca-qp")

JUDGED: dict[str, tuple[Callable[[Any], PaperResults], dict[Any, str]]] = {
    "PCA+qs and PCA+qp have equal quality": (
        lambda error: tables(made_result("pca-qs", error=error), PCA_QP),
        {1.0005: "yes", 1.005: "weakly", 1.02: "no"},
    ),
    "PCA+qs has temporal artifacts": (
        lambda temporal: tables(made_result("pca-qs", temporal=temporal), PCA_QP),
        {0.02: "no", 0.021: "weakly", 0.03: "yes"},
    ),
    "Blocks are faster to encode than PCA+qp": (
        lambda seconds: tables(made_result("blocks", seconds=(seconds, 2.0)), PCA_QP),
        {0.1: "yes", 0.95: "weakly", 1.0: "no"},
    ),
    "Deltas on eigen-trajectories beat vertices (": (
        lambda factor: curves(curve("pca-qp", 1.0), curve("v2v", factor)),
        {4.0: "yes", 0.25: "no"},
    ),
    "Deltas on eigen-trajectories beat spatial": (
        lambda factor: curves(curve("pca-qp", 1.0), curve("gft", factor)),
        {2.0: "yes", 1.05: "weakly", 0.5: "no"},
    ),
    "The projected deltas are very sparse": (
        lambda share: claim_run("sparsity", below_percent=share, below_permille=40.0),
        {96.0: "yes", 90.0: "weakly", 50.0: "no"},
    ),
    "PCA+qs and PCA+qp have the lowest NMSVE": (
        lambda error: tables(made_result("pca", anchors=0.0, error=error), PCA_QP),
        {0.5: "no", 2.0: "yes"},
    ),
    "PCA+qp is better than blocks": (
        lambda factor: curves(curve("blocks", factor), curve("pca-qp", 1.0)),
        {0.5: "no", 2.0: "yes"},
    ),
    "Positions of anchors in all frames (Eq. 12) beat their coefficients, PCA+qp": (
        lambda factor: curves(curve("pca-qp", factor), curve("pca-qp", 1.0, COEFFICIENTS)),
        {0.5: "yes", 2.0: "no"},
    ),
    "Anchors need 16 bits": (
        lambda error: tables(
            made_result("pca-qp", error=error),
            alternatives=[made_result("pca-qp", choices=FINE_ANCHORS)],
        ),
        {1.01: "no", 1.05: "weakly", 1.2: "yes"},
    ),
    "The choice of anchors": (
        lambda error: tables(PCA_QP, alternatives=random_anchors(error)),
        {1.04: "yes", 0.9: "weakly", 1.3: "no"},
    ),
    "Variant (ii)": (
        lambda q: tables(
            made_result("pca-q", anchors=0.0),
            alternatives=[
                made_result("pca-q", anchors=0.0, choices=QUANTIZED_DELTAS, q=q, error=0.8)
            ],
        ),
        {0.2: "yes", 0.9: "no"},
    ),
    "NMSVE per frame": (
        lambda other: tables(
            made_result("pca-qp", nmsve=(1, 2, 3, 4)), made_result("v2v", anchors=0.0, nmsve=other)
        ),
        {(2, 4, 6, 9): "yes", (4, 3, 2, 1): "no"},
    ),
    "More than 20 rows": (
        lambda error: made_sequence(
            "x", rows=[PCA_QP, made_result("pca-qp", n_modes=30, error=error)]
        ),
        {0.95: "yes", 0.85: "weakly", 0.75: "no"},
    ),
    "Differences U": (
        dictionaries, {12.0: "yes", 13.3: "weakly", 13.8: "no", 14.5: "no"},
    ),
    "Blocks with little motion": (
        lambda bits: claim_run("quiet blocks", motion_percent=[0.1, 0.5, 2.0], bits=list(bits)),
        {(0.5, 0.8, 1.0): "yes", (1.0, 0.8, 1.0): "no"},
    ),
    # At 10,000 vertices 61.7 s, times 2^3 and 175 frames, are a day.
    "Per mesh is infeasible": (
        graph_basis,
        {(10_000, 62.0): "yes", (10_000, 61.0): "weakly", (10_000, 5.0): "no",
         (1999, 62.0): "not judged"},
    ),
}  # fmt: skip
"""Results by claim, given a number, and the verdicts of some numbers."""


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("claim", "number", "verdict"),
    [
        (claim, number, verdict)
        for claim, (_, verdicts) in JUDGED.items()
        for number, verdict in verdicts.items()
    ],
)
def test_verdict_of_a_claim_follows_its_measure(claim, number, verdict):
    assert judged(JUDGED[claim][0](number), claim).verdict == verdict


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("claim", "number", "words"),
    [
        ("Blocks are faster to encode than PCA+qp", 0.1, "seconds to encode 0.2 against 2."),
        ("Deltas on eigen-trajectories beat vertices (", 4.0,
         "relative to `v2v`: KG 0.25 (0.5 to 2 bpvf), STED 0.25 (0.5 to 2 bpvf)"),
        ("Positions of anchors in all frames (Eq. 12) beat their coefficients, PCA+qp", 0.5,
         "KG 0.50 (0.5 to 2 bpvf)"),
        ("The choice of anchors", 1.04, "by seed: +0.0 %, +4.0 %, +1.0 %"),
        ("Per mesh is infeasible", (10_000, 62.0), "6.4 GB"),
        ("Per mesh is infeasible", (1999, 62.0), "A verdict needs 2,000 measured vertices."),
    ],
)  # fmt: skip
def test_evidence_contains_the_measured_values(claim, number, words):
    assert words in judged(JUDGED[claim][0](number), claim).evidence.text


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
    claim = Claim("It rains", "liters", limits[0], limits[1], "", lambda _: None)
    assert {value: claim.verdict(value) for value in verdicts} == verdicts


def test_thresholds_are_stated_in_both_directions():
    thresholds = [Claim("", "", *pair, "", lambda _: None).threshold for pair in ((1, 2), (2, 1))]
    assert thresholds == ["yes: up to 1; weakly: below 2", "yes: 2 or more; weakly: above 1"]


def test_claims_differ_and_none_rests_on_a_bare_comparison():
    assert len({claim.text for claim in CLAIMS}) == len(CLAIMS)
    assert all(claim.yes != claim.weakly for claim in CLAIMS)


def test_text_has_claim_verdict_evidence_and_threshold():
    text = judged(tables(PCA_QP), "The quality is not").text
    assert text.startswith("**The quality is not noticeably affected (PCA+qp, settings of the")
    assert "tables): weakly.** At the settings of the tables (1 bpvf)" in text
    assert text.endswith("(limits of ours); yes: up to 2; weakly: below 5.)")


def test_blocks_are_judged_on_long_sequences_too():
    seconds = [{"encode_processor": 1.0, "decode_processor": 3.0},
               {"encode_processor": 4.0, "decode_processor": 2.0}]  # fmt: skip
    results = claim_run(
        "long sequence", n_frames=1200, **dict(zip(("blocks", "pca-qp"), seconds, strict=True))
    )
    long = [finding for finding in findings(results) if "1,000 frames" in finding.claim.text]
    assert [finding.verdict for finding in long] == ["yes", "no"]
    assert long[0].evidence.text == (
        "`blocks` against `pca-qp`, 1200 frames: processor seconds to encode 1 against 4."
    )


def test_deltas_and_vertices_are_compared_by_zero_order_entropy_too():
    """Our coder may favor one of the two: here only files with it favor vertices."""
    sweep = [
        made_result(method, anchors=anchors, rate=rate, entropy_rate=factor * rate, error=1 / rate)
        for method, anchors, factor in (("pca-qp", 0.01, 1.0), ("v2v", 0.0, 2.0))
        for rate in (0.5, 1.0, 2.0)
    ]
    results = curves(sweep)
    assert judged(results, "Deltas on eigen-trajectories beat vertices (").verdict == "no"
    assert judged(results, "Deltas on eigen-trajectories beat vertices at the").verdict == "yes"


@pytest.mark.parametrize(
    "results",
    [
        tables(made_result("pca", anchors=0.0)),
        claim_run("dictionaries", kept_whole=None, kept_difference=None),
        curves(curve("v2v", 1.0)[:2], [made_result("pca-qp", rate=rate) for rate in (4, 5)]),
    ],
    ids=["one variant", "dictionaries of one block", "no common rates"],
)
def test_results_without_comparisons_give_no_findings(results):
    assert {each.verdict for each in findings(results)} == {"not judged"}


def test_claims_that_are_not_judged_say_why():
    results = tables(PCA_QP, is_quick=True)
    reasons = {
        "Blocks are faster to encode than PCA+qp": "It needs blocks, which the study did not run.",
        "Anchors need 16 bits": "A quick study does not measure it.",
        "More than 20 rows": "nothing to compare",
    }
    for words, reason in reasons.items():
        finding = judged(results, words)
        assert finding.verdict == "not judged"
        assert reason in finding.evidence.text
    assert len(findings(results)) == len(CLAIMS)


def test_verdicts_of_quick_studies_are_marked():
    assert "tables): weakly (quick).**" in judged(tables(PCA_QP, is_quick=True), "The quality").text


def test_evidence_at_equal_rate_names_points_and_convergence():
    text = judged(
        curves(curve("pca-qp", 1.0), curve("gft", 2.0)), "Deltas on eigen-trajectories beat spatial"
    ).evidence.text
    assert "Sweeps: `pca-qp` 3 points (the last round moved it 1.5 %), `gft` 3 points" in text


def test_seconds_have_their_spread():
    blocks = made_result("blocks")
    blocks["seconds"]["encode_runs"] = [1.9, 2.0, 2.3]
    text = judged(tables(blocks, PCA_QP), "Blocks are faster to encode than PCA+qp").evidence.text
    assert "processor seconds to encode 2 (1.9 to 2.3) against 2." in text


def figures(run):
    return run.measure(silent).figures


def with_rest(n_frames=60):
    """A sheet that waves, then hardly moves."""
    moving = waving_grid(n_frames)
    vertices = moving.vertices.copy()
    vertices[n_frames // 2 :] = vertices[n_frames // 2]
    vertices[n_frames // 2 :, :, 2] *= 1 + 0.01 * np.arange(n_frames // 2)[:, None]
    return meshreel.MeshSequence(vertices, moving.faces, 25.0, "resting")


def test_differences_of_equal_blocks_take_hardly_any_bits():
    period = waving_grid(25)
    # Motion of full rank: columns beyond the rank would be rounding errors, of any size in bits.
    noise = np.random.default_rng(4).normal(scale=0.1, size=period.vertices.shape)
    vertices = np.concatenate([period.vertices + noise] * 3)
    result = figures(dictionaries_run(meshreel.MeshSequence(vertices, period.faces, 25.0, "loop")))
    assert result["kept_difference"] < 0.05 * result["kept_whole"]
    assert result["kept_difference_plain"] < 0.05 * result["kept_whole_plain"]
    assert result["all_whole"] > 8


def test_a_single_block_has_no_differences():
    result = figures(dictionaries_run(waving_grid(12)))
    assert result["kept_whole"] is None
    assert result["kept_difference"] is None


def test_blocks_at_rest_have_less_motion_and_fewer_bits():
    result = figures(quiet_blocks_run(with_rest()))
    motion, bits = result["motion_percent"], result["bits"]
    assert len(motion) == len(bits) == 3
    assert motion[2] < 0.2 * motion[0]
    assert bits[2] < 0.5 * bits[0]


def test_modes_of_all_blocks_omit_the_same_energy_of_a_frame():
    noise = np.random.default_rng(4).normal(scale=0.01, size=(60, 99, 3))
    vertices = with_rest().vertices + noise * np.linspace(1, 0, 60)[:, None, None]
    result = figures(quiet_blocks_run(meshreel.MeshSequence(vertices, with_rest().faces)))
    shapes = vertices - vertices.mean(axis=1, keepdims=True)
    allowed = runs.OMITTED_ENERGY * np.square(shapes).sum() / 60
    center = (vertices.min(axis=(0, 1)) + vertices.max(axis=(0, 1))) / 2
    for block, n_modes in zip(np.split(vertices - center, 3), result["n_modes"], strict=True):
        energies = np.square(np.linalg.svd(block.transpose(2, 0, 1), compute_uv=False)).sum(axis=0)
        assert energies[n_modes:].sum() <= allowed * len(block) < energies[n_modes - 1 :].sum()


def test_motion_is_the_rms_displacement_from_frame_to_frame():
    grid = waving_grid(1)
    offsets = 0.02 * np.arange(25)[:, None, None] * np.array([1.0, 0.0, 0.0])
    sequence = meshreel.MeshSequence(grid.vertices + offsets, grid.faces, 25.0, "slide")
    diagonal = np.linalg.norm(np.ptp(sequence.vertices, axis=(0, 1)))
    (motion,) = figures(quiet_blocks_run(sequence))["motion_percent"]
    assert motion == pytest.approx(100 * 0.02 / diagonal, rel=1e-6)


@pytest.mark.slow
def test_sequence_is_repeated_until_it_is_long(monkeypatch):
    assert runs.LONG_FRAMES > 1000
    monkeypatch.setattr(runs, "LONG_FRAMES", 120)  # eigenvectors of 1,200 frames take seconds
    result = figures(long_run(waving_grid(50, 4, 4), TableSettings(modes=3, block_modes=2)))
    assert result["n_frames"] == 150
    for method in ("blocks", "pca-qp"):
        assert result[method]["encode_processor"] > 0 < result[method]["decode_processor"]


def test_full_decomposition_has_all_frequencies(monkeypatch):
    computed = []
    monkeypatch.setattr(runs, "graph_fourier_basis", lambda _, n_modes: computed.append(n_modes))
    result = figures(full_decomposition_run(waving_grid(3, 8, 8)))
    assert computed == [result["n_verts"]] == [64]
    assert result["memory_bytes"] == 2 * 8 * 64**2
    assert result["machine"]["cores"] > 0
    assert result["seconds"] > 0 <= result["processor_seconds"]


def test_full_decomposition_is_refused_when_it_takes_too_long(monkeypatch):
    monkeypatch.setattr(runs, "estimated_seconds", lambda *_: 601.0)
    monkeypatch.setattr(runs, "graph_fourier_basis", lambda *_: pytest.fail("computed"))
    with pytest.raises(InvalidInputError, match=r"about 10 minutes \(an estimate\)"):
        figures(full_decomposition_run(waving_grid(3, 8, 8)))
