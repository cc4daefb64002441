import json

import numpy as np
import pytest

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.gltf.container import BufferWriter, write_document
from meshreel.formats.load import load
from samples.gltf import Gltf, glb, moving_triangle

PACKED = {"EXT_meshopt_compression": {"fallback": True}}


def with_external_buffer(folder, uri, file=None):
    """Write a glTF file whose buffer has this URI, and return its path."""
    file = file or moving_triangle()
    file.json["buffers"] = [{"byteLength": len(file.data), "uri": uri}]
    return file.save(folder / "a.gltf")


@pytest.mark.parametrize(
    ("uri", "name"),
    [("a.bin", "a.bin"), ("sub/my%20data.bin", "sub/my data.bin"), ("./a.bin", "a.bin")],
)
def test_load_reads_an_external_buffer(tmp_path, uri, name):
    file = moving_triangle()
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_bytes(file.data + b"more")
    expected = load(moving_triangle().save(tmp_path / "b.glb"))
    loaded = load(with_external_buffer(tmp_path, uri, file))
    assert loaded.vertices.tobytes() == expected.vertices.tobytes()


@pytest.mark.parametrize(
    "uri",
    [
        "..\\a.bin",
        "C:\\a.bin",
        "C:a.bin",
        "\\\\host\\a.bin",
        "//host/a.bin",
        "file:///etc/passwd",
        "http://example.com/a.bin",
        "a.bin%00.txt",
        "",
        "data:application/octet-stream,AAAA",
        "data:application/octet-stream," + "%00" * 10**6,
        "a/" * 2500,
    ],
    ids=lambda uri: uri[:40],
)
def test_load_rejects_uris_that_are_not_relative_paths(tmp_path, uri):
    folder = tmp_path / "in"
    folder.mkdir()
    (tmp_path / "a.bin").write_bytes(moving_triangle().data)
    message = r"a\.gltf: buffer 0: .*(only files in the folder|a path has at most 4096)"
    for is_allowed in (False, True):
        with pytest.raises(FormatError, match=message) as caught:
            load(with_external_buffer(folder, uri), allow_outside=is_allowed)
        assert len(str(caught.value)) < 1000


@pytest.mark.parametrize(
    "uri", ["../a.bin", "sub/../../a.bin", "%2e%2e/a.bin", "{above}/a.bin", "link.bin"]
)
def test_load_reads_buffers_outside_of_the_folder_only_with_permission(tmp_path, uri):
    folder = tmp_path / "in"
    (folder / "sub").mkdir(parents=True)
    (tmp_path / "a.bin").write_bytes(moving_triangle().data)
    (folder / "link.bin").symlink_to(tmp_path / "a.bin")
    path = with_external_buffer(folder, uri.format(above=tmp_path))
    with pytest.raises(
        FormatError, match=r"a\.gltf: buffer 0: refers to the file .* allow_outside"
    ):
        load(path)
    expected = load(moving_triangle().save(tmp_path / "b.glb"))
    assert load(path, allow_outside=True).vertices.tobytes() == expected.vertices.tobytes()


@pytest.mark.parametrize("uri", ["/etc/passwd", "../gone.bin"])
def test_load_does_not_reveal_whether_an_outside_file_exists(tmp_path, uri):
    with pytest.raises(FormatError, match="outside its folder"):
        load(with_external_buffer(tmp_path, uri))


def test_load_names_a_missing_external_buffer(tmp_path):
    with pytest.raises(FormatError, match=r"refers to the file 'a\.bin', which does not exist"):
        load(with_external_buffer(tmp_path, "a.bin"))


@pytest.mark.parametrize("name", ["x" * 300, "sub"])
def test_load_rejects_an_external_buffer_that_is_not_a_file(tmp_path, name):
    (tmp_path / "sub").mkdir()
    with pytest.raises((FormatError, InvalidInputError), match=r"not a path|does not exist"):
        load(with_external_buffer(tmp_path, name))


def test_load_rejects_a_truncated_external_buffer(tmp_path):
    file = moving_triangle()
    (tmp_path / "a.bin").write_bytes(file.data[:-1])
    size = len(file.data)
    with pytest.raises(FormatError, match=rf"has {size - 1} of the declared {size} bytes"):
        load(with_external_buffer(tmp_path, "a.bin", file))


@pytest.mark.parametrize("data", ["A", "AAAA", "%%%%", "ä"])
def test_load_rejects_damaged_base64(tmp_path, data):
    with pytest.raises(FormatError, match=r"a\.gltf: buffer 0: "):
        load(with_external_buffer(tmp_path, f"data:application/octet-stream;base64,{data}"))


def test_load_rejects_a_buffer_without_data(tmp_path):
    file = moving_triangle()
    file.json["buffers"] = [{"byteLength": len(file.data)}]
    (tmp_path / "a.gltf").write_text(json.dumps(file.json))
    with pytest.raises(FormatError, match="buffer 0: has neither 'uri' nor a binary chunk"):
        load(tmp_path / "a.gltf")


