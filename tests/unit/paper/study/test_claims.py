"""Runs behind single claims: figures of small sequences, verified independently."""

import numpy as np
import pytest

import meshreel
from meshreel.errors import InvalidInputError
from meshreel.paper.study import runs
from meshreel.paper.study.runs import (
    dictionaries_run,
    full_decomposition_run,
    long_run,
    quiet_blocks_run,
)
from meshreel.paper.sweeps import TableSettings
from meshreel.runtime.progress import silent
from samples.meshes import waving_grid


def figures(run):
    return run.measure(silent).figures


def with_rest(n_frames=60):
    """A sheet that waves, then hardly moves."""
    moving = waving_grid(n_frames)
    vertices = moving.vertices.copy()
    vertices[n_frames // 2 :] = vertices[n_frames // 2]
    vertices[n_frames // 2 :, :, 2] *= 1 + 0.01 * np.arange(n_frames // 2)[:, None]
    return meshreel.MeshSequence(vertices, moving.faces, 25.0, "resting")


def test_differences_of_equal_blocks_take_hardly_any_bits():
    period = waving_grid(25)
    # Motion of full rank: columns beyond the rank would be rounding errors, of any size in bits.
    noise = np.random.default_rng(4).normal(scale=0.1, size=period.vertices.shape)
    vertices = np.concatenate([period.vertices + noise] * 3)
    result = figures(dictionaries_run(meshreel.MeshSequence(vertices, period.faces, 25.0, "loop")))
    assert result["kept_difference"] < 0.05 * result["kept_whole"]
    assert result["kept_difference_plain"] < 0.05 * result["kept_whole_plain"]
    assert result["all_whole"] > 8


def test_a_single_block_has_no_differences():
    result = figures(dictionaries_run(waving_grid(12)))
    assert result["kept_whole"] is None
    assert result["kept_difference"] is None


def test_blocks_at_rest_have_less_motion_and_fewer_bits():
    result = figures(quiet_blocks_run(with_rest()))
    motion, bits = result["motion_percent"], result["bits"]
    assert len(motion) == len(bits) == 3
    assert motion[2] < 0.2 * motion[0]
    assert bits[2] < 0.5 * bits[0]


def test_motion_is_the_rms_displacement_from_frame_to_frame():
    grid = waving_grid(1)
    offsets = 0.02 * np.arange(25)[:, None, None] * np.array([1.0, 0.0, 0.0])
    sequence = meshreel.MeshSequence(grid.vertices + offsets, grid.faces, 25.0, "slide")
    diagonal = np.linalg.norm(np.ptp(sequence.vertices, axis=(0, 1)))
    (motion,) = figures(quiet_blocks_run(sequence))["motion_percent"]
    assert motion == pytest.approx(100 * 0.02 / diagonal, rel=1e-6)


@pytest.mark.slow
def test_sequence_is_repeated_until_it_is_long(monkeypatch):
    assert runs.LONG_FRAMES > 1000
    monkeypatch.setattr(runs, "LONG_FRAMES", 120)  # eigenvectors of 1,200 frames take seconds
    result = figures(long_run(waving_grid(50, 4, 4), TableSettings(modes=3, block_modes=2)))
    assert result["n_frames"] == 150
    for method in ("blocks", "pca-qp"):
        assert result[method]["encode_processor"] > 0 < result[method]["decode_processor"]


def test_full_decomposition_has_all_frequencies(monkeypatch):
    computed = []
    monkeypatch.setattr(runs, "graph_fourier_basis", lambda _, n_modes: computed.append(n_modes))
    result = figures(full_decomposition_run(waving_grid(3, 8, 8)))
    assert computed == [result["n_verts"]] == [64]
    assert result["memory_bytes"] == 2 * 8 * 64**2
    assert result["machine"]["cores"] > 0
    assert result["seconds"] > 0 <= result["processor_seconds"]


def test_full_decomposition_is_refused_when_it_takes_too_long(monkeypatch):
    monkeypatch.setattr(runs, "estimated_seconds", lambda *_: 601.0)
    monkeypatch.setattr(runs, "graph_fourier_basis", lambda *_: pytest.fail("computed"))
    with pytest.raises(InvalidInputError, match=r"about 10 minutes \(an estimate\)"):
        figures(full_decomposition_run(waving_grid(3, 8, 8)))
