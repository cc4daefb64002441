"""Saving of frames that are read while they are written."""

import tracemalloc

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.formats.load import load
from meshreel.formats.save import save
from meshreel.model.sequence import MeshSequence
from samples.meshes import waving_grid
from samples.opening import open_source, stored

OUTPUTS = ["f_%02d.obj", "f_%02d.ply", "f_%02d.off", "f_%02d.stl", "a.npz", "a.reel"]


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("output", OUTPUTS)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_saving_stored_frames_writes_the_bytes_of_loaded_ones(tmp_path, output, dtype):
    sequence = waving_grid()
    save(sequence.replace(vertices=sequence.vertices.astype(dtype)), tmp_path / "f_%d.ply")
    folders = [tmp_path / "opened", tmp_path / "loaded"]
    for folder, read in zip(folders, [open_source, load], strict=True):
        folder.mkdir()
        save(read(tmp_path / "*.ply"), folder / output)
    assert contents(folders[0]) == contents(folders[1])
    assert len(contents(folders[0])) == (sequence.n_frames if "%" in output else 1)


@pytest.mark.parametrize("output", [*OUTPUTS, "a.usda", "a.usdz", "a.abc"])
@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (np.nan, "every position must be finite; vertex 0 of frame 3 has x = nan"),
        (None, "the file ends here"),
    ],
)
def test_nothing_is_written_when_frames_cannot_be_read(tmp_path, output, changed, message):
    def read(start, stop):
        if changed is None and stop > 3:
            raise InvalidInputError("the file ends here")
        vertices = sequence.vertices[start:stop].copy()
        vertices[np.arange(start, stop) == 3] = changed
        return vertices

    sequence = waving_grid(5)
    with pytest.raises(InvalidInputError, match=message):
        save(stored(sequence, read), tmp_path / output)
    assert contents(tmp_path) == {}


def test_folder_is_checked_before_frames_are_read(tmp_path):
    def read(start, stop):
        raise AssertionError

    with pytest.raises(InvalidInputError, match=r"the output folder .*none does not exist"):
        save(stored(waving_grid(5), read), tmp_path / "none/a.npz")


@pytest.mark.slow
@pytest.mark.parametrize("output", ["f_%03d.ply", "f_%03d.stl", "a.npz"])
def test_saving_stored_frames_needs_a_tenth_of_the_memory(tmp_path, output):
    n_frames, n_verts = 200, 3000
    faces = np.arange(n_verts, dtype=np.int32).reshape(-1, 3)
    mesh = MeshSequence(np.zeros((1, n_verts, 3), np.float32), faces)
    frames = stored(
        mesh,
        lambda start, stop: np.full((stop - start, n_verts, 3), start, np.float32),
        n_frames=n_frames,
    )

    def write():
        save(frames, tmp_path / output, overwrite=True)

    write()  # first use imports modules and fills caches, which must not count
    tracemalloc.start()
    try:
        write()
        assert tracemalloc.get_traced_memory()[1] < n_frames * n_verts * 12 / 10
    finally:
        tracemalloc.stop()
