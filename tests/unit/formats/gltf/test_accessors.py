import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.gltf import document
from meshreel.formats.gltf.document import Document, JsonObject
from meshreel.formats.load import load
from samples.gltf import Gltf


@pytest.fixture
def read(tmp_path):
    """A function that reads the first accessor of a file."""

    def values(file, *kinds, extension="glb", count=None):
        path = file.save(tmp_path / f"a.{extension}")
        opened = Document(path)
        holder = JsonObject({"it": 0}, "holder", opened.lists)
        return opened.read(holder, "it", *kinds, count=count)

    return values


@pytest.mark.parametrize("extension", ["glb", "gltf"])
@pytest.mark.parametrize("dtype", ["i1", "u1", "i2", "u2", "u4", "f4"])
def test_accessors_of_every_component_type_are_read(read, dtype, extension):
    info = np.finfo(dtype) if dtype == "f4" else np.iinfo(dtype)
    numbers = np.array([[info.min, 0, 1], [info.max, 3, 2]], dtype)
    file = Gltf()
    file.accessor(numbers, dtype)
    result = read(file, "VEC3", extension=extension)
    assert result.array.dtype == np.dtype(f"<{dtype}")
    np.testing.assert_array_equal(result.array, numbers)
    np.testing.assert_array_equal(result.floats(), numbers.astype(np.float64))


@pytest.mark.parametrize(
    ("dtype", "integers", "expected"),
    [
        ("i1", [-128, -127, 0, 127], [-1, -1, 0, 1]),
        ("u1", [0, 51, 255], [0, 0.2, 1]),
        ("i2", [-32768, -32767, 32767], [-1, -1, 1]),
        ("u2", [0, 13107, 65535], [0, 0.2, 1]),
    ],
)
def test_normalized_integers_are_read_as_fractions(read, dtype, integers, expected):
    file = Gltf()
    file.accessor(integers, dtype, normalized=True)
    np.testing.assert_array_equal(read(file, "SCALAR").floats()[:, 0], np.array(expected))


def test_interleaved_elements_are_read_with_their_stride(read):
    rows = np.arange(24, dtype="<f4").reshape(4, 6)
    file = Gltf()
    view = file.view(rows.tobytes(), byteStride=24)
    file.add("accessors", bufferView=view, byteOffset=8, componentType=5126, count=4, type="VEC3")
    np.testing.assert_array_equal(read(file, "VEC3").array, rows[:, 2:5])


def sparse_file(base, rows, values, dtype="u1", count=5):
    file = Gltf()
    indices = file.view(np.array(rows, f"<{dtype}").tobytes())
    numbers = file.view(np.array(values, "<f4").tobytes())
    code = {"u1": 5121, "u2": 5123, "u4": 5125}[dtype]
    sparse = {
        "count": len(rows),
        "indices": {"bufferView": indices, "componentType": code},
        "values": {"bufferView": numbers},
    }
    more = {} if base is None else {"bufferView": file.view(np.array(base, "<f4").tobytes())}
    file.add("accessors", componentType=5126, count=count, type="VEC2", sparse=sparse, **more)
    return file


@pytest.mark.parametrize("dtype", ["u1", "u2", "u4"])
@pytest.mark.parametrize("base", [None, np.arange(10).reshape(5, 2)])
def test_sparse_accessors_replace_values(read, base, dtype):
    expected = np.zeros((5, 2)) if base is None else base.astype(float)
    expected[[1, 4]] = [[7, 8], [9, 10]]
    result = read(sparse_file(base, [1, 4], [[7, 8], [9, 10]], dtype), "VEC2")
    np.testing.assert_array_equal(result.array, expected)


def test_sparse_index_out_of_range_is_rejected(read):
    with pytest.raises(FormatError, match=r"indices: refers to element 5; there are 5"):
        read(sparse_file(None, [1, 5], [[7, 8], [9, 10]]), "VEC2")


