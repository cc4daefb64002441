"""Remote files, of which only the needed bytes are fetched and cached."""

import os
import shutil

import fsspec
import numpy as np
import pytest

import meshreel
from meshreel.codec.joining import join_streams
from meshreel.runtime.stores.ranged_file import END_BYTES, MIN_REQUEST_BYTES, RangedFile
from samples.meshes import waving_grid
from samples.streams import Stream

N_FRAMES, BLOCK = 160, 8

MAX_SOCKET_BYTES = 16e6
"""What the sockets of a connection may buffer of an endless answer."""


@pytest.fixture(scope="module")
def reel_bytes():
    """A stream of twenty blocks, each larger than the automatically fetched ends."""
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


@pytest.mark.slow
def test_opening_fetches_the_ends_only(web, reel, groups):
    with meshreel.open(reel) as opened:
        assert opened.n_frames == N_FRAMES
    first = groups[0][0][0]
    for start, stop in web.ranges():
        assert stop <= max(END_BYTES, first) or start >= groups[-1][-1][1] - END_BYTES
    assert n_gets(web) <= 3


def test_frame_needs_one_request_for_its_block(web, reel, groups):
    expected = meshreel.decode((web.folder / "walk.reel").read_bytes()).vertices[75]
    with meshreel.open(reel) as opened:
        assert groups[0][0][1] < END_BYTES, "the key block came with the beginning"
        web.forget()
        frame = opened[75].vertices
        assert np.array_equal(frame, expected)
        start, stop = groups[75 // BLOCK][0]
        assert web.ranges() == [(start, stop)]
        assert n_gets(web) == 1
        assert web.sent_bytes == stop - start
        web.forget()
        _ = opened[76], opened[72]
        assert n_gets(web) == 0


def test_track_value_fetches_its_group_those_of_positions_and_of_the_key_block(web, reel, groups):
    expected = meshreel.decode((web.folder / "walk.reel").read_bytes()).tracks["heat"].values[75]
    with meshreel.open(reel) as opened:
        web.forget()
        assert np.array_equal(opened.track("heat")[75], expected)
    requested = set(web.ranges())
    assert groups[75 // BLOCK][1] in requested
    assert requested <= {group for number in (0, 75 // BLOCK) for group in groups[number]}


def test_selected_frames_fetch_only_their_blocks(web, reel, groups):
    part = meshreel.decode(reel, frames=slice(150, 160))
    whole = meshreel.decode((web.folder / "walk.reel").read_bytes())
    assert np.array_equal(part.vertices, whole.vertices[150:160])
    assert np.array_equal(part.tracks["heat"].values, whole.tracks["heat"].values[150:160])
    assert web.sent_bytes < (web.folder / "walk.reel").stat().st_size / 2


def test_all_frames_need_one_request(web, reel):
    decoded = meshreel.decode(reel)
    assert decoded.n_frames == N_FRAMES
    assert n_gets(web) == 1


def test_info_fetches_few_bytes(web, reel):
    info = meshreel.info(reel)
    assert info == meshreel.info((web.folder / "walk.reel").read_bytes())
    size_bytes = (web.folder / "walk.reel").stat().st_size
    assert web.sent_bytes < 2 * END_BYTES + 2 * MIN_REQUEST_BYTES * (N_FRAMES // BLOCK) * 4
    assert web.sent_bytes < size_bytes / 3


def test_info_of_a_truncated_file_describes_its_complete_blocks(web, reel, groups):
    path = web.folder / "walk.reel"
    path.write_bytes(path.read_bytes()[: groups[3][-1][1] + 5])
    info = meshreel.info(reel)
    assert not info.is_whole
    assert info.n_frames == 4 * BLOCK


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("no ranges", "does not support byte ranges"),
        ("no length", "does not support byte ranges"),
        ("short", "was cut short"),
        ("cut", "was cut short"),
        ("refuse", "credentials"),
        ("gzip", "gzip-encoded"),
        ("from 0", "the range 'bytes 0-"),
        ("other file", "the range 'bytes 0-16383/1000000'"),
        ("no place", "the range ''"),
    ],
)
def test_open_names_the_deficiency_of_a_server(web, reel, fault, words):
    web.faults.add(fault)
    with pytest.raises(meshreel.StoreError, match=words) as failure:
        meshreel.open(reel)
    assert reel in str(failure.value)
    assert "\n" not in str(failure.value)


def test_an_endless_answer_is_read_as_far_as_requested(web, reel):
    expected = meshreel.decode((web.folder / "walk.reel").read_bytes()).vertices[75]
    web.faults.add("endless")
    with meshreel.open(reel) as opened:
        n_requests = n_gets(web)
        assert np.array_equal(opened[75].vertices, expected)
    assert n_gets(web) > n_requests
    assert web.sent_bytes < MAX_SOCKET_BYTES * n_gets(web)


def test_requests_ask_for_bytes_without_encoding(web, reel):
    meshreel.open(reel).close()
    assert web.encodings == {"identity"}


def test_whole_stream_is_decoded_without_range_support(web, reel):
    web.faults.add("no ranges")
    assert meshreel.decode(reel).n_frames == N_FRAMES


@pytest.mark.every_case
@pytest.mark.parametrize("read", [meshreel.decode, meshreel.load])
@pytest.mark.parametrize(
    ("fault", "error", "words"),
    [
        ("gzip", meshreel.StoreError, "gzip-encoded"),
        ("endless", meshreel.StoreError, "more than 1 MB, the limit without an announced size"),
        ("cut", meshreel.StoreError, "was cut short"),
        ("understated", meshreel.MeshReelError, "ends too early|failed: Client"),
        ("drip", meshreel.StoreError, "fewer than 4096 bytes"),
    ],
)
def test_no_answer_brings_more_than_it_may(web, reel, monkeypatch, read, fault, error, words):
    monkeypatch.setattr("meshreel.runtime.stores.transfer.PATIENCE_S", 0.2)
    web.faults |= {fault, "no ranges"}
    with pytest.raises(error, match=words):
        read(reel, memory="1MB")
    assert web.sent_bytes < MAX_SOCKET_BYTES
    assert "identity" in web.encodings


def test_only_a_file_in_memory_is_limited_by_its_announced_size(web, reel, monkeypatch):
    with pytest.raises(meshreel.StoreError, match=r"room for 100 kB; .* memory$"):
        meshreel.decode(reel, memory="100kB")
    assert web.sent_bytes < MAX_SOCKET_BYTES
    meshreel.save(waving_grid(1, 100, 100), web.folder / "walk.obj")
    usage, size_bytes = shutil.disk_usage(web.folder), (web.folder / "walk.obj").stat().st_size
    usage = usage._replace(free=size_bytes)
    monkeypatch.setattr("shutil.disk_usage", lambda folder: usage)
    assert meshreel.load(f"{web.address}/walk.obj", memory="100kB").n_verts == 10_000
    usage = usage._replace(free=size_bytes - 1)
    with pytest.raises(meshreel.StoreError, match="has 575 kB; there is room for 575 kB"):
        meshreel.load(f"{web.address}/walk.obj")


@pytest.mark.parametrize("function", [meshreel.open, meshreel.decode, meshreel.info, meshreel.load])
def test_missing_file_is_named(web, function):
    with pytest.raises(meshreel.StoreError, match=r"there is no http://.*/none\.reel"):
        function(f"{web.address}/none.reel")


def test_unreachable_server_is_named(web):
    with pytest.raises(meshreel.StoreError, match="cannot be reached"):
        meshreel.open("http://127.0.0.1:9/walk.reel")


@pytest.mark.slow
def test_segment_of_many_needs_one_request_for_the_index(web):
    sheet = waving_grid(1, 20, 20)
    rng = np.random.default_rng(2)
    vertices = sheet.vertices + rng.normal(0, 0.1, sheet.vertices.shape).astype(np.float32)
    stream = meshreel.encode(meshreel.MeshSequence(vertices, sheet.faces), quality=70)
    (web.folder / "many.reel").write_bytes(join_streams([stream] * 4000))
    with meshreel.open(f"{web.address}/many.reel", segment=1234) as opened:
        assert n_gets(web) <= 5  # including one for the index and one for the mesh of the segment
        web.forget()
        assert np.array_equal(opened[0].vertices, meshreel.decode(stream).vertices[0])
        assert n_gets(web) <= 2


DATA = np.random.default_rng(5).bytes(200_000)
FIRST, SECOND, THIRD = (20_000, 30_000), (60_000, 70_000), (100_000, 110_000)


@pytest.fixture
def address():
    store = fsspec.filesystem("memory")
    store.pipe("/bucket/walk.reel", DATA)
    yield "memory://bucket/walk.reel"
    store.store.clear()


def requests_of(file, start, stop):
    """Read and check some bytes; return the number of requests."""
    before = file.n_requests
    file.seek(start)
    assert file.read(stop - start) == DATA[start:stop]
    return file.n_requests - before


def test_ends_are_fetched_when_a_file_is_opened(address):
    file = RangedFile(address)
    assert (file.n_requests, file.fetched_bytes) == (2, 2 * END_BYTES)
    assert requests_of(file, 0, END_BYTES) == 0
    assert requests_of(file, len(DATA) - END_BYTES, len(DATA)) == 0


def test_announced_range_is_fetched_once_and_exactly(address):
    file = RangedFile(address)
    file.fetch(*FIRST)
    file.fetch(*FIRST)
    assert (file.n_requests, file.fetched_bytes) == (3, 2 * END_BYTES + 10_000)
    assert requests_of(file, FIRST[0], FIRST[1]) == 0
    assert requests_of(file, FIRST[1] - 1, FIRST[1] + 1) == 1
    assert requests_of(file, FIRST[1], FIRST[1] - 1 + MIN_REQUEST_BYTES) == 0
    assert requests_of(file, FIRST[0] - 1, FIRST[0]) == 1


def test_least_recently_used_range_is_discarded_first(address, monkeypatch):
    monkeypatch.setattr("meshreel.runtime.stores.ranged_file.CACHE_BYTES", 2 * END_BYTES + 20_000)
    file = RangedFile(address)
    file.fetch(*FIRST)
    file.fetch(*SECOND)  # all together just fit
    assert requests_of(file, 0, END_BYTES) == 0
    assert requests_of(file, len(DATA) - END_BYTES, len(DATA)) == 0
    assert requests_of(file, *FIRST) == 0
    file.fetch(*THIRD)
    assert [requests_of(file, *one) for one in (FIRST, THIRD, (0, END_BYTES))] == [0, 0, 0]
    assert requests_of(file, *SECOND) == 1


def test_range_larger_than_the_cache_is_kept(address, monkeypatch):
    monkeypatch.setattr("meshreel.runtime.stores.ranged_file.CACHE_BYTES", 100)
    file = RangedFile(address)
    assert requests_of(file, *FIRST) == 1
    assert requests_of(file, *FIRST) == 0


def test_position_follows_seek_and_read(address):
    file = RangedFile(address)
    assert file.seek(10) == 10
    assert file.seek(5, os.SEEK_CUR) == 15
    assert file.read(3) == DATA[15:18]
    assert file.tell() == 18
    assert file.seek(-7, os.SEEK_END) == len(DATA) - 7
    assert file.read() == DATA[-7:]
    assert (file.read(), file.read(4)) == (b"", b"")
    assert file.seek(-20) == 0


def test_another_process_opens_the_remote_file_again(address, monkeypatch):
    file, connections = RangedFile(address), []
    connect = file._connect
    monkeypatch.setattr(file, "_connect", lambda: (connections.append(1), connect()))
    assert (requests_of(file, *FIRST), len(connections)) == (1, 0)
    monkeypatch.setattr("os.getpid", lambda: -1)
    assert (requests_of(file, *SECOND), len(connections)) == (1, 1)
    assert (requests_of(file, *THIRD), len(connections)) == (1, 1)


def test_close_releases_the_remote_file(address, monkeypatch):
    closed = []
    file = RangedFile(address)
    monkeypatch.setattr(file._file, "close", lambda: closed.append(True))
    for _ in range(2):
        file.close()
        assert (file.closed, closed, len(file._cache)) == (True, [True], 0)
