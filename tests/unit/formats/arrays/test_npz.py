import zipfile

import numpy as np
import pytest

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.load import load
from meshreel.operations.save import save
from samples.arrays import store
from samples.meshes import waving_grid

FACES = np.array([[0, 1, 2]])
VERTICES = np.eye(3, dtype=np.float32)[None].repeat(2, axis=0)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_save_writes_the_bytes_of_savez(tmp_path, make_sequence, dtype):
    sequence = make_sequence(3, dtype, fps=23.976, name="Ödipus")
    save(sequence, tmp_path / "a.npz")
    arrays = {"vertices": sequence.vertices, "faces": sequence.faces}
    store(tmp_path / "b.npz", **arrays, fps=np.float64(23.976), name=np.str_("Ödipus"))
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_npz_reads_big_endian_and_compressed_arrays(tmp_path):
    path = tmp_path / "a.npz"
    np.savez_compressed(path, vertices=VERTICES.astype(">f8"), faces=FACES.astype(">i8"))
    loaded = load(path)
    assert loaded.vertices.dtype.isnative
    np.testing.assert_array_equal(loaded.vertices, VERTICES)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"verts": VERTICES, "faces": FACES}, "no array 'vertices'; it contains verts, faces"),
        ({}, "no array 'vertices' and no array 'faces'; it contains nothing"),
    ],
)
def test_errors_list_the_arrays_if_one_is_missing(tmp_path, arrays, message):
    with pytest.raises(FormatError, match=rf"a\.npz: .*{message}"):
        load(store(tmp_path / "a.npz", **arrays))


@pytest.fixture
def packed(tmp_path, monkeypatch):
    """A static mesh of 60 kB compressed to 2 kB, with the limit for any file set to 10 kB."""
    monkeypatch.setattr("meshreel.formats.arrays.npz.MIN_UNPACKED_BYTES", 10_000)
    still = np.eye(3, dtype=np.float32)[None].repeat(1700, axis=0)
    np.savez_compressed(tmp_path / "still.npz", vertices=still, faces=FACES)
    return tmp_path / "still.npz"


def test_error_for_excessive_expansion_gives_sizes_and_remedy(packed, read):
    message = (
        r"still\.npz: has 0\.\d+ MB that would unpack to .* GB; .* at most 32 times .*np\.savez"
    )
    with pytest.raises(FormatError, match=message):
        read(packed)


def test_remedy_of_the_expansion_error_works(packed, tmp_path, read):
    np.savez(tmp_path / "plain.npz", **np.load(packed))
    result = read(tmp_path / "plain.npz")
    np.testing.assert_array_equal(result.read(0, 1700), np.load(packed)["vertices"])


def test_small_arrays_may_expand_without_limit(packed, monkeypatch):
    monkeypatch.setattr("meshreel.formats.arrays.npz.MIN_UNPACKED_BYTES", 100_000)
    assert load(packed).n_frames == 1700


def test_oversized_declared_shape_is_rejected_before_allocation(tmp_path):
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w") as archive:
        with archive.open("vertices.npy", "w") as stream:
            shape = {"descr": "<f4", "fortran_order": False, "shape": (1 << 40, 3, 3)}
            np.lib.format.write_array_header_1_0(stream, shape)
        with archive.open("faces.npy", "w") as stream:
            np.lib.format.write_array(stream, FACES)
    with pytest.raises(FormatError, match=r"vertices\.npy declares shape \(1099511627776, 3, 3\)"):
        load(path)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"vertices": np.array([None])}, r"vertices\.npy contains Python objects"),
        ({"attribute_names": np.array(["a"])}, "1 attribute_names, 0 attribute_kinds and 0"),
        (
            {
                "attribute_names": np.array(["a"]),
                "attribute_kinds": np.array(["uv"]),
                "attribute_domains": np.array(["vertex"]),
            },
            "has no array 'attribute_0_values', which other arrays refer to",
        ),
        (
            {
                "attribute_names": np.array(["a"]),
                "attribute_kinds": np.array(["taste"]),
                "attribute_domains": np.array(["vertex"]),
            },
            "attribute_kinds must be one of uv, color, other; got 'taste'",
        ),
        ({"attribute_names": np.arange(3)}, r"attribute_names must be text of shape \(N,\)"),
        ({"group_names": np.array(["a"])}, "has no array 'group_0_numbers'"),
        ({"part_names": np.array(["a"])}, r"part_sizes must be integers of shape \(1, 2\)"),
        ({"part_sizes": np.array(["a"])}, r"part_sizes must be integers of shape \(0, 2\)"),
        ({"face_sizes": np.array([4])}, "face_sizes imply 2 triangles; the mesh has 1"),
        ({"start_s": np.array([1, 2])}, "start_s must be one number"),
        ({"start_s": np.nan}, "start_s must be finite"),
    ],
)
def test_errors_explain_invalid_arrays(tmp_path, arrays, message):
    path = store(tmp_path / "a.npz", **{"vertices": VERTICES, "faces": FACES, **arrays})
    with pytest.raises((FormatError, InvalidInputError), match=rf"a\.npz: .*{message}"):
        load(path)


def test_memory_error_is_not_reported_as_damage(tmp_path, monkeypatch):
    save(waving_grid(), tmp_path / "walk.npz")

    def failing(*args, **options):
        raise MemoryError

    monkeypatch.setattr("meshreel.formats.arrays.npz.np.load", failing)
    with pytest.raises(MemoryError):
        load(tmp_path / "walk.npz")
