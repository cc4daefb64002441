"""Sequences whose faces change, encoded as one stream with one target."""

import tracemalloc

import numpy as np
import pytest

import meshreel
from meshreel import Attribute, Surface
from meshreel.codec.reel.encoding import segments, whole
from meshreel.errors import InvalidInputError, MemoryLimitError
from meshreel.model.sequence import MeshSequence
from meshreel.model.tracks import Track
from meshreel.runtime.progress import Count
from samples.materials import png
from samples.meshes import assert_same_surface, quad_sheet, torus_faces, waving_grid

GRID, SHEET = (one.replace(fps=25.0) for one in (waving_grid(12, 9, 8), quad_sheet(5)))
SMALL = SHEET.replace(vertices=0.25 * SHEET.vertices)


@pytest.fixture
def sequence():
    return meshreel.concatenate([GRID, SMALL, GRID.replace(vertices=GRID.vertices[:1])])


def decoded_pairs(sequence, data):
    decoded = meshreel.decode(data)
    assert decoded.starts == sequence.starts
    return list(zip(sequence.segments, decoded.segments, strict=True))


def largest_error(sequence, data):
    """Largest displacement of a vertex in percent of the diagonal of all frames."""
    errors = [
        np.linalg.norm(segment_hat.vertices - segment.vertices, axis=2).max()
        for segment, segment_hat in decoded_pairs(sequence, data)
    ]
    return 100 * max(errors) / np.linalg.norm(sequence.extent.high - sequence.extent.low)


def kg_error(sequence, data):
    """KG error of all frames, in percent."""
    pairs = decoded_pairs(sequence, data)
    error = sum(np.square(two.vertices - one.vertices, dtype=float).sum() for one, two in pairs)
    spread = sum(
        np.square(one.vertices - one.vertices.mean(axis=1, keepdims=True), dtype=float).sum()
        for one, _ in pairs
    )
    return 100 * np.sqrt(error / spread)


def test_bound_is_relative_to_the_box_of_all_segments(sequence):
    data = meshreel.encode(sequence, max_error=0.2)
    assert 0.1 < largest_error(sequence, data) <= 0.2
    assert meshreel.info(data).error_bound_percent == pytest.approx(0.2)


def test_size_limits_the_bytes_of_all_segments(sequence):
    limit = len(meshreel.encode(sequence)) * 3 // 4
    assert 0.9 * limit < len(meshreel.encode(sequence, size=limit)) <= limit


FRAMES = meshreel.concatenate(
    [one.replace(vertices=one.vertices[i : i + 1]) for i in range(5) for one in (GRID, SHEET)]
)


@pytest.mark.parametrize("options", [{}, {"quality": 90}, {"step": 1e-4}, {"max_error": 0.01}])
def test_segments_of_one_frame_are_on_a_grid(options):
    data = meshreel.encode(FRAMES, **options)
    assert all(meshreel.info(data, segment=i).method == "grid" for i in range(10))
    assert largest_error(FRAMES, data) < 0.1


def quantized(digits, n_frames=3):
    """Tori, each on its own grid of 8 bits, with coordinates rounded to significant digits."""
    faces, frames = torus_faces(40, 30), []
    around, along = np.meshgrid(np.linspace(0, 6, 40), np.linspace(0, 6, 30), indexing="ij")
    ring = 9 + 3 * np.cos(along)
    shape = np.stack([ring * np.cos(around), ring * np.sin(around), 3 * np.sin(along)], axis=2)
    for number in range(n_frames):
        step, low = np.float32(24.7 / 255), np.float32([0.31, -400.7, 8.2]) * (number + 1)
        integers = np.rint(shape.reshape(-1, 3) / step).astype(np.float32)
        texts = [f"{value:.{digits}g}" for value in (low + integers * step).ravel()]
        vertices = np.array(texts, np.float32).reshape(1, -1, 3)
        frames.append(MeshSequence(vertices, faces[number:]))
    return meshreel.concatenate(frames)


@pytest.mark.slow
@pytest.mark.parametrize(("digits", "tolerance"), [(6, 6e-3), (7, 6e-4), (9, 3e-4)])
def test_grid_of_the_input_is_found_through_the_rounding_of_its_text(digits, tolerance):
    frames = quantized(digits)
    data = meshreel.encode(frames, quality=99)
    assert data == meshreel.encode(frames, quality=95)
    lossless = meshreel.encode(frames, lossless=True)
    raw_bytes = sum(one.n_verts for one in frames.segments) * 3 * 4
    assert len(data) <= len(lossless) < raw_bytes / 12
    for one, one_hat in decoded_pairs(frames, lossless):
        np.testing.assert_array_equal(one_hat.vertices, one.vertices)
    for one, one_hat in decoded_pairs(frames, data):
        assert np.abs(one_hat.vertices - one.vertices).max() <= tolerance
    bounded = meshreel.encode(frames, max_error=1e-4)
    assert largest_error(frames, bounded) <= 1e-4
    assert len(bounded) <= len(lossless) + 42  # ERROR_BOUND of three segments


