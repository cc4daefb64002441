import tracemalloc

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.formats.load import load
from meshreel.formats.save import save, save_frames
from samples.meshes import waving_grid
from samples.opening import open_source

OUTPUTS = ["f_%02d.obj", "f_%02d.ply", "f_%02d.off", "f_%02d.stl", "a.npz", "a.reel"]


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def failing(blocks):
    yield from blocks
    raise InvalidInputError("the stream ends here")


@pytest.fixture
def write(tmp_path, make_sequence):
    """Save blocks of frames, declared as five frames by default."""

    def write(blocks, output="f_%d.obj", n_frames=5, **kwargs):
        faces = make_sequence(1).faces
        return save_frames(blocks, faces, tmp_path / output, n_frames=n_frames, **kwargs)

    return write


@pytest.mark.parametrize("output", OUTPUTS)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_save_frames_writes_the_bytes_of_save(tmp_path, output, dtype):
    sequence = waving_grid()
    vertices, n_frames = sequence.vertices.astype(dtype), sequence.n_frames
    folders = [tmp_path / "blocks", tmp_path / "whole"]
    for folder, cuts in zip(folders, [[1, 1, 4], []], strict=True):
        folder.mkdir()
        blocks = np.split(vertices, cuts)
        save_frames(blocks, sequence.faces, folder / output, n_frames=n_frames, fps=25, name="grid")
    whole = contents(folders[1])
    assert contents(folders[0]) == whole
    assert len(whole) == (n_frames if "%" in output else 1)


@pytest.mark.parametrize("output", OUTPUTS[:5])
def test_saving_stored_frames_writes_the_bytes_of_loaded_ones(tmp_path, make_sequence, output):
    save(make_sequence(4, np.float64, 1e5), tmp_path / "f_%d.ply")
    folders = [tmp_path / "opened", tmp_path / "loaded"]
    for folder, read in zip(folders, [open_source, load], strict=True):
        folder.mkdir()
        save(read(tmp_path / "*.ply"), folder / output)
    assert contents(folders[0]) == contents(folders[1]) != {}


def test_save_frames_reports_progress_for_every_frame(write, make_sequence):
    seen = []
    blocks = np.split(make_sequence(4).vertices, [3])
    write(blocks, "a.npz", n_frames=4, progress=lambda *step: seen.append(step))
    shares = [0.25, 0.5, 0.75, 1.0, 1.0]
    assert seen == [("writing", share) for share in shares]


@pytest.mark.parametrize("output", OUTPUTS)
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda blocks: blocks[:4], "expected 5 frames; received 4"),
        (lambda blocks: [*blocks, blocks[0]], "expected 5 frames; received 6 or more"),
        (lambda blocks: [], "needs at least one frame; got none"),
        (lambda blocks: [blocks[0][:0]], "needs at least one frame; got none"),
        (lambda blocks: [blocks[0][0]], r"shape \(T, V, 3\); got \(6, 3\)"),
        (lambda blocks: [blocks[0].astype(int)], "must be float32 or float64; got int64"),
        (
            lambda blocks: [*blocks[:2], blocks[2].astype(np.float64)],
            r"block at frame 2 has shape \(1, 6, 3\) and type float64; .* and float32",
        ),
        (lambda blocks: [blocks[0], blocks[1][:, :5]], r"block at frame 1 has shape \(1, 5, 3"),
        (
            lambda blocks: [*blocks[:3], blocks[3] * np.float32(np.nan), blocks[4]],
            "every position must be finite; vertex 0 of frame 3 has x = nan",
        ),
        (lambda blocks: failing(blocks[:3]), "the stream ends here"),
    ],
)
def test_save_frames_writes_nothing_if_blocks_are_inconsistent(
    tmp_path, write, make_sequence, output, change, message
):
    blocks = np.split(make_sequence(5).vertices, 5)
    with pytest.raises(InvalidInputError, match=message):
        write(change(blocks), output)
    assert contents(tmp_path) == {}


def test_save_frames_error_names_the_invalid_face(write, make_sequence):
    with pytest.raises(InvalidInputError, match=r"indices must be in 0\.\.3"):
        write([make_sequence(5).vertices[:, :4]])


def test_save_frames_rejects_zero_frames(write, make_sequence):
    with pytest.raises(InvalidInputError, match="needs at least one frame; got n_frames 0"):
        write([make_sequence(1).vertices], n_frames=0)


@pytest.mark.parametrize("output", ["none/a.npz"])
def test_save_frames_checks_the_folder_before_reading(write, output):
    with pytest.raises(InvalidInputError, match=r"the output folder .*none does not exist"):
        write(failing([]), output)


@pytest.mark.parametrize("output", ["f_%03d.ply", "f_%03d.stl", "a.npz"])
def test_save_frames_needs_a_tenth_of_the_memory(tmp_path, output):
    n_frames, n_verts = 200, 3000
    faces = np.arange(n_verts).reshape(-1, 3)

    def write():
        blocks = (np.full((1, n_verts, 3), index, np.float32) for index in range(n_frames))
        save_frames(blocks, faces, tmp_path / output, n_frames=n_frames, overwrite=True)

    write()  # first use imports modules and fills caches, which must not count
    tracemalloc.start()
    try:
        write()
        assert tracemalloc.get_traced_memory()[1] < n_frames * n_verts * 12 / 10
    finally:
        tracemalloc.stop()
