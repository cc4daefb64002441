"""Lossless coding of numbers over time on a graph, also decoded by the plain reader."""

import numpy as np
import pytest

from conformance.exact import read_exact
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.kernel.exact import MAX_FRAMES, TYPES, decode_exact, encode_exact
from meshreel.kernel.mesh import Neighbors, neighbors

LATTICE_ROWS, LATTICE_COLUMNS = 9, 11


def lattice():
    """Return neighbors and positions of a triangle sheet with 99 vertices."""
    across, up = np.meshgrid(np.arange(LATTICE_COLUMNS), np.arange(LATTICE_ROWS))
    vertex = (up * LATTICE_COLUMNS + across)[:-1, :-1].ravel()
    right, above = vertex + 1, vertex + LATTICE_COLUMNS
    faces = np.concatenate(
        [np.stack([vertex, right, above], 1), np.stack([right, above + 1, above], 1)]
    )
    return neighbors(faces, across.size), np.stack([across.ravel(), up.ravel()], 1) / 10


def no_neighbors(n_items):
    return Neighbors(np.zeros(n_items + 1, np.int32), np.zeros(0, np.int32))


def waves(n_frames, dtype=np.float32):
    """Return a waving sheet of shape (T, 99, 3)."""
    places = lattice()[1]
    time = np.arange(n_frames)[:, None] / 25
    height = np.sin(3 * time + 2 * places[:, 0]) * np.cos(time + 3 * places[:, 1])
    flat = np.broadcast_to(places, (n_frames, *places.shape))
    return np.concatenate([flat + 0.05 * height[..., None], height[..., None]], 2).astype(dtype)


def assert_round_trips(values, graph):
    before = values.tobytes()
    data = encode_exact(values, graph)
    assert values.tobytes() == before
    decoded = decode_exact(data, values.shape, values.dtype, graph)
    assert decoded.dtype == values.dtype.newbyteorder("=")
    assert decoded.shape == values.shape
    assert decoded.tobytes() == values.astype(decoded.dtype).tobytes()
    return data


def any_bits(shape, dtype, seed):
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    return np.random.default_rng(seed).integers(0, 256, size, np.uint8).view(dtype).reshape(shape)


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("shape", [(1, 99, 1), (1, 99, 3), (2, 99, 2), (7, 99, 1), (13, 99, 4)])
def test_arbitrary_bit_patterns_round_trip_with_little_overhead(dtype, shape):
    values = any_bits(shape, dtype, 1)
    assert len(assert_round_trips(values, lattice()[0])) <= values.nbytes + 16


@pytest.mark.parametrize("dtype", TYPES)
def test_smooth_numbers_of_every_type_round_trip(dtype):
    scaled = waves(20, np.float64) * 50 + (60 if dtype[0] != "f" else 0)
    values = scaled.astype(dtype)
    assert len(assert_round_trips(values, lattice()[0])) < 0.75 * values.nbytes


@pytest.mark.parametrize("dtype", TYPES)
def test_rows_predicted_from_time_or_neighbors_round_trip(dtype):
    random = np.random.default_rng(2)
    values = np.repeat(random.integers(0, 100, (1, 99, 2)), 30, axis=0)
    for frame, item in zip(random.integers(0, 30, 40), random.integers(1, 99, 40), strict=True):
        values[frame:, item] = values[frame, item - 1]
    assert len(assert_round_trips(values.astype(dtype), lattice()[0])) < 1200


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("n_frames", [1, 2, 5])
@pytest.mark.parametrize("n_items", [1, 3])
@pytest.mark.parametrize("width", [1, 2])
def test_few_frames_items_and_columns_round_trip(dtype, n_frames, n_items, width):
    shape = (n_frames, n_items, width)
    assert_round_trips(any_bits(shape, dtype, 3), no_neighbors(n_items))
    assert_round_trips(
        np.arange(np.prod(shape)).reshape(shape).astype(dtype), no_neighbors(n_items)
    )


