"""Commands list the ignored contents of a file in their JSON."""

import json

import numpy as np
import pytest

from meshreel.formats.save import save
from samples.commands import run_json
from samples.meshes import waving_grid

NOTE = (
    "left out: arrays: pressure; tracks are numbers of shape (12, N) or (12, N, C), C up to 256, "
    "for 99 vertices, 160 faces and 480 corners"
)


@pytest.fixture
def odd(tmp_path):
    """A file with an array that the reader ignores."""
    grid = waving_grid()
    path = tmp_path / "odd.npz"
    np.savez(path, vertices=grid.vertices, faces=grid.faces, fps=24.0, pressure=np.zeros(3))
    return path


@pytest.mark.parametrize(
    ("command", "options"),
    [
        ("encode", ["-o", "a.reel"]),
        ("convert", ["-o", "a.h5"]),
        ("compare", ["plain.npz"]),
        ("render", ["-o", "a.png", "--frames", "1", "--size", "160x120"]),
        pytest.param(
            "paper", ["--out", "report", "--quick", "--methods", "pca"], marks=pytest.mark.slow
        ),
        pytest.param(
            "evaluate",
            ["--out", "report", "--quick", "--methods", "reel", "--peers", "blosc2"],
            marks=pytest.mark.slow,
        ),
    ],
)
def test_json_notes_ignored_contents(odd, tmp_path, command, options):
    save(waving_grid(), tmp_path / "plain.npz")
    assert NOTE in run_json(command, odd, *options, cwd=tmp_path)["notes"]


def test_encode_notes_an_unknown_frame_rate(tmp_path):
    save(waving_grid(3), tmp_path / "f_%d.obj")
    arguments = ["encode", *sorted(tmp_path.glob("*.obj")), "--force", "-o", "a.reel"]
    [note] = run_json(*arguments, cwd=tmp_path)["notes"]
    assert note.endswith("players assume 24 frames per second; set it with --fps")
    assert run_json(*arguments, "--fps", "25", cwd=tmp_path)["notes"] == []


def test_json_of_export_notes_ignored_contents_of_the_original(odd, tmp_path):
    save(waving_grid(), tmp_path / "plain.reel")
    figures = run_json("export", "plain.reel", "--original", odd, "-o", "a.html", cwd=tmp_path)
    assert NOTE in figures["notes"]


@pytest.mark.slow
def test_manifest_notes_ignored_contents(odd, tmp_path):
    run_json("batch", tmp_path, tmp_path / "out", "--workers", "1")
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert manifest["inputs"]["odd.npz"]["notes"] == [NOTE]


@pytest.mark.slow
def test_report_notes_ignored_tracks(tmp_path):
    grid = waving_grid()
    arrays = {"vertices": grid.vertices, "faces": grid.faces, "heat": np.zeros((12, 99))}
    np.savez(tmp_path / "a.npz", **arrays)
    options = ["--out", "report", "--quick", "--methods", "pca"]
    figures = run_json("paper", tmp_path / "a.npz", *options, cwd=tmp_path)
    assert "left out: tracks, as the report covers positions: heat" in figures["notes"]
    assert "drop the tracks" not in (tmp_path / "report" / "report.md").read_text()
