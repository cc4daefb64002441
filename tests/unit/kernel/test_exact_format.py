"""Exact values decoded by the core and by the plain reader."""

import numpy as np
import pytest

from conformance.exact import read_exact
from meshreel.kernel.exact import TYPES, decode_exact, encode_exact
from meshreel.kernel.mesh import neighbors

LETTERS = dict(zip(TYPES, "BbHhIifQqd", strict=True))
"""Number types in the notation of `struct`."""

N_ITEMS = 60
FRAMES = np.arange(9)[:, None, None]
ITEMS = np.arange(N_ITEMS)[:, None]
COLUMNS = np.arange(3)


def tape():
    """Return a triangle strip, a fan around its first vertex, and isolated vertices."""
    strip = [(i, i + 1, i + 2) for i in range(45)]
    return neighbors(np.array(strip + [(0, i, i + 1) for i in range(10, 46)]), N_ITEMS)


def kinds_of_values():
    """Values that use every coding mode, float64 of shape (9, 60, 3)."""
    random = np.random.default_rng(9)
    waves = 40 * np.sin(FRAMES / 3 + ITEMS / 7 + COLUMNS) + 60
    noise = random.integers(0, 100, (9, N_ITEMS, 3))
    labels = np.repeat(random.integers(0, 4, (1, N_ITEMS, 1)), 9, axis=0).repeat(3, axis=2)
    labels[5:, 7:30] = labels[4:5, 20:21]
    stays = np.where(ITEMS % 3 == 0, waves[:1], waves)
    stays[4] = stays[3]
    again = np.concatenate([waves[:4] + noise[:4], waves[:4] + noise[:4] + 0.001, waves[8:]])
    return {
        "waves": waves,
        "noise": noise,
        "labels": labels,
        "listed": np.broadcast_to(ITEMS // 7, (9, N_ITEMS, 3)),
        "stays": stays,
        "again": again,
        "constant": np.broadcast_to(noise[0], waves.shape),
        "decimal": np.round(waves * random.choice([1, 1e-3, -1], waves.shape), 4),
    }


def assert_read_alike(values):
    """The core and the plain reader decode the same bits."""
    graph = tape()
    data = encode_exact(values, graph)
    decoded = decode_exact(data, values.shape, values.dtype, graph)
    assert decoded.tobytes() == values.tobytes()
    ends = zip(graph.starts[:-1], graph.starts[1:], strict=True)
    near = [graph.near[first:end].tolist() for first, end in ends]
    plain = read_exact(data, values.shape, LETTERS[values.dtype.str[1:]], near)
    assert plain == values.view(f"u{values.itemsize}").tolist()


@pytest.mark.slow
@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("name", list(kinds_of_values()))
def test_plain_reader_decodes_the_same_values(name, dtype):
    values = np.ascontiguousarray(kinds_of_values()[name]).astype(dtype)
    assert_read_alike(values)
    assert_read_alike(values[:1])


@pytest.mark.slow
@pytest.mark.parametrize("dtype", ["f4", "f8"])
def test_plain_reader_decodes_nan_and_infinity(dtype):
    values = kinds_of_values()["waves"].astype(dtype)
    values[2:5, 10] = np.nan
    values[4:, 12] = -np.nan
    values[3, 20, 1] = -np.inf
    values[2, 21], values[:, 22] = np.inf, 0.0
    values[4, 30] = -0.0
    values[5, 31], values[8, 33] = np.finfo(dtype).max, np.finfo(dtype).min
    values[6, 32] = np.finfo(dtype).tiny / 8
    assert_read_alike(values)
    assert_read_alike(np.full_like(values, np.nan))


@pytest.mark.parametrize("dtype", TYPES)
def test_plain_reader_decodes_arbitrary_bit_patterns(dtype):
    size = np.dtype(dtype).itemsize
    data = np.random.default_rng(3).integers(0, 256, 3 * N_ITEMS * 2 * size, np.uint8)
    assert_read_alike(data.view(dtype).reshape(3, N_ITEMS, 2))
