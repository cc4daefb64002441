"""Access to frames of a file, in any order and with a limited number of modes."""

import threading
from concurrent.futures import ThreadPoolExecutor
from io import BytesIO
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import meshreel
from conformance.make import FOLDER as CONFORMANCE
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import info
from meshreel.codec.reel_file import MAX_OPEN_SEGMENTS, ReelFile
from meshreel.errors import (
    CorruptStreamError,
    InvalidInputError,
    MemoryLimitError,
    TruncatedStreamError,
)
from samples.meshes import irregular_sequence, kg_error_percent, waving_grid
from samples.orders import shuffled
from samples.streams import Stream

METHODS = ["reel", "blocks", "pca-qp", "gft"]
OPTIONS = {"reel": {}, "blocks": {"n_modes": 2}, "pca-qp": {"n_modes": 3}, "gft": {"n_modes": 9}}
STREAMS = {
    method: encode(irregular_sequence(23), method, block_frames=4, **OPTIONS[method])
    for method in METHODS
}
WHOLE = {method: decode(data) for method, data in STREAMS.items()}


def assert_nearly_equal(found, expected):
    """Decoding a frame together with others may round its last bits differently."""
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6 * np.abs(expected).max(initial=0))


@pytest.fixture(params=METHODS)
def method(request):
    return request.param


@pytest.fixture
def reel(method):
    with ReelFile(BytesIO(STREAMS[method])) as opened:
        yield opened


@pytest.mark.parametrize("part", [slice(3, 14), slice(None), slice(20, None)])
def test_ranges_across_blocks_equal_decode(reel, method, part):
    assert_nearly_equal(reel[part].vertices, WHOLE[method].vertices[part])
    assert reel[part].vertices.dtype == WHOLE[method].vertices.dtype


def test_frames_in_any_order_equal_decode(reel, method):
    for number in (22, 0, 13, 13, 4, -1, 7):
        assert_nearly_equal(reel[number].vertices, WHOLE[method].vertices[number])


@pytest.mark.parametrize("shape", [(), (9,), (3, 4), (2, 0, 5)])
def test_frames_have_the_shape_of_their_numbers(reel, method, shape):
    numbers = np.random.default_rng(4).integers(-23, 23, shape)
    result = reel.frames(numbers)
    assert result.shape == (*shape, reel.n_verts, 3)
    assert_nearly_equal(result, WHOLE[method].vertices[numbers])


def test_frames_fill_an_array(reel, method):
    windows = np.array([[5, 6, 7, 8], [21, 22, 0, 1]])
    out = np.empty((2, 4, reel.n_verts, 3), reel.dtype)
    assert reel.frames(windows, out=out) is out
    assert_nearly_equal(out, WHOLE[method].vertices[windows])


def test_frames_need_an_array_that_fits(reel):
    with pytest.raises(InvalidInputError, match=r"out must be a contiguous float64 array of shape"):
        reel.frames([1, 2], out=np.empty((2, reel.n_verts, 3), np.float32))
    with pytest.raises(InvalidInputError, match=r"got float64 of shape \(3, "):
        reel.frames([1, 2], out=np.empty((3, reel.n_verts, 3)))
    with pytest.raises(IndexError, match="no frame 23; there are 23"):
        reel.frames([[0, 23]])


def test_frames_load_each_block_once(monkeypatch):
    with ReelFile(BytesIO(STREAMS["reel"])) as reel:
        filled = []
        monkeypatch.setattr(reel._frames, "fill", lambda out, first, track=0: filled.append(first))
        reel.frames([[20, 21], [2, 3], [12, 13], [3, 9]])
        assert filled == [2, 3, 9, 12, 20]


def test_frames_respect_the_memory_limit():
    with (
        ReelFile(BytesIO(STREAMS["reel"]), memory="1MB") as reel,
        pytest.raises(MemoryLimitError, match="2000 frames"),
    ):
        reel.frames(np.zeros(2000, int))


def test_cached_bytes_grow_with_decoded_blocks():
    with ReelFile(BytesIO(STREAMS["reel"])) as reel:
        opened = reel.cached_bytes
        _ = reel[0].vertices
        assert reel.cached_bytes > opened


