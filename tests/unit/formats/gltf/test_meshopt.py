"""Buffer views that are compressed with meshoptimizer."""

import base64
import contextlib
import zlib

import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.gltf.meshopt import decode_view
from meshreel.formats.load import load
from samples.costs import draws
from samples.gltf import SQUARE, SQUARE_FACES, Gltf, glb, shifted
from samples.meshopt import SQUARE as PACKED_SQUARE
from samples.meshopt import STREAMS

EXTENSIONS = ["EXT_meshopt_compression", "KHR_meshopt_compression"]


def decode(data, mode, kind, count, stride):
    return decode_view(data, count, stride, mode, kind)


@pytest.mark.parametrize(("mode", "kind", "count", "stride", "text", "expected"), STREAMS)
def test_streams_decode_like_the_library(mode, kind, count, stride, text, expected):
    decoded = decode(base64.b64decode(text), mode, kind, count, stride)
    assert (decoded.shape, decoded.dtype) == ((count * stride,), np.uint8)
    if kind == "NONE":
        assert zlib.crc32(decoded) == expected
        return
    wanted = np.frombuffer(base64.b64decode(expected), np.uint8)
    if kind == "EXPONENTIAL":  # exact
        np.testing.assert_array_equal(decoded, wanted)
        return
    dtype = f"{'u' if kind == 'COLOR' else 'i'}{stride // 4}"
    difference = decoded.view(dtype).astype(int) - wanted.view(dtype)
    assert np.abs(difference).max() <= 1


@pytest.mark.parametrize(("mode", "kind", "count", "stride", "text", "expected"), STREAMS)
def test_damaged_streams_decode_or_raise_our_error(mode, kind, count, stride, text, expected):
    data = base64.b64decode(text)
    rng = np.random.default_rng(len(data))
    damaged = [data[:end] for end in range(0, len(data), 7)] + [data + b"\0"]
    for _ in range(draws(40)):
        changed = bytearray(data)
        changed[rng.integers(len(data))] = rng.integers(256)
        damaged.append(bytes(changed))
    for one in damaged:
        with contextlib.suppress(FormatError):
            assert decode(one, mode, kind, count, stride).nbytes == count * stride


@pytest.mark.parametrize(("mode", "kind", "count", "stride", "text", "expected"), STREAMS)
def test_streams_with_fewer_elements_than_declared_are_rejected(
    mode, kind, count, stride, text, expected
):
    with pytest.raises(FormatError, match=r"^(ends|does not)"):
        decode(base64.b64decode(text), mode, kind, count + 300, stride)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("ATTRIBUTES", "NONE", 4, 6), "'byteStride' must be a multiple of 4 up to 256; got 6"),
        (("ATTRIBUTES", "NONE", 4, 0), "'byteStride' must be a multiple of 4 up to 256; got 0"),
        (("ATTRIBUTES", "OCTAHEDRAL", 4, 12), "'filter' must be one of .* match its byteStride"),
        (("ATTRIBUTES", "SHARPEN", 4, 4), "'filter' must be one of .*; got 'SHARPEN'"),
        (("MESHLETS", "NONE", 4, 4), "'mode' must be ATTRIBUTES, TRIANGLES or INDICES"),
        (("TRIANGLES", "NONE", 4, 2), "TRIANGLES a count divisible by 3; got NONE, 2 and 4"),
        (("INDICES", "COLOR", 4, 4), "INDICES must have no filter"),
        (("INDICES", "NONE", 4, 1), "a byteStride of 2 or 4"),
    ],
)
def test_invalid_extensions_of_buffer_views_are_rejected(arguments, message):
    with pytest.raises(FormatError, match=f"{message}"):
        decode(b"", *arguments)


def packed_square(extension):
    """Return a file with a square that moves along x by 0, 1 and 2, fully compressed."""
    file = Gltf()
    file.json["extensionsRequired"] = [extension]
    arrays = {
        "positions": ("VEC3", 5126, 4, 12, "ATTRIBUTES", {}),
        "indices": ("SCALAR", 5123, 6, 2, "TRIANGLES", {}),
        "keys": ("SCALAR", 5126, 3, 4, "ATTRIBUTES", {}),
        "moves": ("VEC3", 5126, 3, 12, "ATTRIBUTES", {"filter": "EXPONENTIAL"}),
    }
    start, numbers = 0, {}
    for name, (kind, component, count, stride, mode, more) in arrays.items():
        view = file.view(base64.b64decode(PACKED_SQUARE[name]))
        plain = file.json["bufferViews"][view]
        packed = {**plain, "byteStride": stride, "count": count, "mode": mode, **more}
        size = count * stride
        plain |= {"buffer": 1, "byteOffset": start, "byteLength": size}
        plain["extensions"] = {extension: packed}
        start += size
        numbers[name] = file.add(
            "accessors", bufferView=view, componentType=component, count=count, type=kind
        )
    file.json["buffers"] = [
        {"byteLength": len(file.data)},
        {"byteLength": start, "extensions": {extension: {"fallback": True}}},
    ]
    primitive = {"attributes": {"POSITION": numbers["positions"]}, "indices": numbers["indices"]}
    node = file.node(mesh=file.add("meshes", primitives=[primitive]))
    sampler = {"input": numbers["keys"], "output": numbers["moves"]}
    channel = {"sampler": 0, "target": {"node": node, "path": "translation"}}
    file.json["animations"] = [{"samplers": [sampler], "channels": [channel]}]
    return file


def saved(path, file):
    path.write_bytes(glb(file.json, file.data))
    return path


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_load_reads_compressed_geometry_and_animation(tmp_path, extension):
    loaded = load(saved(tmp_path / "a.glb", packed_square(extension)))
    np.testing.assert_array_equal(loaded.vertices, [shifted(SQUARE, [x, 0, 0]) for x in range(3)])
    np.testing.assert_array_equal(loaded.faces.ravel(), SQUARE_FACES)
    assert loaded.fps == 2


def test_buffer_view_with_damaged_data_is_named(tmp_path):
    file = packed_square(EXTENSIONS[0])
    file.data[0] ^= 0xFF
    with pytest.raises(FormatError, match=r"buffer view 0, ext.*: meshopt cannot decode it \(does"):
        load(saved(tmp_path / "a.glb", file))


def test_buffer_view_with_another_length_than_its_data_is_rejected(tmp_path):
    file = packed_square(EXTENSIONS[0])
    file.json["bufferViews"][0]["byteLength"] = 36
    with pytest.raises(FormatError, match=r"its 'count' times its 'byteStride' must be the 36 byt"):
        load(saved(tmp_path / "a.glb", file))


def test_compressed_data_that_would_fill_the_memory_are_rejected(tmp_path, monkeypatch):
    monkeypatch.setattr("meshreel.formats.gltf.document.MIN_EXPANDED_BYTES", 100)
    monkeypatch.setattr("meshreel.formats.gltf.document.MAX_EXPANSION", 0)
    path = saved(tmp_path / "a.glb", packed_square(EXTENSIONS[0]))
    with pytest.raises(FormatError, match="would need more than 0 times its size"):
        load(path)
