"""All example scripts and notebooks run."""

import ast
import json
import re
import subprocess
import sys

import numpy as np
import pytest

import meshreel
from samples.pages import ROOT

EXAMPLES = ROOT / "examples"
NOTEBOOKS = sorted(EXAMPLES.glob("*.ipynb"))


def code_cells(notebook):
    content = json.loads(notebook.read_text(encoding="utf-8"))
    return ["".join(cell["source"]) for cell in content["cells"] if cell["cell_type"] == "code"]


def run_cell(code, names):
    """Run a cell and, like a notebook, represent its last expression."""
    parsed = ast.parse(code)
    last = parsed.body[-1]
    is_shown = isinstance(last, ast.Expr) and not code.rstrip().endswith(";")
    if is_shown:
        parsed.body.pop()
    exec(compile(parsed, "cell", "exec"), names)
    if is_shown:
        shown = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
        show = getattr(shown, "_repr_html_", shown.__repr__)
        assert shown is None or show()


def run_script(name, *arguments):
    """Run a script as users do, and return its output."""
    command = [sys.executable, EXAMPLES / name, *map(str, arguments)]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


@pytest.mark.slow
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run(notebook, tmp_path, monkeypatch):
    plots = pytest.importorskip("matplotlib.pyplot", reason="the extra `plot` is not installed")
    pytest.importorskip("h5py", reason="the extra `hdf` is not installed")
    plots.switch_backend("agg")
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "__main__"}
    for code in code_cells(notebook):
        run_cell(code, names)
    plots.close("all")


def test_notebooks_are_stored_without_their_output():
    for notebook in NOTEBOOKS:
        cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
        assert not any(cell.get("outputs") or cell.get("execution_count") for cell in cells)


def test_readme_lists_every_example():
    page = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    listed = re.findall(r"\]\(([\w.]+\.(?:py|ipynb))\)", page)
    assert sorted(listed) == sorted(
        path.name for path in EXAMPLES.iterdir() if path.suffix in (".py", ".ipynb")
    )


@pytest.mark.slow
def test_a_character_becomes_a_file_and_pages(tmp_path):
    output = run_script("character_for_web.py", "--out", tmp_path)
    assert "612 kB became" in output
    fish = meshreel.load(tmp_path / "fish.glb")
    assert meshreel.compare(fish, tmp_path / "fish.reel").max_error_percent < 0.1
    assert meshreel.load(tmp_path / "fish.reel").surface.attributes[0].kind == meshreel.Kind.COLOR
    page, stream = ((tmp_path / name).stat().st_size for name in ("fish.html", "fish.reel"))
    assert page - stream * 4 / 3 > 190_000  # the player, besides the stream in base64
    assert 'src="fish.reel"' in (tmp_path / "index.html").read_text()


@pytest.mark.slow
def test_a_character_of_another_program_is_kept_within_a_size(tmp_path):
    flag = meshreel.simulate_flag(12, n_rows=12, n_columns=16)
    meshreel.save(flag, tmp_path / "flag.npz")
    out = tmp_path / "site"
    run_script("character_for_web.py", tmp_path / "flag.npz", "--size", "4kB", "--out", out)
    assert (out / "flag.reel").stat().st_size <= 4000


@pytest.mark.slow
def test_adaptive_subspaces_have_more_modes_and_smaller_errors_with_smaller_limits():
    arguments = ("--modes", "2", "--errors", "0.05,0.01")
    _, fixed, *adaptive = run_script("adaptive_subspace.py", *arguments).splitlines()
    kg = [float(line.split()[-2]) for line in adaptive]
    assert fixed.startswith("2 modes")
    assert 0 < kg[1] < kg[0] < 3


@pytest.mark.slow
def test_a_capture_is_registered(tmp_path):
    pytest.importorskip("igl", reason="libigl is not installed")
    path = tmp_path / "walk.reel"
    output = run_script("register_capture.py", "--frames", "5", "--out", path)
    assert "raw: frames 5, meshes 5" in output
    with meshreel.open(path) as reel:  # one segment
        assert len(reel) == 5


@pytest.mark.slow
def test_a_simulation_decodes_within_its_bounds(tmp_path):
    output = run_script("archive_simulation.py", "--out", tmp_path / "plate.reel")
    assert "temperature: scalar of each vertex, float32 in K, within 0.5 K" in output
    with meshreel.open(tmp_path / "plate.reel") as reel:
        heat, phase = reel.track("temperature"), reel.track("phase")
        assert heat[0].max() < 294 < 600 < heat[-1].max()
        assert (phase[0].sum(), phase[-1].dtype) == (0, np.uint8)
        assert phase[-1].sum() > 100


@pytest.mark.slow
def test_a_solver_is_recorded_with_its_cells(tmp_path):
    pytest.importorskip("skfem", reason="scikit-fem is not installed")
    output = run_script("record_solver.py", "--out", tmp_path / "twist.reel", "--across", 2)
    assert "81 nodes, 192 tetrahedra, 31 steps" in output
    result = meshreel.decode((tmp_path / "twist.reel").read_bytes())
    assert result.surface.cells.n_solids == 192
    assert result.times.tolist() == list(range(31))
    stress = result.tracks["stress"]
    assert (stress.domain, stress.unit) == ("cell", "Pa")
    assert abs(stress[0]).max() < 0.01 * stress[30].max()
    turned = result.vertices[30, result.vertices[0, :, 0] > 3.99] - [4, 0, 0]
    assert np.linalg.norm(turned, axis=1).max() == pytest.approx(np.sqrt(0.5), abs=0.01)


@pytest.mark.slow
def test_a_recording_whose_recorder_is_killed_can_be_read(tmp_path):
    path = tmp_path / "crashed.reel"
    output = run_script("record.py", "--seconds", 60, "--crash-after", 2.5, "--out", path)
    assert "killed the recorder" in output
    with meshreel.open(path) as reel:
        assert len(reel) >= 20
        assert np.isfinite(reel[len(reel) - 1].vertices).all()


@pytest.mark.slow
def test_a_recording_contains_all_frames(tmp_path):
    output = run_script("record.py", "--seconds", 2.5, "--out", tmp_path / "a.reel")
    assert "recorded 62 frames" in output
    with meshreel.open(tmp_path / "a.reel") as reel:
        assert len(reel) == 62


@pytest.mark.slow
def test_a_network_beats_constant_velocity(tmp_path):
    pytest.importorskip("torch", reason="the extra [torch] is not installed")
    output = run_script("train.py", "--epochs", 3)
    ours, constant_velocity = map(float, re.findall(r"([\d.]+) %", output.splitlines()[-1]))
    assert ours < 0.8 * constant_velocity


@pytest.mark.slow
def test_folders_of_obj_files_become_files_for_an_engine(tmp_path):
    out = tmp_path / "out"
    assert "2 encoded, 0 failed" in run_script("obj_folders.py", "--out", out)
    for clip in ("banner", "pennant"):
        original = meshreel.load(out / "clips" / clip, fps=30)
        quality = meshreel.compare(original, out / "streams" / f"{clip}.reel")
        assert quality.max_error_percent <= 0.1
        assert meshreel.load(out / "streams" / f"{clip}.glb", fps=30).n_frames == 48
    assert "2 up to date, 0 encoded" in run_script("obj_folders.py", "--out", out)
