"""The paper's claims on its own sequence, from streams."""

import os
from pathlib import Path

import pytest

from meshreel.evaluation.paper.measure import variant_run
from meshreel.evaluation.paper.results import PaperResults
from meshreel.evaluation.paper.settings import variants
from meshreel.evaluation.paper.tables import rate_table
from meshreel.evaluation.runs.run import result_of
from meshreel.evaluation.runs.store import Store
from meshreel.formats.load import load

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif("MESHREEL_DATA" not in os.environ, reason="MESHREEL_DATA is not set"),
]
QUICK_METHODS = ("pca", "pca-q", "v2v", "pca-qp", "blocks")


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Results of all variants but the slow ones."""
    sequence = load(Path(os.environ["MESHREEL_DATA"]) / "samba.npz")
    store = Store.for_sequence(tmp_path_factory.mktemp("results"), sequence)
    settings = variants(sequence.n_frames, QUICK_METHODS)
    return PaperResults(
        "samba", store.sequence, [result_of(variant_run(sequence, s), store) for s in settings]
    )


@pytest.mark.parametrize(
    ("label", "printed"), [("pca-q", 0.2808), ("v2v", 0.2808), ("pca-qp", 0.2808)]
)
def test_dictionary_rate_is_the_printed_one_when_there_is_one_block(results, label, printed):
    assert results.variant(label)["paper_count"]["q_d"] == pytest.approx(printed, abs=5e-5)


def test_anchor_rate_is_the_printed_one_up_to_an_anchor_when_they_are_one_percent(results):
    # Printed is 0.1595, which would be 99.4 anchors; here they are 100.
    found = results.variant("pca-qp")["paper_count"]["q_a"]
    assert found == pytest.approx(0.1595, abs=16 / 9971)


def test_table_holds_the_printed_figures_when_the_sequence_is_samba(results):
    assert "q, paper" in rate_table(results).header


def test_deltas_are_smoother_than_vertices_when_rates_are_alike(results):
    deltas, vertices = results.variant("pca-qp"), results.variant("v2v")
    assert deltas["rate_order_dropped_bpvf"] < vertices["rate_order_dropped_bpvf"]
    assert deltas["quality"]["sted"] < 0.5 * vertices["quality"]["sted"]


def test_anchors_take_away_most_of_the_error_when_they_are_added(results):
    without, with_anchors = (
        results.variant(label)["quality"]["kg_error_percent"] for label in ("pca-q", "pca-qp")
    )
    assert with_anchors < 0.3 * without


def test_blocks_cost_more_when_each_has_its_own_rows(results):
    blocks, whole = (results.variant(label)["paper_count"]["q"] for label in ("blocks", "pca-qp"))
    assert 1.2 * whole < blocks < 3 * whole
