"""Choice and savings of cosines over time and of adaptive times."""

import numpy as np
import pytest

import meshreel
from meshreel.codec.reel.encoding import basis_coding
from meshreel.codec.reel.encoding.basis_coding import MIN_ADAPTIVE_FRAMES, cheapest_coding
from meshreel.kernel.basis import BY_TIMES, MAX_COSINES, BasisCoding, basis_vectors, quantized_basis
from samples.meshes import waving_grid
from samples.streams import layouts

RATE_WEIGHT = 0.116


def periodic(n_frames=48, side=14, period=24):
    """A sheet whose vertices repeat different smooth motions."""
    sheet = waving_grid(1, side, side, np.float64)
    rng, angles = np.random.default_rng(3), 2.0 * np.pi * np.arange(n_frames) / period
    waves = np.concatenate([np.sin(k * angles + k)[:, None] / k for k in range(1, 7)], axis=1)
    moves = np.tensordot(waves, 0.1 * rng.normal(size=(6, side * side, 3)), 1)
    return meshreel.MeshSequence((sheet.vertices + moves).astype(np.float32), sheet.faces)


def assert_saves(sequence, data, usual, share):
    """The stream takes at most a share of the bytes of the usual one, for the same error."""
    assert len(data) < share * len(usual)
    errors = [meshreel.compare(sequence, meshreel.decode(one)) for one in (data, usual)]
    assert errors[0].kg_error_percent < 1.02 * errors[1].kg_error_percent


def test_periodic_motion_takes_fewer_bytes_as_cosines(monkeypatch):
    sequence = periodic()
    encoded = meshreel.encode(sequence)
    monkeypatch.setattr(basis_coding, "MIN_COSINE_GAIN", 1.0)
    usual = meshreel.encode(sequence)
    assert [layout.coding.has_cosines for layout in layouts(encoded)] == [True]
    assert_saves(sequence, encoded, usual, 0.97)


def test_fields_are_reused_in_blocks_with_cosines():
    sequence = periodic(72)
    result = layouts(meshreel.encode(sequence, block_frames=24, quality=90))
    assert [layout.coding.has_cosines for layout in result] == [True] * 3
    assert all(layout.n_reused for layout in result[1:])


def test_sudden_motion_is_coded_by_times():
    steps = np.random.default_rng(2).normal(size=(4, 3, 80)) * (np.arange(80) % 9 == 0)
    assert not cheapest_coding(40.0 * np.cumsum(steps, axis=2), RATE_WEIGHT).has_cosines


@pytest.mark.parametrize(
    ("targets", "rate_weight"),
    [
        (np.zeros((0, 3, 9)), RATE_WEIGHT),
        (np.zeros((2, 3, 1)), RATE_WEIGHT),
        (np.full((2, 3, 9), 2.0**28), RATE_WEIGHT),  # coefficients would be too large
        (np.ones((2, 3, MAX_COSINES + 1)), RATE_WEIGHT),
        (np.zeros((2, 3, 9)), 0.0),
    ],
)
def test_times_are_coded_when_cosines_save_nothing_or_are_impossible(targets, rate_weight):
    assert cheapest_coding(targets, rate_weight) == BY_TIMES


def shaking(n_frames=120, side=8):
    """A shaking sheet: polynomials through adjacent times predict it badly."""
    sheet = waving_grid(1, side, side, np.float64)
    rng = np.random.default_rng(20)
    waves = rng.normal(size=(n_frames, 12)) / np.arange(1, 13)
    moves = np.tensordot(waves, 0.1 * rng.normal(size=(12, side * side, 3)), 1)
    return meshreel.MeshSequence((sheet.vertices + moves).astype(np.float32), sheet.faces)


def test_irregular_motion_takes_fewer_bytes_by_adaptive_times(monkeypatch):
    monkeypatch.setattr(basis_coding, "MIN_COSINE_GAIN", 1.0)
    sequence = shaking()
    encoded = meshreel.encode(sequence, quality=70)
    monkeypatch.setattr(basis_coding, "MIN_ADAPTIVE_GAIN", 1.0)
    usual = meshreel.encode(sequence, quality=70)
    assert [layout.coding.is_adaptive for layout in layouts(encoded)] == [True]
    assert_saves(sequence, encoded, usual, 0.98)


def test_fields_are_reused_in_blocks_with_adaptive_times(monkeypatch):
    monkeypatch.setattr(basis_coding, "MIN_ADAPTIVE_GAIN", -np.inf)
    monkeypatch.setattr(basis_coding, "MIN_COSINE_GAIN", 1.0)
    sequence = periodic(72)
    data = meshreel.encode(sequence, block_frames=24, quality=90)
    result = layouts(data)
    assert all(layout.coding.is_adaptive for layout in result)
    assert all(layout.n_reused for layout in result[1:])
    usual = meshreel.compare(sequence, meshreel.decode(data)).kg_error_percent
    monkeypatch.setattr(basis_coding, "MIN_ADAPTIVE_GAIN", 1.0)
    plain = meshreel.decode(meshreel.encode(sequence, block_frames=24, quality=90))
    assert usual < 1.05 * meshreel.compare(sequence, plain).kg_error_percent


@pytest.mark.parametrize(
    "targets",
    [np.zeros((0, 3, 90)), np.zeros((2, 3, 90)), np.ones((2, 3, 1)), np.full((3, 3, 99), 2.0**29)],
)
def test_times_do_not_adapt_without_savings(targets):
    assert not cheapest_coding(targets, RATE_WEIGHT).is_adaptive


def test_times_adapt_only_in_long_blocks():
    rng, frames = np.random.default_rng(7), 4 * MIN_ADAPTIVE_FRAMES
    noise = 20.0 * rng.normal(size=(8, 3, frames))
    few = noise[:, :, : MIN_ADAPTIVE_FRAMES - 1]
    assert cheapest_coding(noise, RATE_WEIGHT, may_be_cosines=False).is_adaptive
    assert not cheapest_coding(few, RATE_WEIGHT, may_be_cosines=False).is_adaptive


def test_modes_of_zeros_may_be_dropped_when_times_are_adaptive():
    rng, coding = np.random.default_rng(8), BasisCoding(is_adaptive=True)
    targets = rng.normal(size=(6, 3, 60)) * np.array([9, 0.01, 5, 0.01, 0.01, 3])[:, None, None]
    coded, _ = quantized_basis(targets, RATE_WEIGHT, coding)
    is_kept = coded.any(axis=(1, 2))
    assert is_kept.tolist() == [True, False, True, False, False, True]
    whole = basis_vectors(coded, coding, np.ones(6))
    dropped = basis_vectors(np.ascontiguousarray(coded[is_kept]), coding, np.ones(3))
    np.testing.assert_array_equal(dropped, whole[:, :, is_kept])
