import json

import numpy as np
import pytest

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.load import load
from samples.gltf import Gltf, glb, moving_triangle

PACKED = {"EXT_meshopt_compression": {"fallback": True}}


def apart(folder, uri, file=None):
    """A glTF file that names another for its data."""
    file = file or moving_triangle()
    file.json["buffers"] = [{"byteLength": len(file.data), "uri": uri}]
    return file.save(folder / "a.gltf")


@pytest.mark.parametrize(
    ("uri", "name"),
    [("a.bin", "a.bin"), ("sub/my%20data.bin", "sub/my data.bin"), ("./a.bin", "a.bin")],
)
def test_load_reads_the_file_beside_when_data_lies_there(tmp_path, uri, name):
    file = moving_triangle()
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_bytes(file.data + b"more")
    expected = load(moving_triangle().save(tmp_path / "b.glb"))
    found = load(apart(tmp_path, uri, file))
    assert found.vertices.tobytes() == expected.vertices.tobytes()


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
def test_load_is_refused_when_data_is_in_no_file(tmp_path, uri):
    folder = tmp_path / "in"
    folder.mkdir()
    (tmp_path / "a.bin").write_bytes(moving_triangle().data)
    for is_allowed in (False, True):
        with pytest.raises(FormatError, match=r"a\.gltf: buffer 0: .*only files in the folder"):
            load(apart(folder, uri), allow_outside=is_allowed)


@pytest.mark.parametrize(
    "uri", ["../a.bin", "sub/../../a.bin", "%2e%2e/a.bin", "{above}/a.bin", "link.bin"]
)
def test_load_reads_data_outside_of_the_folder_only_when_that_is_allowed(tmp_path, uri):
    folder = tmp_path / "in"
    (folder / "sub").mkdir(parents=True)
    (tmp_path / "a.bin").write_bytes(moving_triangle().data)
    (folder / "link.bin").symlink_to(tmp_path / "a.bin")
    path = apart(folder, uri.format(above=tmp_path))
    with pytest.raises(FormatError, match=r"a\.gltf: buffer 0: names the file .* --allow-outside"):
        load(path)
    expected = load(moving_triangle().save(tmp_path / "b.glb"))
    assert load(path, allow_outside=True).vertices.tobytes() == expected.vertices.tobytes()


@pytest.mark.parametrize("uri", ["/etc/passwd", "../gone.bin"])
def test_load_does_not_say_what_is_outside_of_the_folder(tmp_path, uri):
    with pytest.raises(FormatError, match="outside of its folder"):
        load(apart(tmp_path, uri))


def test_load_names_the_file_when_it_is_not_beside(tmp_path):
    with pytest.raises(FormatError, match=r"there is no file 'a\.bin' beside the glTF file"):
        load(apart(tmp_path, "a.bin"))


@pytest.mark.parametrize("name", ["x" * 300, "sub"])
def test_load_is_refused_when_data_is_no_file(tmp_path, name):
    (tmp_path / "sub").mkdir()
    with pytest.raises((FormatError, InvalidInputError), match=r"no file|cannot be read"):
        load(apart(tmp_path, name))


def test_load_is_refused_when_the_file_beside_is_short(tmp_path):
    file = moving_triangle()
    (tmp_path / "a.bin").write_bytes(file.data[:-1])
    size = len(file.data)
    with pytest.raises(FormatError, match=rf"a\.bin has {size - 1} bytes; {size} are announced"):
        load(apart(tmp_path, "a.bin", file))


@pytest.mark.parametrize("data", ["A", "AAAA", "%%%%", "ä"])
def test_load_is_refused_when_base64_is_damaged(tmp_path, data):
    with pytest.raises(FormatError, match=r"a\.gltf: buffer 0: "):
        load(apart(tmp_path, f"data:application/octet-stream;base64,{data}"))


def test_load_is_refused_when_there_is_no_binary_chunk(tmp_path):
    file = moving_triangle()
    file.json["buffers"] = [{"byteLength": len(file.data)}]
    (tmp_path / "a.gltf").write_text(json.dumps(file.json))
    with pytest.raises(FormatError, match="buffer 0: has no 'uri', and there is no binary chunk"):
        load(tmp_path / "a.gltf")


def test_load_names_the_extension_when_a_buffer_is_only_packed(tmp_path):
    file = moving_triangle()
    file.json["buffers"] = [{"byteLength": 8}, {"byteLength": len(file.data), "extensions": PACKED}]
    for view in file.json["bufferViews"]:
        view["buffer"] = 1
    (tmp_path / "a.glb").write_bytes(glb(file.json, file.data))
    with pytest.raises(FormatError, match="buffer 1: is the fallback of EXT_meshopt_compression"):
        load(tmp_path / "a.glb")


def test_load_reads_a_text_file_when_it_is_called_glb(tmp_path):
    path = moving_triangle().save(tmp_path / "a.gltf").rename(tmp_path / "a.glb")
    assert load(path).n_frames == 3


def test_load_reads_the_file_when_it_begins_with_a_byte_order_mark(tmp_path):
    path = moving_triangle().save(tmp_path / "a.gltf")
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert load(path).n_frames == 3


def test_load_passes_over_chunks_when_a_program_added_its_own(tmp_path):
    file = Gltf()
    file.node(mesh=file.mesh())
    path = file.save(tmp_path / "a.glb")
    data = path.read_bytes()
    size = len(data) + 12
    path.write_bytes(data[:8] + size.to_bytes(4, "little") + data[12:] + b"\x04\0\0\0XTRAabcd")
    np.testing.assert_array_equal(load(path).vertices[0], [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