@pytest.mark.parametrize("shape", [(0, 99, 3), (4, 99, 0)])
def test_no_values_take_no_bytes(shape):
    assert assert_round_trips(np.zeros(shape, np.float32), lattice()[0]) == b""
    with pytest.raises(CorruptStreamError, match="has no bytes"):
        decode_exact(b"1", shape, np.float32, lattice()[0])


@pytest.mark.parametrize("dtype", ["f4", "f8"])
@pytest.mark.parametrize("scale", [1e-300, 1e-44, 1e-30, 1e-3, 1e9, 1e30, 1e300])
def test_floats_of_any_scale_round_trip(dtype, scale):
    with np.errstate(over="ignore"):
        values = (waves(12, np.float64) * scale).astype(dtype)
    assert_round_trips(values, lattice()[0])


@pytest.mark.parametrize("digits", range(1, 8))
@pytest.mark.parametrize("dtype", ["f4", "f8"])
def test_decimal_floats_take_fewer_bytes_than_all_floats(dtype, digits):
    whole = waves(12, np.float64) * 7
    texts = [f"{value:.{digits}g}" for value in whole.ravel()]
    values = np.array(texts, np.float64).astype(dtype).reshape(whole.shape)
    values[3, 4] = -0.0
    size = len(assert_round_trips(values, lattice()[0]))
    if digits < 5:
        assert size < 0.6 * len(assert_round_trips(whole.astype(dtype), lattice()[0]))


@pytest.mark.parametrize("places", [0, 2, 5, 9])
def test_floats_with_fixed_decimals_round_trip(places):
    values = np.round(waves(12, np.float64) * 300, places)
    size = len(assert_round_trips(values, lattice()[0]))
    assert size < 0.7 * len(assert_round_trips(waves(12, np.float64) * 300, lattice()[0]))


def test_float32_values_stored_as_float64_take_little_more_bytes():
    values = waves(20)
    single, double = (
        len(assert_round_trips(v, lattice()[0])) for v in (values, values.astype("f8"))
    )
    assert double < 1.02 * single


@pytest.mark.parametrize("dtype", TYPES)
def test_constant_values_take_next_to_nothing(dtype):
    graph = no_neighbors(5000)
    values = np.full((100, 5000, 1), 7, dtype)
    assert len(assert_round_trips(values, graph)) < 100


def test_mask_that_hardly_changes_takes_next_to_nothing():
    graph = lattice()[0]
    values = np.zeros((200, 99, 1), np.bool_)
    values[:, :40] = True
    values[100:, 40:50] = True
    assert len(assert_round_trips(values, graph)) < 60


@pytest.mark.parametrize("dtype", TYPES)
def test_numbers_in_runs_of_the_items_take_next_to_nothing(dtype):
    graph = neighbors(np.random.default_rng(1).integers(0, 1000, (2000, 3)), 1000)
    runs = np.arange(1000).astype(dtype)[:, None] // np.array(100, dtype)
    values = np.broadcast_to(np.floor(runs), (8, 1000, 1)).astype(dtype)
    assert len(assert_round_trips(values, graph)) < 100


def test_smooth_motion_takes_a_third_of_its_bytes():
    values = waves(100)
    assert len(assert_round_trips(values, lattice()[0])) < values.nbytes / 3


def test_repeated_motion_takes_fewer_bytes():
    random = np.random.default_rng(4)
    walk = 0.01 * np.cumsum(random.standard_normal((24, 99, 3)), axis=0)
    once = (waves(1) + walk).astype(np.float32)
    again = (once + 1e-5 * random.standard_normal(once.shape)).astype(np.float32)
    graph = lattice()[0]
    one, two = (len(assert_round_trips(v, graph)) for v in (once, np.concatenate([once, again])))
    assert two < 1.8 * one


def test_values_in_any_memory_order_round_trip():
    values = np.asfortranarray(waves(6)).astype(">f4")
    assert_round_trips(values[:, :, ::-1], lattice()[0])


