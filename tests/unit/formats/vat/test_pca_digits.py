"""Fields as digits of base 15, and how many each gets."""

import numpy as np
import pytest

from meshreel.formats.vat.pca.digits import (
    BASE,
    ROWS,
    Fields,
    largest_integer,
    rows_of,
    shared_digits,
    split,
    texels_for,
)


@pytest.mark.parametrize("n_digits", [1, 2, 3, 4, 5])
def test_split_gives_digits_that_add_up_to_every_kind_of_integer(n_digits):
    largest = int(largest_integer(np.array(n_digits)))
    integers = np.unique(np.linspace(-largest, largest, 5001).astype(np.int32))
    digits = split(integers, n_digits)
    places = BASE ** np.arange(n_digits - 1, -1, -1)
    assert (np.tensordot(places, digits.astype(np.int64), 1) == integers).all()
    assert np.abs(digits).max() == 7


def test_rows_add_up_to_the_fields_whatever_counts_of_digits_these_have():
    rng = np.random.default_rng(1)
    n_digits = np.array([5, 4, 3, 2, 2, 2, 1, 1, 1])
    largest = largest_integer(n_digits)[:, None]
    integers = rng.integers(-largest, largest + 1, (9, 12)).astype(np.int32)
    weights = rng.normal(size=(6, 9)).astype(np.float32)
    rows = rows_of(Fields(integers, weights, n_digits))
    values = np.concatenate([BASE * rows.pairs[:, 0].astype(int) + rows.pairs[:, 1], rows.singles])
    expected = weights.astype(np.float64) @ integers
    np.testing.assert_allclose(rows.weights.astype(np.float64) @ values, expected, rtol=3e-7)
    assert (len(rows.pairs) % 4, len(rows.singles) % ROWS) == (0, 0)
    assert rows.n_pair_texels + rows.n_single_texels == -(-n_digits.sum() // ROWS)


def test_shared_digits_leave_no_more_error_than_any_other_sharing():
    energies = np.array([900.0, 40.0, 3.0, 0.2])
    steps = np.array([9000.0, 600.0, 50.0, 4.0])
    given = shared_digits(energies, steps, 1)

    def error(counts):
        return sum(
            step / (BASE**n - 1.0) ** 2 if n else energy
            for energy, step, n in zip(energies, steps, counts, strict=True)
        )

    every = [one for one in np.ndindex(6, 6, 6, 6) if sum(one) <= ROWS]
    assert given.sum() <= ROWS
    assert error(given) == pytest.approx(min(map(error, every)))


def test_texels_for_is_the_least_number_that_suffices():
    energies = 100.0 * 0.6 ** np.arange(30)
    steps = 20 * energies
    allowed = 0.01
    n_texels = texels_for(energies, steps, allowed)

    def error(count):
        n_digits = shared_digits(energies, steps, count)
        return np.where(n_digits > 0, steps / (15.0 ** np.maximum(n_digits, 1) - 1) ** 2, energies)

    assert error(n_texels).sum() <= allowed < error(n_texels - 1).sum()