def values_of(modes, n_frames):
    """Compute the frames of a block from its modes."""
    result = modes.origin + np.einsum("nk,tkc->tnc", modes.fields, modes.basis)
    frames = np.repeat(np.arange(n_frames), np.diff(modes.correction_starts))
    np.add.at(result, (frames, modes.corrected), modes.corrections)
    return result


@pytest.mark.slow
def test_modes_reproduce_all_frames_and_tracks():
    n_checked = 0
    for path in sorted(CONFORMANCE.glob("*.reel")):
        file = meshreel.open(path)
        for reel in file.segments:
            for block, (start, stop) in enumerate(pairwise(reel.block_starts)):
                quantities: list[Any] = [reel, *reel.tracks.values()]
                for values in quantities:
                    if modes := values.modes(block):
                        expected = values.read(start, stop)
                        result = values_of(modes, stop - start)
                        tolerance = 1e-6 * np.abs(expected).max(initial=0.0)
                        tolerance += np.finfo(expected.dtype).smallest_subnormal
                        assert np.abs(result - expected).max() <= tolerance, path.name
                        n_checked += 1
        file.close()
    assert n_checked > 100


@pytest.mark.parametrize(
    "options",
    [{"lossless": True}, {"method": "pca"}, {"method": "grid", "step": 0.01}],
    ids=["lossless", "pca", "grid"],
)
def test_frames_that_are_no_sum_have_no_modes(options):
    with ReelFile(BytesIO(encode(waving_grid(), **options))) as reel:
        assert reel.modes(0) is None


def test_opening_decodes_nothing(reel, method, monkeypatch):
    monkeypatch.setattr(type(reel), "_frames", None)
    assert (len(reel), reel.n_frames) == (23, 23)
    assert (reel.fps, reel.name) == (WHOLE[method].fps, WHOLE[method].name)
    np.testing.assert_array_equal(reel.faces, WHOLE[method].faces)
    assert reel.info() == info(STREAMS[method])


def test_segment_used_last_stays_decoded_when_others_are_opened():
    grids = [waving_grid(2, 4 + number, 5) for number in range(MAX_OPEN_SEGMENTS + 1)]
    with ReelFile(BytesIO(encode(meshreel.concatenate(grids)))) as reel:
        opened = reel.segments[:MAX_OPEN_SEGMENTS]
        assert reel.segments[0] is opened[0]
        _ = reel.segments[MAX_OPEN_SEGMENTS]
        assert reel.segments[0] is opened[0]
        assert reel.segments[1] is not opened[1]


def test_only_needed_blocks_are_read():
    class File(BytesIO):
        def fetch(self, start, stop):
            fetched.append(start)

    fetched: list[int] = []
    with ReelFile(File(encode(waving_grid(23), block_frames=4))) as reel:
        _ = reel.faces
        places = [reel._opened.file.block(number).offset for number in range(6)]
        fetched.clear()
        _ = reel[9].vertices, reel[8].vertices, reel[10:14].vertices, reel[11].vertices
        needed = [places[2], places[0], places[3]]  # the first is the key block of others
        assert fetched == needed
        _ = reel[8].vertices, reel[12].vertices
        assert fetched == needed


def test_complete_blocks_of_a_truncated_file_are_decoded(method):
    for number, groups in enumerate(Stream(STREAMS[method]).groups[1:], start=1):
        with ReelFile(BytesIO(STREAMS[method][: groups[-1][1] - 1])) as reel:
            assert not reel.is_whole
            assert len(reel) == 4 * number
            assert_nearly_equal(reel[:].vertices, WHOLE[method].vertices[: 4 * number])


def test_missing_frames_are_refused(reel):
    with pytest.raises(InvalidInputError, match="frames 3:24 are not in the file"):
        reel.read(3, 24)


def test_limited_modes_give_a_coarser_animation():
    data = encode(waving_grid(), step=0.001)
    with ReelFile(BytesIO(data), n_modes=1) as reel:
        np.testing.assert_array_equal(reel[:].vertices, decode(data, n_modes=1).vertices)


def test_damage_is_reported_on_reading_the_damaged_block(method):
    data = bytearray(STREAMS[method])
    data[Stream(STREAMS[method]).groups[2][-1][1] - 1] ^= 1
    with ReelFile(BytesIO(bytes(data))) as reel:
        assert len(reel[:8].vertices) == 8
        with pytest.raises(CorruptStreamError):
            reel[8]


