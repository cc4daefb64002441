"""Random and sequential access to frames of a file."""

import threading
from concurrent.futures import ThreadPoolExecutor
from io import BytesIO

import numpy as np
import pytest

import meshreel
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import info
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import CorruptStreamError, InvalidInputError, TruncatedStreamError
from samples.meshes import irregular_sequence, waving_grid
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


def test_frames_in_any_order_equal_decode(reel, method):
    for number in (22, 0, 13, 13, 4, -1, 7):
        assert_nearly_equal(reel[number], WHOLE[method].vertices[number])


@pytest.mark.parametrize(
    "part",
    [slice(3, 14), slice(None), slice(20, None), slice(5, 5), slice(2, 20, 5), slice(9, 2, -3)],
)
def test_ranges_across_blocks_equal_decode(reel, method, part):
    assert_nearly_equal(reel[part], WHOLE[method].vertices[part])
    assert reel[part].dtype == WHOLE[method].vertices.dtype


def test_iteration_yields_all_frames_in_order(reel, method):
    assert_nearly_equal(np.stack(list(reel)), WHOLE[method].vertices)


def test_opening_decodes_nothing(reel, method, monkeypatch):
    monkeypatch.setattr(type(reel), "_frames", None)
    assert (len(reel), reel.n_frames) == (23, 23)
    assert (reel.fps, reel.name) == (WHOLE[method].fps, WHOLE[method].name)
    np.testing.assert_array_equal(reel.faces, WHOLE[method].faces)
    assert reel.info() == info(STREAMS[method])


def test_only_needed_blocks_are_read():
    class File(BytesIO):
        def fetch(self, start, stop):
            fetched.append(start)

    fetched: list[int] = []
    with ReelFile(File(encode(waving_grid(23), block_frames=4))) as reel:
        _ = reel.faces
        places = [reel._opened.file.block(number).offset for number in range(6)]
        fetched.clear()
        _ = reel[9], reel[8], reel[10:14], reel[11]
        needed = [places[2], places[0], places[3]]  # the first is the key block of others
        assert fetched == needed
        _ = reel[8], reel[12]
        assert fetched == needed


def test_complete_blocks_of_a_truncated_file_are_decoded(method):
    for number, groups in enumerate(Stream(STREAMS[method]).groups[1:], start=1):
        with ReelFile(BytesIO(STREAMS[method][: groups[-1][1] - 1])) as reel:
            assert not reel.is_whole
            assert len(reel) == 4 * number
            assert_nearly_equal(reel[:], WHOLE[method].vertices[: 4 * number])


def test_missing_frames_are_refused(reel):
    with pytest.raises(IndexError, match="no frame 23; there are 23"):
        reel[23]
    with pytest.raises(InvalidInputError, match="frames 3:24 are not in the file"):
        reel.read(3, 24)


def test_limited_modes_give_a_coarser_animation():
    data = encode(waving_grid(), step=0.001)
    with ReelFile(BytesIO(data), n_modes=1) as reel:
        np.testing.assert_array_equal(reel[:], decode(data, n_modes=1).vertices)


def test_damage_is_reported_on_reading_the_damaged_block(method):
    data = bytearray(STREAMS[method])
    data[Stream(STREAMS[method]).groups[2][-1][1] - 1] ^= 1
    with ReelFile(BytesIO(bytes(data))) as reel:
        assert len(reel[:8]) == 8
        with pytest.raises(CorruptStreamError):
            reel[8]


def test_error_of_opening_another_file_names_it(tmp_path):
    path = tmp_path / "short.reel"
    path.write_bytes(STREAMS["reel"][:100])
    with pytest.raises(TruncatedStreamError, match=r"short\.reel: "):
        meshreel.open(path)


def test_with_statement_closes_the_file(tmp_path):
    path = tmp_path / "walk.reel"
    path.write_bytes(STREAMS["reel"])
    with meshreel.open(path) as reel:
        assert reel[0].shape == (reel.n_verts, 3)
    with pytest.raises(ValueError, match="closed"):
        reel[22]


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
        found = super().seek(*place)
        if self.armed:
            self.armed = False
            self.is_paused.set()
            self.may_go_on.wait(0.2)  # times out if the other reader waits for this one
        return found


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
