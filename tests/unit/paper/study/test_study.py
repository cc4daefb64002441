import pytest

from meshreel.paper.study import runs, study
from meshreel.runtime.progress import silent
from meshreel.studies.runs import Result, Store
from meshreel.studies.study import Subject
from samples.meshes import waving_grid
from samples.paper_results import made_result


@pytest.mark.parametrize(("quick", "seconds"), [(False, 1.0), (True, 1.0), (False, 1e6)])
def test_all_frequencies_are_decomposed_unless_quick(quick, seconds, tmp_path, monkeypatch):
    monkeypatch.setattr(runs, "estimated_seconds", lambda *_: seconds)
    grid = waving_grid(3, 6, 6)
    subject = Subject(grid, "grid", Store.for_sequence(tmp_path, grid))
    groups: dict[str, list[Result]] = {
        **{name: [] for name in ("rows", "sweep", "alternatives")},
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
