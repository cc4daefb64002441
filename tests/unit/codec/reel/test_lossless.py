"""Lossless sequences."""

import numpy as np
import pytest

import meshreel
from meshreel.codec.achieved import measure_stream
from meshreel.codec.options import config_of
from meshreel.codec.reel.normative import blocks
from meshreel.errors import InvalidInputError, SolverError
from meshreel.formats.options import WriteOptions
from samples.meshes import irregular_sequence, quad_sheet, waving_grid
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
    grid, odd = waving_grid(9), irregular_sequence(8)
    far = (grid.vertices.astype(DOUBLE) + 1e9, (grid.vertices + 1e6).astype(SINGLE))
    faces = np.concatenate([odd.faces, [[0, 0, 1], [2, 2, 2], odd.faces[3]], odd.faces[:2, ::-1]])
    return {
        "waves": grid,
        "waves in doubles": waving_grid(9, dtype=DOUBLE),
        "one frame": waving_grid(1),
        "two frames": waving_grid(2, dtype=DOUBLE),
        "isolated vertices and components": odd,
        "degenerate, doubled and turned faces": meshreel.MeshSequence(odd.vertices, faces),
        "vertices in any order": shuffled(grid, 16),
        "far away": with_positions(far[0], grid),
        "far away in singles": with_positions(far[1], grid),
        "any bits": with_positions(any_bits(grid.vertices.shape, SINGLE), grid),
        "any bits in doubles": with_positions(any_bits(grid.vertices.shape, DOUBLE), grid),
        "noise": with_positions(RNG.normal(size=grid.vertices.shape).astype(SINGLE), grid),
        "zeros with signs": signed_zeros(SINGLE),
        "zeros with signs in doubles": signed_zeros(DOUBLE),
        "subnormal": with_positions((grid.vertices * 1e-42).astype(SINGLE), grid),
        "still": with_positions(np.repeat(grid.vertices[:1], 300, axis=0), grid),
        "one face": meshreel.MeshSequence(RNG.random((5, 3, 3)).astype(SINGLE), [[2, 0, 1]]),
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


def with_tracks():
    sheet = quad_sheet(12)
    n_faces = sheet.surface.n_items(meshreel.Domain.FACE, sheet.n_verts, sheet.n_faces)
    heat = RNG.normal(300, 20, (12, sheet.n_verts)).astype(SINGLE)
    heat[3, 2] = np.nan
    tracks = {
        "heat": meshreel.Track(heat, unit="K"),
        "flow": meshreel.Track(RNG.normal(size=(12, n_faces, 3)), "face", "vector", "m/s"),
        "id": np.arange(12 * sheet.n_verts, dtype=np.int32).reshape(12, -1),
    }
    return meshreel.MeshSequence(
        sheet.vertices, sheet.faces, 25, surface=sheet.surface, tracks=tracks
    )


def test_tracks_are_lossless_by_default():
    sequence = with_tracks()
    data = meshreel.encode(sequence, lossless=True, block_frames=5)
    decoded = meshreel.decode(data)
    assert_same_bits(decoded.vertices, sequence.vertices)
    for name, track in sequence.tracks.items():
        assert_same_bits(decoded.tracks[name].values, track.values)
    assert [track.is_exact for track in meshreel.info(data).tracks] == [True] * 3
    # A requested bound applies and is reported.
    data = meshreel.encode(sequence, lossless=True, tracks={"flow": 0.25, "id": "drop"})
    heat, flow = meshreel.info(data).tracks
    assert (heat.name, heat.is_exact, flow.is_exact, flow.bound) == ("heat", True, False, 0.25)
    result = meshreel.decode(data)
    assert_same_bits(result.vertices, sequence.vertices)
    assert_same_bits(result.tracks["heat"].values, sequence.tracks["heat"].values)
    apart = np.linalg.norm(result.tracks["flow"].values - sequence.tracks["flow"].values, axis=2)
    assert 0 < apart.max() <= 0.25


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


def test_single_frames_are_decoded_from_their_blocks(tmp_path):
    sequence = waving_grid(11)
    path = tmp_path / "walk.reel"
    meshreel.save(sequence, path, options=WriteOptions(lossless=True))
    with meshreel.open(path) as reel:
        assert (reel.method, reel.error_bound) == ("lossless", 0)
        for chosen in (7, slice(3, 9)):
            assert_same_bits(reel[chosen].vertices, sequence.vertices[chosen])
        assert "bit for bit" in reel._repr_html_()
    part = meshreel.decode(path, frames=slice(4, 6))
    assert_same_bits(part.vertices, sequence.vertices[4:6])


def test_live_frames_are_lossless():
    sequence = with_tracks()
    decoded = meshreel.decode(recorded(sequence, block_frames=5, lossless=True))
    assert_same_bits(decoded.vertices, sequence.vertices)
    for name, track in sequence.tracks.items():
        assert_same_bits(decoded.tracks[name].values, track.values)


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