def test_options_of_modes_keep_modes_in_segments_of_one_frame():
    data = meshreel.encode(FRAMES, effort=5)
    assert meshreel.info(data, segment=3).method == "reel"


def test_quality_of_one_frame_is_about_that_of_modes():
    given = FRAMES.segments[4].read(0, 1)
    alone, among = meshreel.encode(FRAMES[4:5].segments[0]), meshreel.encode(FRAMES)
    errors = [
        np.square(one.vertices - given, dtype=float).mean()
        for one in (meshreel.decode(alone), meshreel.decode(among, segment=4))
    ]
    assert 0.5 < np.sqrt(errors[1] / errors[0]) < 2.0


@pytest.mark.slow
@pytest.mark.every_case
@pytest.mark.parametrize("target", [{"kg": 0.2}, {"size": 6000}], ids=str)
def test_targets_hold_over_segments_of_one_frame(target):
    data = meshreel.encode(FRAMES, **target)
    ((name, value),) = target.items()
    reached = {"size": len(data), "kg": kg_error(FRAMES, data)}
    assert 0.8 * value < reached[name] <= value


def test_bounds_of_tracks_are_shares_of_their_range_in_all_segments():
    rng = np.random.default_rng(3)
    heats = [
        rng.random((one.n_frames, one.n_verts)) * size for one, size in ((GRID, 1), (SMALL, 9))
    ]
    segments = [
        one.replace(tracks={"heat": Track(heat.astype(np.float32))})
        for one, heat in zip((GRID, SMALL), heats, strict=True)
    ]
    sequence = meshreel.concatenate([*segments, GRID])
    pairs = decoded_pairs(sequence, meshreel.encode(sequence, tracks={"heat": "1%"}))
    errors = [
        np.abs(two.tracks["heat"].values - one.tracks["heat"].values).max()
        for one, two in pairs[:2]
    ]
    assert 0.045 < errors[0] <= 0.09
    assert errors[1] <= 0.09
    assert pairs[2][1].tracks == {}


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"attributes": "skin"}, "no attribute or group 'skin'"),
        ({"tracks": {"heat": "1%"}}, "heat"),
        ({"method": "pca-qp"}, "use reel or lossless"),
    ],
    ids=["attribute", "track", "method"],
)
def test_options_that_changing_faces_do_not_allow_are_refused(sequence, options, words):
    with pytest.raises(InvalidInputError, match=words):
        meshreel.encode(sequence, **options)


def test_single_segment_gives_the_stream_of_its_sequence():
    assert meshreel.encode(meshreel.concatenate([GRID])) == meshreel.encode(GRID)


def test_name_start_and_rate_are_those_of_the_sequence():
    parts = [one.replace(fps=30.0, start_s=2.0, name="a") for one in (GRID, SMALL)]
    data = meshreel.encode(meshreel.concatenate(parts)[3:])
    decoded = meshreel.decode(data)
    assert (decoded.name, decoded.fps, decoded.start_s) == ("a", 30.0, pytest.approx(2.1))


def test_an_image_after_more_attributes_than_a_reference_counts_returns():
    segments = []
    for n in range(2):
        values = np.full((256, 9, 1), n, np.float32) * np.arange(256, dtype="f4")[:, None, None]
        many = [Attribute(f"{i}", "other", "vertex", one) for i, one in enumerate(values)]
        surface = Surface(attributes=many, images=(png(),))
        segments.append(waving_grid(1, 3, 3).replace(surface=surface))
    decoded = meshreel.decode(meshreel.encode(meshreel.concatenate(segments), lossless=True))
    for one, expected in zip(decoded.segments, segments, strict=True):
        assert_same_surface(one.surface, expected.surface)


def test_folders_of_changing_meshes_are_encoded_as_segments(tmp_path):
    for number, mesh in enumerate((GRID, SMALL, GRID)):
        meshreel.save(mesh.replace(vertices=mesh.vertices[:2]), tmp_path / f"{number}_%d.ply")
    with pytest.warns(UserWarning, match="6 frames in 3 segments"):
        data = meshreel.encode(tmp_path, lossless=True)
    assert meshreel.decode(data).starts == (0, 2, 4, 6)
    assert meshreel.load(tmp_path).starts == (0, 2, 4, 6)


