"""`meshreel paper`: reports and errors."""

import json
import sys

import pytest

import meshreel
from samples import commands
from samples.commands import assert_fails
from samples.figures import coarse_figures
from samples.meshes import waving_grid


def run(*arguments, cwd=None):
    """Run `meshreel paper ARGUMENTS`, and return the result."""
    return commands.run("paper", *arguments, cwd=cwd)


@pytest.fixture
def coarse():
    with coarse_figures():
        yield


@pytest.fixture
def grid(tmp_path):
    meshreel.save(waving_grid(5, 4, 5), tmp_path / "grid.npz")
    return tmp_path / "grid.npz"


@pytest.mark.slow
def test_paper_writes_a_report(grid, tmp_path, coarse):
    done = run("grid.npz", "--methods", "v2v", "--quick", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    printed = json.loads(done.stdout)
    (sequence,) = printed["sequences"]
    assert (sequence["name"], sequence["n_frames"]) == ("grid", 5)
    assert [variant["method"] for variant in sequence["variants"]] == ["v2v"]
    text = (tmp_path / "report" / "report.md").read_text()
    assert "meshreel paper grid.npz --out report --methods v2v --quick" in text
    assert all((tmp_path / name).stat().st_size > 1000 for name in sequence["figures"])
    assert (tmp_path / printed["report"]).read_text() == text


@pytest.mark.slow
def test_paper_reuses_its_folder_when_run_twice_on_the_flag(tmp_path, coarse):
    options = ("--frames", 2, "--methods", "v2v", "--quick", "--out", tmp_path / "r")
    texts = []
    for _ in range(2):
        done = run(*options)
        assert done.returncode == 0, done.stderr
        texts.append((tmp_path / "r" / "report.md").read_text())
    assert texts[0] == texts[1]
    assert "Table I, flag" in texts[0]


def test_paper_names_the_methods_when_one_is_unknown(tmp_path):
    done = run("--methods", "pca-x", "--out", tmp_path / "r")
    assert_fails(done, "method 'pca-x' is unknown; choose from pca, pca-q, v2v")
    assert not (tmp_path / "r").exists()


def test_paper_names_the_extra_before_any_work_when_matplotlib_is_missing(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert_fails(run("--out", tmp_path / "r"), "pip install 'meshreel[plot]'")
    assert not (tmp_path / "r").exists()


@pytest.mark.slow
def test_tables_use_the_options_for_modes_bits_and_anchors(grid, tmp_path, coarse):
    options = ("--modes", 3, "--bits", 6, "--allocation", "constant", "--anchors", 0.2,
               "--choices", "anchor-bits=12")  # fmt: skip
    done = run("grid.npz", *options, "--methods", "v2v,pca-qp", "--quick", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (sequence,) = json.loads(done.stdout)["sequences"]
    variants = {one["label"]: one for one in sequence["variants"]}
    assert set(variants) == {"v2v", "pca-qp"}
    assert {(variant["n_modes"], variant["bits"]) for variant in variants.values()} == {(3, 6)}
    assert variants["pca-qp"]["anchors"] == 0.2
    assert {variant["allocation"] for variant in variants.values()} == {"constant"}
    assert variants["pca-qp"]["shared"] == "anchor_bits=12"
    assert variants["v2v"]["shared"] == ""
    text = (tmp_path / "report" / "report.md").read_text()
    assert "--modes 3 --bits 6 --allocation constant --anchors 0.2 --choices anchor-bits=12" in text


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--bits", 40), "bits must be"),
        (("--anchors", 3), "anchors must be"),
        (("--preset", "mine"), "'mine' is not one of 'usual', 'printed'"),
        (("--allocation", "even"), "'even' is not one of 'energy', 'constant'"),
        (("--choices", "anchor-bits=99"), "choice anchor_bits must be"),
        (("--choices", "anchor-bits=9", "--methods", "v2v"), "has no effect on v2v"),
    ],
)
def test_paper_rejects_invalid_settings_before_any_work(tmp_path, options, words):
    done = run(*options, "--out", tmp_path / "r")
    assert_fails(done, words)
    assert not (tmp_path / "r").exists()


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("letter", "flag"),
    [("--k_l", "--modes"), ("--n-b", "--block-frames")],
)
def test_letters_of_the_paper_are_answered_with_our_flag(grid, letter, flag):
    done = commands.run("encode", grid, "--method", "blocks", letter, 3)
    assert_fails(done, f"No such option '{letter}'. Did you mean '{flag}'?")
