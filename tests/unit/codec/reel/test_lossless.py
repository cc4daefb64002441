"""Lossless sequences."""

import numpy as np
import pytest

import meshreel
from meshreel.codec.achieved import measure_stream
from meshreel.codec.options import config_of
from meshreel.codec.reel.normative import blocks
from meshreel.errors import InvalidInputError, SolverError
from samples.meshes import quad_sheet, waving_grid
from samples.orders import shuffled
from samples.streams import recorded

RNG = np.random.default_rng(16)
SINGLE, DOUBLE = np.float32, np.float64


def assert_same_bits(found, expected):
    assert found.dtype == expected.dtype
    assert found.shape == expected.shape
    assert found.tobytes() == expected.tobytes()


def any_bits(shape, dtype):
    """Finite numbers of all magnitudes."""
    size = np.dtype(dtype).itemsize
    numbers = np.frombuffer(RNG.bytes(size * int(np.prod(shape))), dtype).reshape(shape).copy()
    return np.where(np.isfinite(numbers), numbers, np.finfo(dtype).max)


def with_positions(vertices, sequence):
    return meshreel.MeshSequence(vertices, sequence.faces, 25, surface=sequence.surface)


def signed_zeros(dtype):
    sequence = waving_grid(6)
    vertices = np.round(sequence.vertices).astype(dtype)
    return with_positions(np.where(RNG.random(vertices.shape) < 0.5, -vertices, vertices), sequence)


def sequences():
    """Numbers, orders and lengths that `law` does not try."""
    grid = waving_grid(9)
    far = (grid.vertices + 1e6).astype(SINGLE)
    return {
        "vertices in any order": shuffled(grid, 16),
        "far away in singles": with_positions(far, grid),
        "any bits": with_positions(any_bits(grid.vertices.shape, SINGLE), grid),
        "any bits in doubles": with_positions(any_bits(grid.vertices.shape, DOUBLE), grid),
        "zeros with signs": signed_zeros(SINGLE),
        "zeros with signs in doubles": signed_zeros(DOUBLE),
        "subnormal": with_positions((grid.vertices * 1e-42).astype(SINGLE), grid),
        "still": with_positions(np.repeat(grid.vertices[:1], 300, axis=0), grid),
    }


SEQUENCES = sequences()


@pytest.mark.parametrize("block_frames", [None, 1, 4])
@pytest.mark.parametrize("name", SEQUENCES)
def test_positions_are_lossless(name, block_frames):
    sequence = SEQUENCES[name]
    data = meshreel.encode(sequence, lossless=True, block_frames=block_frames)
    decoded = meshreel.decode(data)
    assert_same_bits(decoded.vertices, sequence.vertices)
    assert_same_bits(decoded.faces, sequence.faces)
    info = meshreel.info(data)
    assert (info.method, info.order) == ("lossless", "keep")
    assert info.is_lossless
    assert info.error_bound_percent == 0
    assert set(info.n_modes) == {0}


@pytest.mark.parametrize("order", ["vertices", "drop"])
def test_positions_are_lossless_in_every_order(order):
    sequence = SEQUENCES["vertices in any order"]
    data = meshreel.encode(sequence, lossless=True, order=order)
    decoded = meshreel.decode(data)
    if order == "vertices":
        assert_same_bits(decoded.vertices, sequence.vertices)
        quality = meshreel.compare(sequence, data)
        assert (quality.max_error_percent, quality.sted) == (0, 0)
    rows = [np.unique(one.vertices[0], axis=0) for one in (sequence, decoded)]
    assert_same_bits(rows[1], rows[0])
    measured = measure_stream(sequence, data)
    assert (measured.max_error_percent, measured.kg_error_percent) == (0, 0)


def test_a_requested_bound_applies_to_its_track_alone():
    sheet = quad_sheet(12)
    heat, flow = (RNG.normal(300, 20, (12, sheet.n_verts, n)).astype(SINGLE) for n in (1, 3))
    sequence = sheet.replace(tracks={"heat": heat, "flow": flow, "id": heat.astype(np.int32)})
    data = meshreel.encode(sequence, lossless=True, tracks={"flow": 0.25, "id": "drop"})
    stored = [(one.name, one.is_exact, one.bound) for one in meshreel.info(data).tracks]
    assert stored == [("heat", True, 0), ("flow", False, 0.25)]
    result = meshreel.decode(data)
    assert_same_bits(result.vertices, sequence.vertices)
    assert_same_bits(result.tracks["heat"].values, heat)
    assert 0 < np.linalg.norm(result.tracks["flow"].values - flow, axis=2).max() <= 0.25


