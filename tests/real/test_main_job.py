"""The main job on real sequences; they run where MESHREEL_DATA names their folder."""

import os
from pathlib import Path

import numpy as np
import pytest

import meshreel

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif("MESHREEL_DATA" not in os.environ, reason="MESHREEL_DATA is not set"),
]

# KG error in percent and bits per vertex and frame that the defaults must stay below.
LIMITS = {
    "samba": (2.0, 2.0),
    "jumping": (2.0, 3.0),
    "cow": (2.0, 2.5),
    "dance": (2.0, 1.5),
    "horse_gallop": (2.0, 2.5),
    "chicken": (4.0, 1.0),
    "bone": (2.0, 1.2),
    "balloons": (2.0, 3.0),
    "cesium_man": (2.0, 4.0),
}


def load(name):
    return meshreel.load(Path(os.environ["MESHREEL_DATA"]) / f"{name}.npz")


@pytest.mark.parametrize("name", LIMITS)
def test_sequence_comes_back_within_its_limits_when_coded_by_default(name):
    sequence = load(name)
    data = meshreel.encode(sequence)
    decoded = meshreel.decode(data)
    np.testing.assert_array_equal(decoded.faces, sequence.faces)
    kg_limit, rate_limit = LIMITS[name]
    assert meshreel.compare(sequence, decoded).kg_error_percent < kg_limit
    assert meshreel.info(data).rate_bpvf < rate_limit


def test_samba_comes_back_when_it_goes_in_as_a_folder_of_obj_files(tmp_path):
    sequence = load("samba")
    (tmp_path / "frames").mkdir()
    meshreel.save(sequence, tmp_path / "frames" / "samba_%d.obj")
    from_files = meshreel.load(tmp_path / "frames", fps=sequence.fps)
    np.testing.assert_array_equal(from_files.vertices, sequence.vertices)
    data = meshreel.encode(from_files, n_modes=20, bits=8, anchors=0.01)
    quality = meshreel.compare(sequence, meshreel.decode(data))
    assert quality.kg_error_percent < 2
    assert meshreel.info(data).rate_bpvf < 2


# Bits per vertex and frame (order dropped), KG error in percent and STED of `reel` at one step.
REEL_LIMITS = {
    "samba": (0.21, 0.65, 0.046),
    "jumping": (0.30, 0.92, 0.060),
    "cow": (0.36, 1.15, 0.078),
    "dance": (0.16, 0.60, 0.063),
    "horse_gallop": (0.70, 0.36, 0.052),
}


@pytest.mark.parametrize("name", REEL_LIMITS)
def test_reel_stays_within_its_limits_when_coded_with_the_default_step(name):
    sequence = load(name)
    rate_limit, kg_limit, sted_limit = REEL_LIMITS[name]
    quality = meshreel.compare(sequence, meshreel.decode(meshreel.encode(sequence, "reel")))
    smallest = meshreel.info(meshreel.encode(sequence, "reel", order="drop"))
    assert smallest.rate_bpvf < rate_limit
    assert quality.kg_error_percent < kg_limit
    assert quality.sted < sted_limit
