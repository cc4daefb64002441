from meshreel.paper.study import study
from meshreel.paper.study.findings import _relative_differences
from samples.meshes import waving_grid


def test_only_seconds_of_tables_are_measured_repeatedly(monkeypatch):
    asked = []

    def keep(sequence, setting, *, shown_frame, repeat):
        asked.append((setting, repeat))

    monkeypatch.setattr(study, "variant_run", keep)
    plan = study.PaperStudy(["pca-qp", "v2v"], quick=True).plan(waving_grid(12))
    n_tables = len(plan["variants"])
    assert 0 < n_tables < len(asked)
    assert [repeat for _, repeat in asked] == [True] * n_tables + [False] * (len(asked) - n_tables)


def test_differences_are_relative_to_the_second(made_result):
    first, second, exact = (made_result("v2v", error=error) for error in (3.0, 4.0, 0.0))
    figures = (("kg_error_percent", "KG"),)
    assert _relative_differences(first, second, figures) == {"KG": 0.25}
    assert _relative_differences(first, exact, figures) == {"KG": 3.0}
