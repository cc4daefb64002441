"""Comparison with Draco on sequences whose faces change."""

import numpy as np
import pytest

import meshreel
from meshreel.evaluation import surfaces
from meshreel.evaluation.peers import peers_named
from meshreel.evaluation.positions import PEERS
from meshreel.model.sequence import MeshFrame
from meshreel.model.tracks import Track
from meshreel.runtime.progress import silent
from meshreel.studies.study import evaluate
from samples.meshes import waving_grid


@pytest.fixture(autouse=True)
def few_samples(few_grid_lines, monkeypatch):
    monkeypatch.setattr(surfaces, "N_SAMPLES", 300)


@pytest.fixture
def changing():
    grids = [waving_grid(2, 12, 10), waving_grid(1, 9, 14), waving_grid(2, 12, 10)]
    heat = np.random.default_rng(1).random((2, grids[0].n_verts))
    grids[0] = meshreel.MeshSequence(
        grids[0].vertices, grids[0].faces, 25, "wave", tracks={"heat": Track(heat)}
    )
    return meshreel.concatenate(grids)


@pytest.mark.slow
def test_a_report_of_changing_faces_has_figures_of_reel_and_draco(changing, tmp_path):
    pytest.importorskip("DracoPy")
    study = surfaces.compare_surface_codecs(
        ("reel", "v2v"), peers_named(["draco", "npz"], PEERS), quick=True
    )
    result = evaluate(study, [changing], tmp_path / "out")
    [[results, pictures]] = result.measured
    assert [run["codec"] for run in results.measured] == ["reel"] * 3 + ["draco"] * 2
    assert results.sequence["n_segments"] == 3
    n_positions = sum(len(frame.vertices) for frame in changing)
    for run in results.measured:
        assert run["rate_bpvf"] == pytest.approx(8 * run["size_bytes"] / n_positions)
        assert 0 < run["quality"]["rms_distance_percent"] < run["quality"]["max_distance_percent"]
        assert run["quality"]["n_frames"] == surfaces.MAX_COMPARED_QUICK
    rates, errors = zip(*results.curves(surfaces.KIND.errors[0])["reel"], strict=True)
    assert list(errors) == sorted(errors, reverse=True)
    assert rates[-1] > rates[0]
    assert pictures[0].path.stat().st_size > 5000
    [line] = result.notes
    assert "`v2v`, `npz`" in line
    text = result.report.read_text()
    assert "5 frames in 3 segments, up to 126 vertices" in text
    assert line in text
    assert "| reel step 0.0002" in text


def test_sizes_of_ours_are_those_of_streams_without_order_and_tracks(changing):
    study = surfaces.compare_surface_codecs(peers=(), quick=True)
    [first, *_] = study.plan(changing)["measured"]
    figures = first.measure(silent).figures
    plain = [
        meshreel.MeshSequence(segment.vertices, segment.faces, segment.fps)
        for segment in changing.segments
    ]
    step = first.setting["options"]["step"]
    data = meshreel.encode(
        meshreel.MeshSequence.of_segments(plain, "wave"),
        step=step,
        order="drop",
        effort=first.setting["options"]["effort"],
    )
    assert figures["size_bytes"] == len(data)


def test_errors_grow_with_the_distance_of_the_surfaces(changing):
    frames = list(changing)[:2]
    moved = [MeshFrame(frame.vertices + np.float32([0, 0, 0.01]), frame.faces) for frame in frames]
    same, other = (surfaces.errors_of(frames, one, silent) for one in (frames, moved))
    assert same["rms_distance_percent"] == 0
    assert same["psnr_db"] == float("inf")
    assert 0 < other["rms_distance_percent"] < 1
    assert other["psnr_db"] > 30