def test_error_of_opening_another_file_names_it(tmp_path):
    path = tmp_path / "short.reel"
    path.write_bytes(STREAMS["reel"][:100])
    with pytest.raises(TruncatedStreamError, match=r"short\.reel: "):
        meshreel.open(path)


@pytest.mark.parametrize("is_in_memory", [False, True])
def test_frames_of_a_closed_file_cannot_be_read(method, tmp_path, is_in_memory):
    path = tmp_path / "walk.reel"
    path.write_bytes(STREAMS[method])
    with ReelFile(BytesIO(STREAMS[method])) if is_in_memory else meshreel.open(path) as reel:
        assert reel[0].vertices.shape == (reel.n_verts, 3)
    for number in (0, 22):
        with pytest.raises(ValueError, match="closed"):
            reel[number]


@pytest.mark.parametrize("order", ["keep", "vertices", "drop"])
def test_order_is_that_of_the_encoder(order):
    grid = waving_grid(2)
    faces = np.random.default_rng(1).permutation(grid.faces)
    shuffled = meshreel.MeshSequence(grid.vertices, faces)
    with ReelFile(BytesIO(encode(shuffled, order=order))) as reel:
        assert reel.order == order


@pytest.mark.parametrize("place", [0, 3, 6])
def test_empty_range_gives_no_frames(place):
    with ReelFile(BytesIO(encode(waving_grid(6), block_frames=3))) as reel:
        assert reel.read(place, place).shape == (0, 99, 3)


class Paused(BytesIO):
    """A file whose next seek, once armed, waits for another thread to read."""

    armed = False

    def __init__(self, data):
        super().__init__(data)
        self.is_paused, self.may_go_on = threading.Event(), threading.Event()

    def seek(self, *place):
        result = super().seek(*place)
        if self.armed:
            self.armed = False
            self.is_paused.set()
            self.may_go_on.wait(0.2)  # times out if the other reader waits for this one
        return result


@pytest.mark.slow
def test_threads_can_read_bytes_and_frames_concurrently(method):
    file = Paused(STREAMS[method])
    with ReelFile(file) as reel, ThreadPoolExecutor(2) as pool:
        file.armed = True
        frames = pool.submit(reel.read, 8, 12)
        assert file.is_paused.wait(10)
        stored = pool.submit(reel.stored, 5, 40)
        stored.add_done_callback(lambda _: file.may_go_on.set())
        assert stored.result() == STREAMS[method][5:40]
        assert_nearly_equal(frames.result(), WHOLE[method].vertices[8:12])


AT_REST = 16
"""Number of modes whose means over a block every preview contains."""

SEQUENCES = {"grid": waving_grid(20, dtype=np.float64), "irregular": irregular_sequence(20)}


@pytest.fixture(params=SEQUENCES)
def sequence(request):
    return SEQUENCES[request.param]


@pytest.mark.parametrize("more", [0, 1, 10**9])
def test_all_modes_decode_the_whole_stream(sequence, more):
    data = encode(sequence, step=3e-4)
    (n_modes,) = info(data).n_modes
    assert n_modes > 4
    whole, result = decode(data), decode(data, n_modes=n_modes + more)
    np.testing.assert_array_equal(result.vertices, whole.vertices)
    np.testing.assert_array_equal(result.faces, whole.faces)
    assert (result.fps, result.name) == (whole.fps, whole.name)


def test_error_falls_with_every_mode(sequence):
    data = encode(sequence, step=1e-6)
    (n_modes,) = info(data).n_modes
    errors = [
        kg_error_percent(sequence.vertices, decode(data, n_modes=count).vertices)
        for count in range(1, n_modes + 1)
    ]
    assert errors == sorted(errors, reverse=True)
    assert errors[0] > 100 * errors[-1]


