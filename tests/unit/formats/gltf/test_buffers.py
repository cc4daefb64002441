import json

import numpy as np
import pytest

from meshreel.errors import FormatError, InvalidInputError
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
    ],
)
def test_load_rejects_uris_that_are_not_relative_paths(tmp_path, uri):
    folder = tmp_path / "in"
    folder.mkdir()
    (tmp_path / "a.bin").write_bytes(moving_triangle().data)
    for is_allowed in (False, True):
        with pytest.raises(FormatError, match=r"a\.gltf: buffer 0: .*only files in the folder"):
            load(with_external_buffer(folder, uri), allow_outside=is_allowed)


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