def test_load_names_the_extension_of_a_fallback_buffer(tmp_path):
    file = moving_triangle()
    file.json["buffers"] = [{"byteLength": 8}, {"byteLength": len(file.data), "extensions": PACKED}]
    for view in file.json["bufferViews"]:
        view["buffer"] = 1
    (tmp_path / "a.glb").write_bytes(glb(file.json, file.data))
    with pytest.raises(FormatError, match="buffer 1: is the fallback of EXT_meshopt_compression"):
        load(tmp_path / "a.glb")


def test_load_reads_a_text_file_with_the_extension_glb(tmp_path):
    path = moving_triangle().save(tmp_path / "a.gltf").rename(tmp_path / "a.glb")
    assert load(path).n_frames == 3


def test_load_reads_a_file_with_a_byte_order_mark(tmp_path):
    path = moving_triangle().save(tmp_path / "a.gltf")
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert load(path).n_frames == 3


def test_load_ignores_additional_chunks(tmp_path):
    path = Gltf.of_mesh().save(tmp_path / "a.glb")
    data = path.read_bytes()
    size = len(data) + 12
    path.write_bytes(data[:8] + size.to_bytes(4, "little") + data[12:] + b"\x04\0\0\0XTRAabcd")
    np.testing.assert_array_equal(load(path).vertices[0], [[0, 0, 0], [1, 0, 0], [0, 1, 0]])


@pytest.mark.parametrize(("n_verts", "component"), [(65535, 5123), (65536, 5125)])
def test_add_indices_avoids_the_primitive_restart_index(n_verts, component):
    buffer = BufferWriter()
    buffer.add_indices(np.array([0, 1, n_verts - 1]))
    assert buffer.accessors[0]["componentType"] == component


def test_add_vertices_pads_to_four_bytes():
    buffer = BufferWriter()
    arrays = [np.full((2, 3), value, np.uint8) for value in (1, 2)]
    stored = buffer.add_vertices(arrays)
    assert b"".join(buffer.pieces) == b"\1\1\1\0" * 2 + b"\2\2\2\0" * 2
    assert [(one.offset, one.stride) for one in stored] == [(0, 4), (8, 4)]


def test_buffer_views_are_aligned_to_four_bytes():
    buffer = BufferWriter()
    buffer.add_indices(np.array([0, 1, 2]))
    buffer.add_indices(np.array([0, 1, 2]))
    assert [view["byteOffset"] for view in buffer.views] == [0, 8]
    assert buffer.size_bytes == sum(map(len, buffer.pieces)) == 16


@pytest.mark.parametrize(
    ("name", "expected"), [("COLOR_0", True), ("_id", None), ("POSITION", True)]
)
def test_vertex_accessor_is_normalized_except_for_custom_attributes(name, expected):
    buffer = BufferWriter()
    (stored,) = buffer.add_vertices([np.zeros((4, 3), np.uint8)])
    buffer.vertex_accessors({name: stored}, slice(1, 3))
    accessor = buffer.accessors[0]
    assert (accessor.get("normalized"), accessor["count"]) == (expected, 2)
    assert accessor["byteOffset"] == 4


def test_uncompressed_files_need_no_extension():
    """Godot reads neither `KHR_mesh_quantization` nor compressed buffers."""
    vectors = np.array([[127, 0, 0], [-64, 64, 64], [0, 0, 0]], np.int8)
    buffer = BufferWriter()
    [displacements] = buffer.add_vertices([vectors])
    [normals] = buffer.add_vertices([vectors], are_unit=True)
    assert not buffer.is_quantized
    assert displacements.values.dtype == normals.values.dtype == np.float32
    np.testing.assert_allclose(displacements.values, vectors / 127, rtol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(normals.values[:2], axis=1), 1, rtol=1e-6)
    compressed = BufferWriter(is_compressed=True)
    [stored] = compressed.add_vertices([vectors])
    assert compressed.is_quantized
    assert stored.values.dtype == np.int8


LARGEST = (1 << 32) - 4  # sizes are multiples of 4


def file_size(path, buffer_bytes):
    """Return the size of a file with such a buffer, whose bytes are not written."""
    buffer = BufferWriter()
    buffer.size_bytes = buffer_bytes
    return write_document(path, {}, buffer, "less").stored


def test_files_are_limited_to_the_size_that_the_header_can_store(tmp_path):
    path = tmp_path / "a.glb"
    largest = LARGEST - (file_size(path, 1 << 31) - (1 << 31))
    assert file_size(path, largest) == LARGEST
    assert path.read_bytes()[8:12] == LARGEST.to_bytes(4, "little")
    with pytest.raises(InvalidInputError, match="at most 4294967295; less"):
        file_size(path, largest + 4)