@pytest.mark.slow
def test_memory_does_not_grow_with_the_segments_that_are_read(tmp_path):
    grid = waving_grid(60, 50, 12).replace(fps=25.0)  # a frame outweighs a segment's index entry
    frames = [grid.replace(vertices=grid.vertices[i : i + 1]) for i in range(12)]

    def peak(n_copies):
        path = tmp_path / f"{n_copies}.reel"
        path.write_bytes(meshreel.encode(meshreel.concatenate(n_copies * frames)))
        tracemalloc.start()
        with meshreel.open(path) as reel:
            assert sum(1 for _ in reel) == 12 * n_copies
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak

    peak(1)  # memory that stays allocated after the first use
    assert peak(4) < 1.5 * peak(1)


@pytest.mark.slow
def test_memory_limit_holds_for_all_segments_together():
    long = GRID.replace(vertices=np.tile(GRID.vertices, (5, 1, 1)))
    sequence = meshreel.concatenate(25 * [long, SMALL])
    data = meshreel.encode(sequence)
    limit = sequence.raw_size_bytes - 100_000
    assert len(meshreel.decode(data, frames=slice(30, 60), memory=limit)) == 30
    with pytest.raises(MemoryLimitError, match="segments would take"):
        meshreel.decode(data, memory=limit)


def test_progress_of_long_segments_counts_the_frames_of_all(sequence, monkeypatch):
    monkeypatch.setattr(segments, "SMALL_POSITIONS", 0)
    counts = []

    def progress(stage, share):
        if stage == "encoding" and isinstance(share, Count):
            counts.append(share)

    meshreel.encode(sequence, progress=progress)
    done = [count.done for count in counts]
    assert done == sorted(done)
    assert {count.total for count in counts} == {18}
    assert (done[0], done[-1]) == (0, 18)


def test_kg_error_of_all_frames_meets_the_target_with_little_memory_too(sequence, monkeypatch):
    data = meshreel.encode(sequence, kg=0.5)
    assert 0.4 < kg_error(sequence, data) <= 0.5
    monkeypatch.setattr(whole, "CACHED_POSITION_BYTES", 1 << 30)
    assert meshreel.encode(sequence, kg=0.5, memory="1GB") == data


@pytest.mark.parametrize(("share", "is_cached"), [(0.99, True), (1.01, False)])
def test_segments_are_cached_in_half_of_the_memory(share, is_cached, sequence, monkeypatch):
    """All trials of a step share one reading if the blocks fit, else each reads again."""
    read, readings, limit = segments._searches, [], 2e9

    def searches(sources):
        readings.append(len(sources))
        return read(sources)

    n_positions = sum(one.n_frames * one.n_verts for one in sequence.segments)
    monkeypatch.setattr(whole, "CACHED_POSITION_BYTES", share * limit / 2 / n_positions)
    monkeypatch.setattr(segments, "_searches", searches)
    meshreel.encode(sequence, kg=0.5, memory=f"{limit:.0f}B")
    assert readings == [3] if is_cached else len(readings) > 2


@pytest.mark.parametrize(("share", "is_cached"), [(0.99, True), (1.01, False)])
def test_blocks_are_cached_in_half_of_the_memory(share, is_cached, monkeypatch):
    """All trials of a step share one reading if the blocks fit, else each reads again."""
    read, readings, limit = whole.RateSearch._read_blocks, [], 2e9

    def read_blocks(search, pieces):
        readings.append(len(pieces))
        return read(search, pieces)

    n_positions = GRID.n_frames * GRID.n_verts
    monkeypatch.setattr(whole, "CACHED_POSITION_BYTES", share * limit / 2 / n_positions)
    monkeypatch.setattr(whole.RateSearch, "_read_blocks", read_blocks)
    meshreel.encode(GRID, kg=0.5, block_frames=3, memory=f"{limit:.0f}B")
    assert readings == [4] if is_cached else len(readings) > 2


def test_blocks_are_shorter_for_tracks_that_need_more_memory_than_positions():
    shape = GRID.n_frames, GRID.n_verts, 256
    wide = GRID.replace(tracks={"wide": np.arange(np.prod(shape), dtype=np.float32).reshape(shape)})
    n_frames = [
        meshreel.info(meshreel.encode(wide, memory="125MB", tracks={"wide": bound})).block_frames
        for bound in ("1%", "drop")
    ]
    assert n_frames == [(3, 3, 3, 3), (12,)]