@pytest.mark.slow
def test_velocities_within_a_bound_follow_from_the_exact_positions():
    grid = waving_grid(12)
    velocity = (25 * np.gradient(grid.vertices, axis=0)).astype(SINGLE)
    tracks = {"velocity": meshreel.Track(velocity, kind="velocity", unit="m/s")}
    sequence = meshreel.MeshSequence(grid.vertices, grid.faces, 25, tracks=tracks)
    for order in ("keep", "drop"):
        options = {"tracks": {"velocity": 0.01}, "order": order, "block_frames": 12}
        for encode in (meshreel.encode, recorded):
            stream = encode(sequence, lossless=True, **options)
            [track] = meshreel.info(stream).tracks
            assert not track.is_exact
            assert track.size_bytes < 200  # residuals are almost 0
            measured = measure_stream(sequence, stream)
            assert measured.max_error_percent == 0
            assert measured.tracks["velocity"].largest <= 0.01


def test_blocks_are_short_enough_for_random_access():
    config = config_of("lossless")
    assert config.longest_block(300, 8000) == 300
    assert config.longest_block(3000, 8000) <= 1 << 9
    assert config.longest_block(300, 1_000_000) == 60
    assert config.longest_block(2, 1 << 28) == 1


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"quality": 90}, "quality has no effect with lossless; omit it"),
        ({"max_error": 0.1}, "max_error"),
        ({"kg": 0.1}, "kg"),
        ({"step": 1e-5}, "step"),
        ({"size": "1MB"}, "size"),
        ({"uv_bits": 12}, "uv_bits"),
        ({"effort": 3, "n_modes": 4}, "has no effect with lossless; omit it"),
        ({"tune": "visual"}, "tune"),
    ],
)
def test_options_without_effect_are_refused(options, named):
    with pytest.raises(InvalidInputError, match=named):
        meshreel.encode(waving_grid(2), lossless=True, **options)


def test_other_methods_refuse_lossless():
    with pytest.raises(InvalidInputError, match="method v2v does not take lossless"):
        meshreel.encode(waving_grid(2), "v2v", lossless=True)
    with pytest.raises(InvalidInputError, match="lossless must be True or False; got 1"):
        meshreel.encode(waving_grid(2), lossless=1)


def test_option_lossless_selects_the_method():
    sequence = waving_grid(3)
    data = meshreel.encode(sequence, lossless=True)
    assert meshreel.encode(sequence, "lossless") == data
    assert meshreel.encode(sequence, "lossless", lossless=True) == data


def test_lossless_false_gives_the_default_stream():
    sequence = waving_grid(3)
    assert meshreel.encode(sequence, lossless=False) == meshreel.encode(sequence)
    with pytest.raises(InvalidInputError, match="uv_bits"):
        meshreel.encode(sequence, uv_bits=3)


@pytest.mark.parametrize("encode", [meshreel.encode, recorded])
@pytest.mark.parametrize("order", ["keep", "drop"])
@pytest.mark.parametrize(
    ("writer", "name"),
    [
        ("exact_positions.write_exact_positions", "positions"),
        ("track_coders.write_values_block", "track 'heat'"),
    ],
)
def test_streams_that_lose_the_sign_of_zero_are_refused(monkeypatch, writer, name, order, encode):
    write = getattr(blocks, writer.partition(".")[2])
    loses = lambda values, *graph: write(values + 0.0, *graph)  # noqa: E731
    monkeypatch.setattr(f"meshreel.codec.reel.encoding.{writer}", loses)
    vertices = waving_grid(3).vertices.copy()
    vertices[0, 0] = -0.0
    sequence = waving_grid(3).replace(vertices=vertices, tracks={"heat": np.full((3, 99), -0.0)})
    with pytest.raises(SolverError, match=f"{name} do not decode bit for bit; nothing is written"):
        encode(sequence, lossless=True, order=order)