@pytest.mark.parametrize(
    ("kind", "change", "message"),
    [
        ("accessors", {"count": 4}, r"accessor 0: 4 elements of 12 bytes with stride 12, from"),
        ("accessors", {"byteOffset": 4}, r"exceed the 36 bytes"),
        ("accessors", {"count": 0}, "'count' must be at least 1"),
        ("accessors", {"count": -1}, "'count' must be an integer from 0 to 2.53; got -1"),
        ("accessors", {"count": 1 << 50}, r"exceed the 36 bytes"),
        ("accessors", {"count": 10**300}, "'count' must be an integer"),
        ("accessors", {"type": "VEC2"}, "'type' must be VEC3; got 'VEC2'"),
        ("accessors", {"componentType": 5130}, "'componentType' must be one of 5120"),
        ("accessors", {"bufferView": 1}, "'bufferView' must be below 1"),
        ("accessors", {"bufferView": True}, "'bufferView' must be an integer"),
        ("accessors", {"normalized": 1}, "'normalized' must be true or false"),
        ("bufferViews", {"byteLength": 40}, r"buffer view 0: bytes 0\.\.40 exceed buffer 0"),
        ("bufferViews", {"byteOffset": 1 << 52}, "exceed buffer 0"),
        ("bufferViews", {"buffer": 1}, "'buffer' must be below 1"),
        ("bufferViews", {"byteStride": 4}, "elements of 12 bytes have a stride of 4 bytes"),
    ],
)
def test_accessors_and_views_that_contradict_their_bytes_are_rejected(read, kind, change, message):
    file = Gltf()
    file.accessor(np.zeros((3, 3)))
    file.json[kind][0].update(change)
    with pytest.raises(FormatError, match=message):
        read(file, "VEC3")


@pytest.mark.parametrize("count", [6_000_000, 1 << 40])
def test_large_accessor_without_bytes_is_rejected(read, count):
    file = Gltf()
    file.add("accessors", componentType=5126, count=count, type="VEC3")
    with pytest.raises(FormatError, match="more than 32 times its size, and more than 64 MiB"):
        read(file, "VEC3")


def test_animation_with_too_many_zeros_is_left_out(tmp_path, notes):
    file = Gltf.of_mesh()
    file.animate(0, "translation", [0, 1], np.zeros((2, 3)))
    sampler = file.json["animations"][0]["samplers"][0]
    # 24 MB, and 48 MB in double precision.
    sampler["input"] = file.add("accessors", componentType=5126, count=6_000_000, type="SCALAR")
    assert load(file.save(tmp_path / "a.glb"), notes=notes).n_frames == 1
    assert "the arrays of the file would need more than 32 times its size" in notes[0]


def test_objects_that_refer_to_one_accessor_share_its_values(tmp_path):
    file = Gltf()
    file.accessor(np.zeros((2, 3)))
    opened = Document(file.save(tmp_path / "a.glb"))
    holders = [JsonObject({"it": 0}, "holder", opened.lists), JsonObject({}, "none", opened.lists)]
    first, second, none = opened.read_each([holders[0], *holders], "it", "VEC3", count=2)
    assert first is second
    assert none is None


def test_accessor_with_another_count_than_required_is_rejected(read):
    file = Gltf()
    file.accessor(np.zeros((3, 3)))
    with pytest.raises(FormatError, match=r"'count' must be 4, as holder requires; got 3"):
        read(file, "VEC3", count=4)


def test_accessors_that_share_bytes_too_often_are_rejected(tmp_path, monkeypatch):
    monkeypatch.setattr(document, "MIN_EXPANDED_BYTES", 1000)
    file = Gltf()
    file.accessor(np.zeros((1000, 3)))
    result = Document(file.save(tmp_path / "a.glb"))
    holder = JsonObject({"it": 0}, "holder", result.lists)

    def read_often():
        for _ in range(96):
            result.read(holder, "it", "VEC3")

    with pytest.raises(FormatError, match="accessor 0: the arrays of the file would need more"):
        read_often()