def test_invalid_booleans_are_rejected():
    graph = lattice()[0]
    data = encode_exact(np.full((2, 99, 1), 2, np.uint8), graph)
    with pytest.raises(CorruptStreamError, match="booleans must be 0 or 1; got 2"):
        decode_exact(data, (2, 99, 1), np.bool_, graph)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (np.zeros((2, 99), np.float32), "must have shape"),
        (np.zeros((2, 99, 1), np.complex64), "must have one of the types"),
        (np.zeros((2, 99, 1), np.float16), "must have one of the types"),
        (np.zeros((2, 98, 1), np.float32), "the neighbors have 99"),
    ],
)
def test_unsupported_values_are_rejected(values, message):
    with pytest.raises(InvalidInputError, match=message):
        encode_exact(values, lattice()[0])
    with pytest.raises(InvalidInputError, match=message):
        decode_exact(b"", values.shape, values.dtype, lattice()[0])


@pytest.mark.parametrize(("starts", "near"), [([0, 1, 1], [2]), ([0, 1, 0], [1]), ([1, 1, 1], [])])
def test_graph_of_other_items_is_rejected(starts, near):
    graph = Neighbors(np.array(starts, np.int32), np.array([*near, 0], np.int32))
    with pytest.raises(InvalidInputError, match="cannot be encoded"):
        encode_exact(np.zeros((2, 2, 1), np.float32), graph)


def test_trailing_bytes_are_rejected():
    graph = lattice()[0]
    values = waves(3)
    with pytest.raises(CorruptStreamError):
        decode_exact(encode_exact(values, graph) + b"\0" * 8 + b"1", values.shape, "f4", graph)


@pytest.mark.parametrize("shape", [(MAX_FRAMES + 1, 0, 1), (1, -1, 1), (1, 0)])
def test_shapes_are_rejected_unless_they_are_frames_items_and_columns(shape):
    with pytest.raises(InvalidInputError, match=r"must have shape \(T, N, C\)"):
        decode_exact(b"", shape, np.dtype("f4"), no_neighbors(0))


LETTERS = dict(zip(TYPES, "BbHhIifQqd", strict=True))
"""Number types in the notation of `struct`."""

N_ITEMS = 60
MAX_PLACES = 22
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
    """The core and the plain reader decode the same bits; returns the number of coded bytes."""
    graph = tape()
    data = encode_exact(values, graph)
    decoded = decode_exact(data, values.shape, values.dtype, graph)
    assert decoded.tobytes() == values.tobytes()
    ends = zip(graph.starts[:-1], graph.starts[1:], strict=True)
    near = [graph.near[first:end].tolist() for first, end in ends]
    plain = read_exact(data, values.shape, LETTERS[values.dtype.str[1:]], near)
    assert plain == values.view(f"u{values.itemsize}").tolist()
    return len(data)


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


@pytest.mark.parametrize("dtype", ["f4", "f8"])
def test_plain_reader_decodes_decimal_floats_of_every_decade_from_few_bytes(dtype):
    shape, random = (3, N_ITEMS, 2), np.random.default_rng(4)
    counts = random.integers(1, 1000, shape).ravel()
    powers = np.resize(np.arange(-MAX_PLACES, MAX_PLACES), counts.shape)
    values = np.array([f"{count}e{power}" for count, power in zip(counts, powers, strict=True)])
    values = values.astype(dtype).reshape(shape)
    assert assert_read_alike(values) < 2.7 * values.size


@pytest.mark.parametrize("dtype", TYPES)
def test_plain_reader_decodes_arbitrary_bit_patterns(dtype):
    size = np.dtype(dtype).itemsize
    data = np.random.default_rng(3).integers(0, 256, 3 * N_ITEMS * 2 * size, np.uint8)
    assert_read_alike(data.view(dtype).reshape(3, N_ITEMS, 2))
