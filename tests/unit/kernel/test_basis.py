"""Quantization of basis vectors by the encoder, and their decoding."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from meshreel.errors import InvalidInputError
from meshreel.kernel.basis import (
    MAX_COSINES,
    MAX_REST_BITS,
    BasisCoding,
    Rests,
    basis_vectors,
    quantized_basis,
)

COSINES = BasisCoding(has_cosines=True)
LAGRANGE_MULTIPLIER = 2.0 * np.log(2.0) / 12.0


def curves(n_modes, n_frames, size, seed):
    """Return random walks of shape (K, 3, T)."""
    steps = np.random.default_rng(seed).normal(size=(n_modes, 3, n_frames))
    return size * np.cumsum(steps, axis=2)


def encode_basis(*arguments):
    """Return the integers of quantized basis vectors."""
    return quantized_basis(*arguments)[0]


def directions(values):
    """Return unit vectors of shape (3, T, K)."""
    lengths = np.sqrt(np.square(values).sum(axis=(1, 2), keepdims=True))
    return np.moveaxis(values / np.where(lengths > 0, lengths, 1.0), 0, 2)


@given(
    st.integers(1, 4), st.integers(1, 70), st.floats(1.0, 1e6), st.integers(0, 99), st.booleans()
)
def test_vectors_round_trip_within_half_a_step_without_a_rate_weight(
    n, n_frames, size, seed, is_adaptive
):
    targets = curves(n, n_frames, size, seed)
    coding = BasisCoding(is_adaptive=is_adaptive)
    decoded = basis_vectors(encode_basis(targets, 0.0, coding), coding)
    length = np.sqrt(np.square(targets).sum(axis=(1, 2)))
    error = np.abs(decoded - directions(targets)).max(axis=(0, 1))
    assert (error <= (0.5 + 0.5 * np.sqrt(3 * n_frames)) / np.maximum(length, 1e-9) + 1e-9).all()


def test_integers_are_smaller_with_a_rate_weight():
    targets = curves(3, 200, 0.3, 1)
    plain, by_rate = encode_basis(targets, 0.0), encode_basis(targets, LAGRANGE_MULTIPLIER)
    assert np.count_nonzero(by_rate) < 0.9 * np.count_nonzero(plain)
    np.testing.assert_array_equal(by_rate[:, :, ::4], plain[:, :, ::4])


def test_rare_ones_become_zeros_with_a_rate_weight():
    rare, common = np.zeros((1, 3, 400)), np.zeros((1, 3, 400))
    rare[0, 0, 7] = 0.6
    common[0, 0, 1::2] = 0.6
    assert encode_basis(rare, LAGRANGE_MULTIPLIER)[0, 0, 7] == 0
    assert np.count_nonzero(encode_basis(common, LAGRANGE_MULTIPLIER)[0, 0]) > 100


def test_smooth_curves_need_integers_at_the_coarsest_times_only():
    time = np.arange(101) / 10
    curve = np.broadcast_to(np.rint(time**2), (1, 3, 101))
    integers = encode_basis(1e3 * np.array(curve), 0.0)
    assert np.count_nonzero(integers[:, :, ::4]) > 50
    assert encode_basis(np.full((2, 3, 9), 7.0), 0.0).any(axis=2).sum() == 6
    assert not encode_basis(np.full((2, 3, 9), 7.0), 0.0)[:, :, 1:].any()


@pytest.mark.every_case
@pytest.mark.parametrize("coding", [BasisCoding(), COSINES], ids=["times", "cosines"])
@pytest.mark.parametrize("value", [1e12, np.inf, np.nan])
def test_error_is_raised_when_an_integer_is_too_large(value, coding):
    with pytest.raises(InvalidInputError, match="basis vectors cannot be encoded"):
        encode_basis(np.full((1, 3, 5), value), LAGRANGE_MULTIPLIER, coding)


ADAPTIVE = BasisCoding(is_adaptive=True)


def test_adaptive_times_of_noise_take_fewer_bits_than_plain_ones():
    noise = 20.0 * np.random.default_rng(6).normal(size=(8, 3, 200))
    plain, adaptive = (encode_basis(noise, 0.0, one) for one in (BasisCoding(), ADAPTIVE))
    assert np.abs(adaptive).mean() < 0.85 * np.abs(plain).mean()


def test_adaptive_times_restart_after_reused_modes():
    coded = encode_basis(curves(4, 50, 3.0, 9), LAGRANGE_MULTIPLIER, ADAPTIVE)
    whole = basis_vectors(coded, ADAPTIVE, np.ones(2))
    for part in (slice(0, 2), slice(2, 4)):
        alone = basis_vectors(coded[part], ADAPTIVE, np.ones(2)[part])
        np.testing.assert_array_equal(whole[:, :, part], alone)


@pytest.mark.parametrize("sign", [1, -1, 0])
def test_adaptive_times_of_the_largest_integers_are_finite(sign):
    rng = np.random.default_rng(10)
    coded = rng.integers(-(2**31) + 1, 2**31, (5, 3, 300))
    coded = coded if sign == 0 else (2**31 - 1) * np.full((5, 3, 300), sign) ** np.arange(300)
    vectors = basis_vectors(coded, ADAPTIVE, np.ones(5))
    assert np.abs(vectors).max() <= 2.0**29 + 2.0**31


def resting(bits, *runs):
    """Return the coding by times in which some runs rest."""
    return BasisCoding(Rests(runs, bits))


@pytest.mark.parametrize("rate_weight", [0.0, LAGRANGE_MULTIPLIER])
def test_resting_times_are_decoded_equal(rate_weight):
    targets = curves(4, 60, 3.0, 2)
    targets[:, :, 21:33] = targets[:, :, 20:21]
    coding = resting(3, (21, 33))
    coded = encode_basis(targets, rate_weight, coding)
    assert not coded[:, :, 21:33].any()
    vectors = basis_vectors(coded, coding)
    np.testing.assert_array_equal(vectors[:, 21:33], np.broadcast_to(vectors[:, 20:21], (3, 12, 4)))
    without = basis_vectors(encode_basis(targets, rate_weight))
    assert np.ptp(without[:, 20:33], axis=1).max() > 0.0


@pytest.mark.parametrize("bits", [0, 3, MAX_REST_BITS])
def test_resting_times_are_within_half_a_step_of_the_target(bits):
    targets = curves(2, 40, 5.0, 3)
    targets[:, :, 11:30] = targets[:, :, 10:11] + 0.02 * np.arange(1, 20)
    coding = resting(bits, (11, 30), (39, 40))
    decoded = values_of(encode_basis(targets, 0.0, coding), coding)
    error = decoded - targets
    drift = np.abs(error[:, :, 11:30] - error[:, :, 10:11]).max()
    assert drift <= 0.5 / 2**bits + 1e-6


def values_of(coded, coding):
    """Return values in steps, as a reused field of length 1 divides its vector by 1."""
    return np.moveaxis(basis_vectors(coded, coding, np.ones(len(coded))), 2, 0)


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("coding", "n_frames"),
    [
        (resting(0, (0, 1)), 5),
        (resting(MAX_REST_BITS + 1, (1, 2)), 5),
        (COSINES, 0),
        (COSINES, MAX_COSINES + 1),
    ],
    ids=["rest at the start", "too many bits", "no cosines", "too many cosines"],
)
def test_codings_are_rejected_when_the_format_cannot_represent_them(coding, n_frames):
    with pytest.raises(InvalidInputError):
        encode_basis(np.zeros((1, 3, n_frames)), 0.0, coding)
    with pytest.raises(InvalidInputError):
        basis_vectors(np.zeros((1, 3, n_frames), np.int32), coding)


def cosines(n_frames):
    """Return the orthonormal DCT-II, of shape (frequencies, T)."""
    matrix = np.cos(np.pi * np.outer(np.arange(n_frames), np.arange(n_frames) + 0.5) / n_frames)
    matrix *= np.sqrt(2.0 / n_frames)
    matrix[0] = np.sqrt(1.0 / n_frames)
    return matrix


every_count = pytest.mark.parametrize("n_frames", [1, 2, 3, 16, 47, MAX_COSINES])


@every_count
def test_coefficients_are_the_nearest_without_a_rate_weight(n_frames):
    targets = curves(2, n_frames, 100.0, 3)
    integers = encode_basis(targets, 0.0, COSINES)
    np.testing.assert_allclose(integers, targets @ cosines(n_frames).T, rtol=0, atol=0.5 + 1e-6)


@every_count
def test_vectors_are_sums_of_cosines(n_frames):
    coded = np.random.default_rng(4).integers(-(2**31) + 1, 2**31, (2, 3, n_frames))
    values = np.moveaxis(coded @ cosines(n_frames), 0, 2)
    largest = np.abs(values).max()
    vectors = basis_vectors(coded, COSINES, np.ones(2))
    np.testing.assert_allclose(vectors, values, rtol=0, atol=1e-13 * largest * n_frames)
    lengths = np.sqrt(np.square(basis_vectors(coded, COSINES)).sum(axis=(0, 1)))
    np.testing.assert_allclose(lengths, 1.0, rtol=1e-12)


def test_vectors_of_zero_coefficients_are_zero():
    assert not basis_vectors(np.zeros((1, 3, 5), np.int32), COSINES).any()


def test_coefficients_are_fewer_with_a_rate_weight():
    targets = 0.6 * np.random.default_rng(5).normal(size=(3, 3, 200))
    plain, by_rate = (
        encode_basis(targets, 0.0, COSINES),
        encode_basis(targets, LAGRANGE_MULTIPLIER, COSINES),
    )
    assert np.count_nonzero(by_rate) < 0.9 * np.count_nonzero(plain)
