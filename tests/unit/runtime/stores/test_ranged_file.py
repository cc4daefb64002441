"""Fetched and cached ranges of a remote file."""

import os

import fsspec
import numpy as np
import pytest

from meshreel.runtime.stores.ranged_file import END_BYTES, MIN_REQUEST_BYTES, RangedFile

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
