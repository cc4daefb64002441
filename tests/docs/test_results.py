"""Figures of the pages match the stored results, and these match the codec."""

import re
import runpy
from pathlib import Path

import pytest

import meshreel
from meshreel.evaluation.recorded import read_recorded

ROOT = Path(__file__).parents[2]
SCRIPT = runpy.run_path(str(ROOT / "docs" / "result_tables.py"))
PAGES, TABLES, FIGURES, results, with_tables = (
    SCRIPT[name] for name in ("PAGES", "TABLES", "FIGURES", "results", "with_tables")
)
TOLERANCE = 0.02
"""Relative: eigenvectors and solutions differ in their last bits between machines."""


@pytest.mark.every_case
@pytest.mark.parametrize("page", PAGES)
def test_tables_of_a_page_match_the_stored_results(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    assert with_tables(text) == text, "run python docs/result_tables.py --write"


def test_every_table_and_figure_is_in_a_page():
    text = "".join((ROOT / page).read_text(encoding="utf-8") for page in PAGES)
    assert [name for name in [*TABLES, *FIGURES] if f"<!-- results: {name} -->" not in text] == []


@pytest.mark.parametrize("page", PAGES)
def test_figures_in_a_line_do_not_begin_it(page):
    """A comment at the beginning of a line ends the paragraph."""
    text = (ROOT / page).read_text(encoding="utf-8")
    assert re.findall(r"^\s*<!-- results: .+ -->.+", text, re.MULTILINE) == []


@pytest.mark.every_case
@pytest.mark.parametrize("name", ["paper", "codecs", "anchors", "corpus", "checks"])
def test_results_state_their_commit(name):
    commit = results(name)["commit"]
    assert len(commit) == 12
    assert int(commit, 16)


def test_points_to_download_are_read_as_a_reference_and_cover_all_methods():
    points = read_recorded(ROOT / "docs" / "results" / "rd.csv")
    codecs = {point["codec"] for point in points}
    methods = "pca", "pca-q", "v2v", "pca-qs", "pca-qp", "blocks", "gft", "reel", "lossless"
    assert codecs == {f"meshreel {method} (recorded)" for method in methods}
    sequences = {point["sequence"]["name"] for point in points}
    assert sequences == {one["name"] for one in results("paper")["sequences"]}


@pytest.fixture(scope="module")
def flag():
    return meshreel.simulate_flag(results("checks")["n_frames"])


@pytest.mark.slow
@pytest.mark.every_case
@pytest.mark.parametrize("method", ["reel", "pca-qp", "v2v", "blocks"])
def test_stored_figures_still_hold(method, flag):
    """A change of the codec that changes them requires measuring all pages again."""
    stored = results("checks")["methods"][method]
    data = meshreel.encode(flag, method, **stored["options"])
    quality = meshreel.compare(flag, meshreel.decode(data))
    assert meshreel.info(data).rate_bpvf == pytest.approx(stored["rate_bpvf"], rel=TOLERANCE)
    assert quality.kg_error_percent == pytest.approx(stored["kg_error_percent"], rel=TOLERANCE)
    assert quality.sted == pytest.approx(stored["sted"], rel=TOLERANCE)


def test_changes_of_an_alternative_are_means_over_its_sets():
    error, rate = "kg_error_percent", "rate_order_dropped_bpvf"
    labels = [f"pca-qp (random anchors {number})" for number in (1, 2, 3)]
    alternatives = [
        {"label": labels[0], error: 1.2, rate: 2.0},
        {"label": labels[1], error: 1.4, rate: 2.2},
        {"label": labels[2], "refused": "too few vertices"},
    ]
    variants = [{"label": "pca-qp", error: 1.0, rate: 2.0}]
    sequence = {"variants": variants, "alternatives": alternatives}
    assert SCRIPT["_changes"](sequence, labels) == "+30.0, +5.0"
    assert SCRIPT["_changes"](sequence, labels[2:]) == "-"
