"""Fields decoded by the core and by the plain reader."""

import numpy as np
import pytest

from conformance.fields import FieldReader
from meshreel.kernel.fields import encode_fields
from samples.passes import as_order


def grid_passes(side):
    """Return passes of a grid (every fourth, every second, the rest) and earlier neighbors."""
    place = {(x, y): y * side + x for y in range(side) for x in range(side)}
    passes = []
    for is_here in (
        lambda x, y: x % 4 == y % 4 == 0,
        lambda x, y: x % 2 == y % 2 == 0,
        lambda x, y: False,
        lambda x, y: True,
    ):
        known = {i for near in passes for i in near}
        passes.append({})
        for (x, y), i in place.items():
            if is_here(x, y) and i not in known:
                around = [place.get((x + a, y + b)) for a in (-2, -1, 0, 1, 2) for b in (-1, 0, 2)]
                passes[-1][i] = [j for j in around if j in known]
    return passes


def lively_fields(scale, n_rows, n_columns=169):
    """Return the first of 16 rows of falling energy, some of them empty."""
    rng = np.random.default_rng(8)
    smooth = np.exp(np.sin(np.arange(n_columns) / 9)) * scale * 0.8 ** np.arange(16)[:, None]
    fields = np.rint(rng.laplace(scale=smooth) + smooth).astype(int)
    fields[[4, 9, 14]] = 0
    fields[[5, 10], ::2] = 0
    fields[6, :3] = (100, -5000, 2**31 - 1)
    return fields[:n_rows]


def assert_read_alike(fields, passes):
    order = as_order(*((list(near), list(near.values())) for near in passes))
    reader = FieldReader(encode_fields(fields, order), passes)
    for row, expected in enumerate(fields.tolist()):
        decoded = reader.read_row(row)
        assert [decoded[i] for i in range(len(expected))] == expected
    reader.stream.end()


@pytest.mark.parametrize("n_rows", [1, 4, 5, 16])
@pytest.mark.parametrize("scale", [0.2, 3.0])
def test_plain_reader_decodes_the_same_fields(scale, n_rows):
    passes = grid_passes(13)
    assert [len(near) for near in passes] == [16, 33, 0, 120]
    assert_read_alike(lively_fields(scale, n_rows), passes)


@pytest.mark.parametrize("n_rows", [1, 16])
@pytest.mark.parametrize("scale", [0.2, 3.0])
def test_plain_reader_decodes_the_same_fields_of_a_single_pass(scale, n_rows):
    assert_read_alike(lively_fields(scale, n_rows), [{i: [] for i in range(169)}])


def test_plain_reader_decodes_the_same_fields_with_neighbors_in_the_same_pass():
    passes = [{i: list(range(max(0, i - 16), i, 1 + i % 3)) for i in range(169)}]
    assert_read_alike(lively_fields(1.0, 12), passes)


@pytest.mark.slow
def test_plain_reader_decodes_the_same_long_rows():
    """Covers halved sums, the slowest adaptation, and distant weights."""
    fields = np.zeros((6, 3000), int)
    for number, row in enumerate(fields):
        row[number :: 5 + 40 * (number % 2)] = 1 - 2 * (number % 3 == 0)
    fields[4:] = np.random.default_rng(2).integers(-5000, 5000, (2, 3000))
    assert_read_alike(fields, [{i: [i - 1] * (i > 0) for i in range(3000)}])


def test_plain_reader_decodes_the_same_fields_of_jumping_magnitudes():
    """Covers the largest steps of weights, and magnitudes beyond the contexts."""
    rng = np.random.default_rng(3)
    jumps = rng.integers(0, 31, (12, 400)) * (rng.random((12, 400)) < 0.3)
    fields = np.where(jumps > 0, 2**jumps, 0) * rng.choice([-1, 1], (12, 400))
    assert_read_alike(fields, [{i: list(range(max(0, i - 4), i)) for i in range(400)}])
