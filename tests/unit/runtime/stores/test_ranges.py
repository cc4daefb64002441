"""A remote `.reel`: only the bytes that are asked for travel."""

import numpy as np
import pytest

import meshreel
from meshreel.codec.joining import join_streams
from meshreel.runtime.stores.ranged_file import END_BYTES, MIN_REQUEST_BYTES
from samples.meshes import waving_grid
from samples.streams import Stream

N_FRAMES, BLOCK = 160, 8


@pytest.fixture(scope="module")
def reel_bytes():
    """A stream of twenty blocks, each longer than what is fetched at once without being asked."""
    sequence = waving_grid(N_FRAMES, 30, 30)
    rng = np.random.default_rng(1)
    noisy = sequence.vertices + rng.normal(0, 0.01, sequence.vertices.shape).astype(np.float32)
    values = rng.normal(size=(N_FRAMES, noisy.shape[1])).astype(np.float32)
    return meshreel.encode(
        meshreel.MeshSequence(noisy, sequence.faces, 25.0, tracks={"heat": meshreel.Track(values)}),
        quality=60, block_frames=BLOCK, tracks={"heat": "1%"},
    )  # fmt: skip


@pytest.fixture
def reel(web, reel_bytes):
    """The address of the stream."""
    (web.folder / "walk.reel").write_bytes(reel_bytes)
    return f"{web.address}/walk.reel"


@pytest.fixture
def groups(reel_bytes):
    return Stream(reel_bytes).groups


def n_gets(web):
    return sum(method == "GET" for method, _, _ in web.requests)


def test_opening_fetches_the_ends_only(web, reel, groups):
    with meshreel.open(reel) as opened:
        assert opened.n_frames == N_FRAMES
    first = groups[0][0][0]
    for start, stop in web.ranges():
        assert stop <= max(END_BYTES, first) or start >= groups[-1][-1][1] - END_BYTES
    assert n_gets(web) <= 3


def test_a_frame_fetches_its_block_with_one_request(web, reel, groups):
    expected = meshreel.decode((web.folder / "walk.reel").read_bytes()).vertices[75]
    with meshreel.open(reel) as opened:
        assert groups[0][0][1] < END_BYTES, "the key block came with the beginning"
        web.forget()
        frame = opened[75]
        assert np.array_equal(frame, expected)
        start, stop = groups[75 // BLOCK][0]
        assert web.ranges() == [(start, stop)]
        assert n_gets(web) == 1
        assert web.sent_bytes == stop - start
        web.forget()
        _ = opened[76], opened[72]
        assert n_gets(web) == 0


def test_a_value_of_a_track_fetches_its_group_and_that_of_the_key(web, reel, groups):
    expected = meshreel.decode((web.folder / "walk.reel").read_bytes()).tracks["heat"].values[75]
    with meshreel.open(reel) as opened:
        web.forget()
        assert np.array_equal(opened.track("heat")[75], expected)
    asked = set(web.ranges())
    assert groups[75 // BLOCK][1] in asked
    assert asked <= {groups[number][1] for number in (0, 75 // BLOCK)}


def test_some_frames_are_decoded_from_their_blocks_only(web, reel, groups):
    part = meshreel.decode(reel, frames=slice(150, 160))
    whole = meshreel.decode((web.folder / "walk.reel").read_bytes())
    assert np.array_equal(part.vertices, whole.vertices[150:160])
    assert np.array_equal(part.tracks["heat"].values, whole.tracks["heat"].values[150:160])
    assert web.sent_bytes < (web.folder / "walk.reel").stat().st_size / 2


def test_all_frames_are_decoded_from_one_answer(web, reel):
    decoded = meshreel.decode(reel)
    assert decoded.n_frames == N_FRAMES
    assert n_gets(web) == 1


def test_info_is_that_of_the_file_from_a_few_of_its_bytes(web, reel):
    found = meshreel.info(reel)
    assert found == meshreel.info((web.folder / "walk.reel").read_bytes())
    size_bytes = (web.folder / "walk.reel").stat().st_size
    assert web.sent_bytes < 2 * END_BYTES + 2 * MIN_REQUEST_BYTES * (N_FRAMES // BLOCK) * 4
    assert web.sent_bytes < size_bytes / 3


def test_info_of_a_file_that_is_cut_off_is_that_of_its_complete_blocks(web, reel, groups):
    path = web.folder / "walk.reel"
    path.write_bytes(path.read_bytes()[: groups[3][-1][1] + 5])
    found = meshreel.info(reel)
    assert not found.is_whole
    assert found.n_frames == 4 * BLOCK


def test_a_damaged_block_is_found_when_it_is_asked_for(web, reel, groups):
    path = web.folder / "walk.reel"
    data = bytearray(path.read_bytes())
    data[sum(groups[5][0]) // 2] ^= 255
    path.write_bytes(data)
    with meshreel.open(reel) as opened:
        assert np.isfinite(opened[0]).all()
        with pytest.raises(meshreel.CorruptStreamError, match="checksum"):
            _ = opened[5 * BLOCK]


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("no ranges", "does not support byte ranges"),
        ("no length", "does not support byte ranges"),
        ("short", "was cut short"),
        ("cut", "was cut short"),
        ("refuse", "credentials"),
    ],
)
def test_open_says_what_a_server_lacks(web, reel, fault, words):
    web.faults.add(fault)
    with pytest.raises(meshreel.StoreError, match=words) as failure:
        meshreel.open(reel)
    assert reel in str(failure.value)
    assert "\n" not in str(failure.value)


def test_all_is_decoded_where_there_are_no_ranges(web, reel):
    web.faults.add("no ranges")
    assert meshreel.decode(reel).n_frames == N_FRAMES


def test_answer_that_ends_in_the_middle_is_an_error(web, reel):
    web.faults.add("cut")
    with pytest.raises(meshreel.StoreError, match="was cut short"):
        meshreel.decode(reel)


@pytest.mark.parametrize("function", [meshreel.open, meshreel.decode, meshreel.info, meshreel.load])
def test_file_that_is_not_there_is_said(web, function):
    with pytest.raises(meshreel.StoreError, match=r"there is no http://.*/none\.reel"):
        function(f"{web.address}/none.reel")


def test_server_that_is_not_there_is_said(web):
    with pytest.raises(meshreel.StoreError, match="cannot be reached"):
        meshreel.open("http://127.0.0.1:9/walk.reel")


def test_a_segment_of_many_is_found_with_one_request_for_the_index(web):
    sheet = waving_grid(1, 20, 20)
    rng = np.random.default_rng(2)
    vertices = sheet.vertices + rng.normal(0, 0.1, sheet.vertices.shape).astype(np.float32)
    stream = meshreel.encode(meshreel.MeshSequence(vertices, sheet.faces), quality=70)
    (web.folder / "many.reel").write_bytes(join_streams([stream] * 4000))
    with meshreel.open(f"{web.address}/many.reel", segment=1234) as opened:
        assert n_gets(web) <= 5  # of them one for the index, and one for the mesh of the segment
        web.forget()
        assert np.array_equal(opened[0], meshreel.decode(stream).vertices[0])
        assert n_gets(web) <= 2
