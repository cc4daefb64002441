"""Registration in a folder continues after an interruption."""

import mmap
import os
import tempfile

import numpy as np
import pytest

from meshreel import InvalidInputError
from meshreel.registration.register import register
from meshreel.registration.stores import FolderStore, TemporaryStore
from samples.captures import capture

TOLERANCE = 0.5


@pytest.fixture(scope="module")
def raw():
    return capture(5, 0.3)


def memory_of(array):
    """The object that owns the memory of an array."""
    while isinstance(array, np.ndarray) and array.base is not None:
        array = array.base
    return array


@pytest.mark.slow
def test_a_finished_registration_is_read_from_its_folder(raw, tmp_path):
    first = register(raw, tolerance=TOLERANCE, folder=tmp_path)
    again = register(raw, tolerance=TOLERANCE, folder=tmp_path)
    (segment,), (other,) = first.sequence.segments, again.sequence.segments
    assert isinstance(memory_of(segment.read(0, 5)), mmap.mmap)
    assert np.array_equal(segment.read(0, 5), other.read(0, 5))
    assert not list(tmp_path.glob("*frame*"))


@pytest.mark.slow
def test_without_a_folder_frames_are_in_a_file_without_a_name(raw, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    (segment,) = register(raw, tolerance=TOLERANCE).sequence.segments
    assert isinstance(memory_of(segment.read(0, 5)), mmap.mmap)
    if os.name == "posix":
        assert not list(tmp_path.iterdir())


def test_a_store_returns_the_frames_of_each_key():
    store, frames = TemporaryStore(), np.arange(30, dtype=np.float32).reshape(5, 2, 3)
    for number in (3, 2, 4):
        store.put("first", number, frames[number])
        store.put("other", number, -frames[number])
    assert np.array_equal(store.stack("first", range(2, 5)), frames[2:5])
    assert np.array_equal(store.stack("other", range(2, 4)), -frames[2:4])


@pytest.mark.parametrize("n_frames", [0, 2])
def test_stores_keep_segments(tmp_path, n_frames):
    arrays = {"positions": np.ones((n_frames, 3, 3), np.float32), "faces": np.arange(3)}
    for store in (TemporaryStore(), FolderStore(tmp_path / "folder", "digest")):
        kept = store.keep("run", [arrays, arrays])
        for found in (kept, store.kept("run") or kept):
            np.testing.assert_equal(found, [arrays, arrays])
            assert found[0]["positions"].shape == (n_frames, 3, 3)


def test_the_folder_of_another_tolerance_is_refused(raw, tmp_path):
    register(raw[:2], tolerance=TOLERANCE, folder=tmp_path)
    with pytest.raises(InvalidInputError, match="with another tolerance"):
        register(raw[:2], tolerance=0.6, folder=tmp_path)


def test_a_folder_with_other_files_is_refused(raw, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InvalidInputError, match="is no folder of a registration"):
        register(raw, tolerance=TOLERANCE, folder=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]
