import re

import numpy as np
import pytest

import meshreel
from meshreel.paper.study import runs, study
from meshreel.paper.study.results import extrapolated_basis
from meshreel.paper.study.study import PaperStudy
from meshreel.paper.sweeps import Setting
from meshreel.runtime.progress import silent
from meshreel.studies.runs import Result, Store, result_of
from meshreel.studies.study import Subject, parts_of_report, to_markdown
from samples.meshes import waving_grid
from samples.paper_results import made_result, made_sequence


@pytest.mark.parametrize(("quick", "seconds"), [(False, 1.0), (True, 1.0), (False, 1e6)])
def test_all_frequencies_are_decomposed_unless_quick(quick, seconds, tmp_path, monkeypatch):
    monkeypatch.setattr(runs, "estimated_seconds", lambda *_: seconds)
    grid = waving_grid(3, 6, 6)
    subject = Subject(grid, "grid", Store.for_sequence(tmp_path, grid))
    groups: dict[str, list[Result]] = {
        **{name: [] for name in ("rows", "alternatives")},
        "claims": [{"refused": "not run"}],
    }
    results = study.PaperStudy(["gft"], quick).collect(
        subject, {**groups, "variants": [made_result("gft")]}, silent
    )
    assert results.decompositions["n_modes"] == 20
    if quick:
        assert results.full_decomposition is None
    elif seconds == 1.0:
        assert results.full_decomposition["n_verts"] == 36
    else:
        assert "all 36 graph frequencies" in results.full_decomposition["refused"]


def test_only_seconds_of_tables_are_measured_repeatedly(monkeypatch):
    asked = []

    def keep(sequence, setting, *, shown_frame, repeat):
        asked.append((setting, repeat))

    monkeypatch.setattr(study, "variant_run", keep)
    plan = study.PaperStudy(["pca-qp", "v2v"], quick=True).plan(waving_grid(12))
    n_tables = len(plan["variants"])
    assert 0 < n_tables < len(asked)
    assert [repeat for _, repeat in asked] == [True] * n_tables + [False] * (len(asked) - n_tables)


MEASURED = {"n_verts": 1000, "seconds": 2.0, "processor_seconds": 3.0, "memory_bytes": 16e6}


def test_basis_is_extrapolated_with_the_powers_of_time_and_memory():
    result = extrapolated_basis(MEASURED, 20_000, 152)
    assert result.seconds_each == pytest.approx(2.0 * 20**3)
    assert result.processor_seconds_each == pytest.approx(3.0 * 20**3)
    assert result.seconds == pytest.approx(152 * 2.0 * 20**3)
    assert result.processor_seconds == pytest.approx(152 * 3.0 * 20**3)
    assert result.memory_bytes == pytest.approx(16e6 * 20**2)


def test_text_names_the_extrapolation_and_its_source():
    assert extrapolated_basis(MEASURED, 20_000, 152).text == (
        "Extrapolated from one decomposition of 1,000 vertices, 2 s, with V^3: 20,000 vertices "
        "take 4 hours and 6.4 GB for one decomposition, 676 hours with one for each of 152 frames."
    )
    assert extrapolated_basis(MEASURED, 1000, 100).text == (
        "Extrapolated from one decomposition of 1,000 vertices, 2 s: 1,000 vertices take 2 s and "
        "16 MB for one decomposition, 3 minutes with one for each of 100 frames."
    )


SETTING = Setting("pca-qp", 4, anchors=0.05)


@pytest.fixture
def calls(monkeypatch):
    """The options of every call of `encode` by the runs."""
    made = []

    def counted(sequence, **options):
        made.append(options)
        return meshreel.encode(sequence, **options)

    monkeypatch.setattr(runs, "encode", counted)
    return made


@pytest.fixture
def store(tmp_path):
    return Store.for_sequence(tmp_path, waving_grid())


def test_stored_result_is_not_encoded_again(store, calls):
    first = result_of(runs.variant_run(waving_grid(), SETTING), store)
    assert len(calls) == 2  # order kept, order dropped
    assert result_of(runs.variant_run(waving_grid(), SETTING), store) == first
    assert len(calls) == 2


def test_result_agrees_with_its_stored_stream(store):
    sequence = waving_grid()
    result = result_of(runs.variant_run(sequence, SETTING, shown_frame=3), store)
    data = store.path(SETTING.key, "reel").read_bytes()
    smallest = meshreel.encode(sequence, **SETTING.options(), order="drop")
    decoded = meshreel.decode(data)
    assert result["rate_bpvf"] == 8 * len(data) / (12 * 99)
    assert result["rate_order_dropped_bpvf"] == 8 * len(smallest) / (12 * 99)
    assert result["quality"] == meshreel.compare(sequence, decoded).as_dict()
    np.testing.assert_array_equal(np.load(store.path(SETTING.key, "npy")), decoded.vertices[3])
    assert set(result["machine"]) >= {"cpu", "cores", "python", "numpy", "scipy"}


@pytest.mark.slow
def test_markdown_refers_to_existing_pictures(evaluation, folder):
    names = re.findall(r"!\[[^]]*\]\(([^)]*)\)", evaluation.report.read_text(encoding="utf-8"))
    assert len(names) == 7
    assert all((folder / name).is_file() for name in names)


@pytest.mark.slow
def test_report_contains_the_required_statements(evaluation):
    report = evaluation.report.read_text(encoding="utf-8")
    for words in (
        "meshreel paper --frames 12",
        "Table I, flag",
        "Table II, flag",
        "PCA+qs and PCA+qp have equal quality: yes",
        "frequencies, decomposed for each frame",
        "Extrapolated from 2 decompositions",
        "docs/equations.md",
        "NumPy",
    ):
        assert words in report, words


def test_report_contains_refusals(tmp_path):
    refused = {**made_result("gft"), "refused": "too <many> vertices"}
    results = made_sequence("samba", [made_result("pca"), refused])
    parts = parts_of_report(PaperStudy(), [(results, [])], "meshreel paper")
    assert "`gft` refused samba: too <many> vertices" in to_markdown(parts, tmp_path)


def test_report_compares_alternatives_if_they_were_measured(tmp_path):
    for alternatives in ([], [made_result("pca-qp", choices="anchor-bits=12")]):
        results = made_sequence("samba", [made_result("pca-qp")], alternatives=alternatives)
        parts = parts_of_report(PaperStudy(), [(results, [])], "meshreel paper")
        has_table = "What the paper leaves open, samba" in to_markdown(parts, tmp_path)
        assert has_table == bool(alternatives)


def test_report_distinguishes_jumping_from_handstand():
    results = made_sequence("jumping", [made_result("pca")])
    parts = parts_of_report(PaperStudy(), [(results, [])], "x")
    assert any("another sequence" in part for part in parts if isinstance(part, str))


@pytest.mark.parametrize(
    ("full", "words"),
    [
        ({"refused": "all 9971 graph frequencies would take about 2 hours"}, "would take about 2"),
        (
            {"n_verts": 9971, "seconds": 6.0, "processor_seconds": 6.0, "memory_bytes": 1.6e9},
            "All frequencies: Extrapolated from one decomposition of 9,971 vertices, 6 s:",
        ),
    ],
)
def test_note_below_the_seconds_explains_all_frequencies(full, words):
    results = made_sequence("samba", [made_result("gft")], full_decomposition=full)
    parts = parts_of_report(PaperStudy(), [(results, [])], "x")
    assert any(words in part for part in parts if isinstance(part, str))