@pytest.mark.parametrize("n_modes", [1, 2, 3, 5])
def test_error_is_at_most_that_of_the_truncated_basis(sequence, n_modes):
    """The error is at most that of the leading singular vectors: means of others are kept."""
    data = encode(sequence, step=1e-6)
    decoded = decode(data, n_modes=n_modes).vertices
    low, high = (pick(sequence.vertices, axis=(0, 1)) for pick in (np.min, np.max))
    stacked = np.moveaxis(sequence.vertices - (low + high) / 2, 2, 0).reshape(-1, sequence.n_verts)
    left_out = np.linalg.svd(stacked, compute_uv=False)[n_modes:]
    least = np.linalg.norm(left_out)
    assert np.linalg.norm(decoded - sequence.vertices) <= least * (1 + 1e-2)


@pytest.mark.parametrize("n_modes", [1, 4])
@pytest.mark.parametrize("block_frames", [None, 8])
def test_mean_shape_of_a_block_does_not_depend_on_the_number_of_modes(
    sequence, block_frames, n_modes
):
    data = encode(sequence, step=1e-4, block_frames=block_frames)
    whole, strong, few = (decode(data, n_modes=n).vertices for n in (None, AT_REST, n_modes))
    for start in range(0, sequence.n_frames, block_frames or sequence.n_frames):
        frames = slice(start, start + block_frames if block_frames else None)
        mean = few[frames].mean(axis=0)
        np.testing.assert_allclose(mean, strong[frames].mean(axis=0), atol=1e-5)
        np.testing.assert_allclose(mean, whole[frames].mean(axis=0), atol=5e-3)


def test_one_mode_moves_with_rank_one_along_each_axis(sequence):
    decoded = decode(encode(sequence, step=1e-4), n_modes=1).vertices
    for axis in range(3):
        moved = decoded[:, :, axis] - decoded[:, :, axis].mean(axis=0)
        strengths = np.linalg.svd(moved, compute_uv=False)
        assert strengths[1] <= 1e-5 * max(strengths[0], 1)


@pytest.mark.parametrize("frames", [slice(0, 1), slice(3, 12), slice(-2, None)])
def test_range_of_frames_with_fewer_modes_equals_that_of_the_whole(sequence, frames):
    data = encode(sequence, step=1e-4, block_frames=8)
    np.testing.assert_allclose(
        decode(data, frames=frames, n_modes=2).vertices,
        decode(data, n_modes=2).vertices[frames],
        atol=1e-9,
    )


@pytest.mark.parametrize("order", ["keep", "vertices", "drop"])
def test_vertices_equal_those_of_the_whole_stream_in_every_order(order):
    sequence = shuffled(waving_grid(10, dtype=np.float64), 1)
    data = encode(sequence, step=1e-5, order=order)
    whole, coarse = decode(data), decode(data, n_modes=3)
    np.testing.assert_array_equal(coarse.faces, whole.faces)
    assert kg_error_percent(whole.vertices, coarse.vertices) < 15  # another order: above 100


def test_corrections_are_omitted_with_fewer_modes():
    sequence = irregular_sequence(20)
    data = encode(sequence, max_error=1.0)
    assert info(data).budget_bytes["corrections"] > 30
    (n_modes,) = info(data).n_modes
    whole, uncorrected = decode(data).vertices, decode(data, n_modes=n_modes).vertices
    diagonal = np.linalg.norm(np.ptp(sequence.vertices, axis=(0, 1)))
    errors, uncorrected_errors = (
        np.linalg.norm(found - sequence.vertices, axis=2) / diagonal
        for found in (whole, uncorrected)
    )
    is_moved = np.abs(whole - uncorrected).max(axis=2) > 1e-6 * diagonal
    assert errors.max() <= 0.01
    assert uncorrected_errors[is_moved].min() > 0.0099
    assert uncorrected_errors[~is_moved].max() <= 0.01


@pytest.mark.parametrize("n_modes", [0, -1, 2.5])
def test_decoding_refuses_an_invalid_number_of_modes(n_modes):
    with pytest.raises(InvalidInputError, match="n_modes must be a whole number of at least 1"):
        decode(encode(waving_grid(3), effort=5), n_modes=n_modes)


@pytest.mark.parametrize("name", ["lossless", "grid"])
def test_decoding_refuses_a_number_of_modes_for_methods_without_modes(name):
    data = encode(waving_grid(3), name, max_error=0.1 if name == "grid" else None)
    with pytest.raises(InvalidInputError, match=f"method {name} has no modes; omit n_modes"):
        decode(data, n_modes=2)
