import zipfile

import numpy as np
import pytest

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.npz import read_npz
from meshreel.formats.save import save

FACES = np.array([[0, 1, 2]])
VERTICES = np.eye(3, dtype=np.float32)[None].repeat(2, axis=0)


def store(path, **arrays):
    np.savez(path, **arrays)
    return path


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_read_npz_gives_back_the_sequence_when_save_wrote_it(tmp_path, make_sequence, dtype):
    sequence = make_sequence(3, dtype, fps=23.976, name="Ödipus")
    save(sequence, tmp_path / "a.npz")
    found = read_npz(tmp_path / "a.npz")
    assert found.vertices.tobytes() == sequence.vertices.tobytes()
    np.testing.assert_array_equal(found.faces, sequence.faces)
    assert (found.vertices.dtype, found.fps, found.name) == (dtype, 23.976, "Ödipus")


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_save_writes_the_bytes_of_savez_when_the_target_is_npz(tmp_path, make_sequence, dtype):
    sequence = make_sequence(3, dtype, fps=23.976, name="Ödipus")
    save(sequence, tmp_path / "a.npz")
    arrays = {"vertices": sequence.vertices, "faces": sequence.faces}
    store(tmp_path / "b.npz", **arrays, fps=np.float64(23.976), name=np.str_("Ödipus"))
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_read_npz_takes_the_file_stem_when_there_is_no_name(tmp_path):
    found = read_npz(store(tmp_path / "walk.npz", vertices=VERTICES, faces=FACES))
    assert (found.name, found.fps) == ("walk", 0.0)


def test_read_npz_prefers_the_argument_when_fps_is_in_the_file_too(tmp_path):
    path = store(tmp_path / "a.npz", vertices=VERTICES, faces=FACES, fps=np.float32(25))
    assert read_npz(path, fps=60).fps == 60


def test_read_npz_reads_arrays_when_they_are_big_endian_and_compressed(tmp_path):
    path = tmp_path / "a.npz"
    np.savez_compressed(path, vertices=VERTICES.astype(">f8"), faces=FACES.astype(">i8"))
    found = read_npz(path)
    assert found.vertices.dtype.isnative
    np.testing.assert_array_equal(found.vertices, VERTICES)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"verts": VERTICES, "faces": FACES}, "no array 'vertices'; it holds verts, faces"),
        ({}, "no array 'vertices' and no array 'faces'; it holds nothing"),
        ({"vertices": np.array([None]), "faces": FACES}, r"vertices\.npy holds Python objects"),
        ({"vertices": VERTICES, "faces": FACES, "fps": np.ones(2)}, "fps must be one number"),
        ({"vertices": VERTICES, "faces": FACES, "fps": "fast"}, "fps must be one number"),
    ],
)
def test_read_npz_says_what_it_found_when_arrays_are_missing_or_odd(tmp_path, arrays, message):
    with pytest.raises(FormatError, match=rf"a\.npz: .*{message}"):
        read_npz(store(tmp_path / "a.npz", **arrays))


def test_read_npz_names_the_file_when_the_arrays_are_no_sequence(tmp_path):
    path = store(tmp_path / "a.npz", vertices=VERTICES[0], faces=FACES)
    with pytest.raises(InvalidInputError, match=r"a\.npz: vertices must have shape \(T, V, 3\)"):
        read_npz(path)


@pytest.mark.parametrize("keep", [0, 10, -30])
def test_read_npz_is_refused_when_the_archive_is_cut_short(tmp_path, keep):
    path = store(tmp_path / "a.npz", vertices=VERTICES, faces=FACES)
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(FormatError, match=r"a\.npz: is not a numpy archive, or is damaged"):
        read_npz(path)


def test_read_npz_allocates_nothing_when_the_declared_shape_exceeds_the_data(tmp_path):
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w") as archive:
        with archive.open("vertices.npy", "w") as stream:
            shape = {"descr": "<f4", "fortran_order": False, "shape": (1 << 40, 3, 3)}
            np.lib.format.write_array_header_1_0(stream, shape)
        with archive.open("faces.npy", "w") as stream:
            np.lib.format.write_array(stream, FACES)
    with pytest.raises(FormatError, match=r"vertices\.npy declares shape \(1099511627776, 3, 3\)"):
        read_npz(path)
