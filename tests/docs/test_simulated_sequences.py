"""The simulated sequences of bench/ are as described."""

import runpy
import sys

import numpy as np

import meshreel
from samples.pages import ROOT


def run_script(name, monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
    runpy.run_path(str(ROOT / "bench" / name), run_name="__main__")


def test_a_cloth_falls_and_stays_outside_the_sphere_and_the_floor(tmp_path, monkeypatch, capsys):
    path = tmp_path / "cloth.npz"
    run_script("falling_cloth.py", monkeypatch, "--frames", "14", "--side", "24", "--out", path)
    assert "pca-qp" in capsys.readouterr().out
    cloth = meshreel.load(path)
    heights = cloth.vertices[:, :, 1]
    assert np.ptp(heights[-1]) > 0.5 > 10 * np.ptp(heights[0])
    assert heights.min() >= np.float32(-0.42)
    from_sphere = cloth.vertices - np.array([0.12, 0.0, -0.07])
    assert np.linalg.norm(from_sphere, axis=2).min() > 0.3 - 1e-6


def test_heat_spreads_and_decodes_within_its_bounds(tmp_path, monkeypatch, capsys):
    path = tmp_path / "sphere.reel"
    shape = ["--vertices", "400", "--frames", "20"]
    run_script("heat_on_a_sphere.py", monkeypatch, *shape, "--out", path)
    assert (
        "temperature: scalar of each vertex, float32 in K, within 0.1 K" in capsys.readouterr().out
    )
    with meshreel.open(path) as reel:
        heat = reel.track("temperature")
        assert np.ptp(heat[0]) > 1.4 * np.ptp(heat[-1])
        assert reel.track("heat flow").shape == (20, reel.n_faces, 3)


def test_an_animal_is_a_closed_surface_that_moves(tmp_path, monkeypatch, capsys):
    path = tmp_path / "animal.npz"
    run_script(
        "dense_animal.py", monkeypatch, "--frames", "7", "--subdivisions", "3", "--out", path
    )
    assert "pca-qp" in capsys.readouterr().out
    animal = meshreel.load(path)
    assert animal.n_verts == 642
    edges = animal.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    assert len(np.unique(edges, axis=0)) == len(edges)  # each half-edge occurs once
    assert {tuple(edge) for edge in edges} == {tuple(edge) for edge in edges[:, ::-1]}
    moved = np.linalg.norm(animal.vertices[6] - animal.vertices[0], axis=1)
    assert np.median(moved) < 0.1 < moved.max()
