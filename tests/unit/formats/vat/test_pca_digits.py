"""Fields as digits in base 15, and their allocation."""

import numpy as np
import pytest

from meshreel.formats.vat.pca.digits import (
    BASE,
    DIGITS_PER_TEXEL,
    Fields,
    allocate_digits,
    digit_rows,
    largest_integer,
    min_texels,
    split_digits,
)


@pytest.mark.parametrize("n_digits", [1, 2, 3, 4, 5])
def test_split_digits_add_up_to_the_integers(n_digits):
    largest = int(largest_integer(np.array(n_digits)))
    integers = np.unique(np.linspace(-largest, largest, 5001).astype(np.int32))
    digits = split_digits(integers, n_digits)
    places = BASE ** np.arange(n_digits - 1, -1, -1)
    assert (np.tensordot(places, digits.astype(np.int64), 1) == integers).all()
    assert np.abs(digits).max() == 7


def test_digit_rows_add_up_to_the_fields():
    rng = np.random.default_rng(1)
    n_digits = np.array([5, 4, 3, 2, 2, 2, 1, 1, 1])
    largest = largest_integer(n_digits)[:, None]
    integers = rng.integers(-largest, largest + 1, (9, 12)).astype(np.int32)
    weights = rng.normal(size=(6, 9)).astype(np.float32)
    rows = digit_rows(Fields(integers, weights, n_digits))
    values = np.concatenate([BASE * rows.pairs[:, 0].astype(int) + rows.pairs[:, 1], rows.singles])
    expected = weights.astype(np.float64) @ integers
    np.testing.assert_allclose(rows.weights.astype(np.float64) @ values, expected, rtol=3e-7)
    assert (len(rows.pairs) % 4, len(rows.singles) % DIGITS_PER_TEXEL) == (0, 0)
    assert rows.n_pair_texels + rows.n_single_texels == -(-n_digits.sum() // DIGITS_PER_TEXEL)


def test_allocation_has_the_smallest_error():
    energies = np.array([900.0, 40.0, 3.0, 0.2])
    coefficients = np.array([9000.0, 600.0, 50.0, 4.0])
    n_digits = allocate_digits(energies, coefficients, 1)

    def error(counts):
        return sum(
            coefficient / (BASE**n - 1.0) ** 2 if n else energy
            for energy, coefficient, n in zip(energies, coefficients, counts, strict=True)
        )

    allocations = [one for one in np.ndindex(6, 6, 6, 6) if sum(one) <= DIGITS_PER_TEXEL]
    assert n_digits.sum() <= DIGITS_PER_TEXEL
    assert error(n_digits) == pytest.approx(min(map(error, allocations)))


def test_min_texels_is_the_smallest_number_that_suffices():
    energies = 100.0 * 0.6 ** np.arange(30)
    coefficients = 20 * energies
    allowed = 0.01
    n_texels = min_texels(energies, coefficients, allowed)

    def error(count):
        n_digits = allocate_digits(energies, coefficients, count)
        rounding = coefficients / (15.0 ** np.maximum(n_digits, 1) - 1) ** 2
        return np.where(n_digits > 0, rounding, energies)

    assert error(n_texels).sum() <= allowed < error(n_texels - 1).sum()
