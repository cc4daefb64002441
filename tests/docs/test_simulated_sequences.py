"""The simulated sequences of bench/ are as described."""

import runpy
import sys

import numpy as np

import meshreel
from samples.pages import ROOT


def run_script(name, monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
    runpy.run_path(str(ROOT / "bench" / name), run_name="__main__")


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
