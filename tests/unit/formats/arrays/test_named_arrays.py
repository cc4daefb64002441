import numpy as np
import pytest

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.arrays.named_arrays import Layout, find_layout, has_positions
from meshreel.formats.load import load
from meshreel.formats.save import save
from meshreel.model.surface import PLAIN
from samples.arrays import store
from samples.datasets import (
    assert_same_positions,
    plain_sequence,
    positions_of,
    surfaced_sequence,
)
from samples.meshes import assert_same_surface

FIRST, LAST = Layout.FRAMES_FIRST, Layout.FRAMES_LAST


@pytest.mark.parametrize(
    ("shape", "largest", "is_documented", "expected"),
    [
        ((7, 5, 3), 4, False, FIRST),
        ((5, 3, 7), 4, False, LAST),
        ((5, 3, 3), 4, False, LAST),  # vertex 4 needs more than three vertices
        ((5, 3, 3), 4, True, LAST),
        ((5, 3, 3), 2, False, FIRST),  # exactly three vertices, all used
        ((3, 3, 3), 2, True, FIRST),
        ((2, 3, 3), 2, False, FIRST),
    ],
)
def test_axis_of_three_or_faces_decide_the_layout(shape, largest, is_documented, expected):
    faces = np.array([[0, 1, largest]])
    assert find_layout(shape, faces, "x", is_documented=is_documented) is expected


@pytest.mark.parametrize(("shape", "largest"), [((3, 3, 3), 2), ((9, 3, 3), 1), ((2, 3, 3), 5)])
def test_ambiguous_layout_is_rejected(shape, largest):
    with pytest.raises(InvalidInputError, match=rf"up to {largest}: it may be \(T, V, 3\) or"):
        find_layout(shape, np.array([[0, 1, largest]]), "x", is_documented=False)


@pytest.mark.parametrize("shape", [(), (3,), (5, 3), (3, 5, 4), (5, 4, 2), (2, 5, 3, 3)])
def test_layout_without_an_axis_of_three_is_rejected(shape):
    with pytest.raises(
        InvalidInputError, match=r"x must have shape \(T, V, 3\) or \(V, 3, T\); got \("
    ):
        find_layout(shape, np.array([[0, 1, 2]]), "x", is_documented=True)
    assert not has_positions(shape)


FACES = np.array([[0, 1, 2], [2, 3, 4]], np.uint32)
POSITIONS = np.random.default_rng(0).random((7, 5, 3)).astype(np.float32)
NOT_FINITE = POSITIONS.copy()
NOT_FINITE[3, 2, 1] = np.nan
LIBRARY_FILE = {"npz": "a numpy archive", "h5": "an HDF5 file"}


@pytest.mark.parametrize("extension", ["npz", "h5", "hdf5", "hdf"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("n_frames", [1, 5])
def test_sequence_round_trips_exactly(tmp_path, extension, dtype, n_frames, read, notes):
    if extension != "npz":
        pytest.importorskip("h5py")
    sequence = surfaced_sequence(n_frames, dtype, 29.97, 1 / 3, name="Ödipus/1")
    [path] = save(sequence, tmp_path / f"a.{extension}", notes=notes)
    result = read(path, notes=notes)
    assert_same_positions(result, sequence)
    assert_same_surface(result.surface, sequence.surface)
    assert (result.fps, result.start_s, result.name) == (29.97, 1 / 3, "Ödipus/1")
    assert notes == []


@pytest.mark.parametrize("fps", [0.0, 24.0, 23.98765])
def test_sequence_without_surface_round_trips(tmp_path, extension, fps):
    [path] = save(plain_sequence(fps=fps), tmp_path / f"a.{extension}")
    loaded = load(path)
    assert_same_surface(loaded.surface, PLAIN)
    assert (loaded.fps, loaded.start_s) == (fps, 0.0)
    assert load(path, fps=60).fps == 60


def test_default_name_is_the_file_stem(tmp_path, extension):
    loaded = load(store(tmp_path / f"walk.{extension}", vertices=POSITIONS, faces=FACES))
    assert (loaded.name, loaded.fps) == ("walk", 0.0)


@pytest.mark.parametrize(
    ("name", "options"), [("vertices", {}), ("50002_hips", {"dataset": "50002_hips"})]
)
def test_positions_with_frames_last_are_transposed(tmp_path, extension, read, name, options):
    scans = {name: POSITIONS.transpose(1, 2, 0), "50004_hips": np.zeros((5, 3, 2))}
    path = store(tmp_path / f"registrations_f.{extension}", faces=FACES, fps=30, **scans)
    result = read(path, **options)
    assert positions_of(result).tobytes() == POSITIONS.tobytes()
    expected = name if extension == "h5" and options else "registrations_f"
    assert (result.name, result.fps) == (expected, 30)
    np.testing.assert_array_equal(result.faces, FACES)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"vertices": POSITIONS[0]}, r"vertices must have shape \(T, V, 3\).*; got \(5, 3\)"),
        ({"vertices": POSITIONS[:0]}, "is empty|needs at least one frame; got none"),
        ({"vertices": POSITIONS.astype(np.float16)}, "vertices must be float32 or float64"),
        ({"vertices": NOT_FINITE}, "vertex 2 of frame 3 has y = nan"),
        ({"faces": FACES + 1}, r"face 1 is \[3, 4, 5\]; indices must be in 0..4"),
        ({"fps": "fast"}, "fps must be one number"),
        ({"fps": np.ones(2)}, "fps must be one number"),
    ],
)
def test_errors_explain_invalid_arrays(tmp_path, extension, arrays, message, read):
    path = store(tmp_path / f"a.{extension}", **{"vertices": POSITIONS, "faces": FACES, **arrays})
    with pytest.raises((FormatError, InvalidInputError), match=rf"a\.{extension}: .*({message})"):
        read(path)


@pytest.mark.parametrize("keep", [0, 4, 100, 2000, -30])
def test_load_rejects_truncated_files(tmp_path, extension, keep):
    [path] = save(surfaced_sequence(), tmp_path / f"a.{extension}")
    path.write_bytes(path.read_bytes()[:keep])
    message = rf"a\.{extension}: is not {LIBRARY_FILE[extension]}, or is damaged"
    with pytest.raises(FormatError, match=message):
        load(path)
