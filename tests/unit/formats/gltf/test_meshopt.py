"""Buffer views that are compressed with meshoptimizer, decoded and encoded."""

import base64
import contextlib
import zlib
from itertools import pairwise

import numpy as np
import pytest

from meshreel.codec.dropped_order import match_order
from meshreel.errors import FormatError
from meshreel.formats.gltf.container import BufferWriter
from meshreel.formats.gltf.mesh_writer import split_at_seams
from meshreel.formats.gltf.meshopt import decode_attributes, decode_triangles, decode_view
from meshreel.formats.gltf.meshopt_encoding import (
    encode_attributes,
    encode_exponential,
    encode_triangles,
    encode_view,
)
from meshreel.formats.load import load
from meshreel.formats.scenes.parts import split_parts
from meshreel.kernel.order import depth_first_order
from meshreel.model.notes import Notes
from meshreel.model.surface import Attribute, Domain, Kind, Surface
from meshreel.operations.save import save
from samples.costs import draws
from samples.glb import written
from samples.gltf import SQUARE, SQUARE_FACES, Gltf, glb, shifted
from samples.meshes import irregular_sequence, waving_grid
from samples.meshopt import SQUARE as PACKED_SQUARE
from samples.meshopt import STREAMS
from samples.surfaces import rich_cube

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
        (("MESHLETS", "NONE", 4, 4), "'mode' must be ATTRIBUTES or TRIANGLES"),
        (("INDICES", "NONE", 4, 4), "'mode' INDICES, of strips and fans, is not supported"),
        (("TRIANGLES", "NONE", 4, 2), "a count divisible by 3; got NONE, 2 and 4"),
        (("TRIANGLES", "COLOR", 6, 4), "TRIANGLES must have no filter"),
        (("TRIANGLES", "NONE", 6, 1), "a byteStride of 2 or 4"),
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
    monkeypatch.setattr("meshreel.formats.gltf.document.MIN_DECOMPRESSED_BYTES", 100)
    monkeypatch.setattr("meshreel.formats.gltf.document.MAX_EXPANSION", 0)
    path = saved(tmp_path / "a.glb", packed_square(EXTENSIONS[0]))
    with pytest.raises(FormatError, match="would need more than 0 times its size"):
        load(path)


RNG = np.random.default_rng(7)


def rows(count, stride, largest_step):
    """Return elements that change by small steps, where they change."""
    steps = RNG.integers(-largest_step, largest_step + 1, (count, stride))
    return np.cumsum(steps * (RNG.random(steps.shape) < 0.3), axis=0).astype(np.uint8)


def rotated(triangles):
    """Return sorted triangles, each from the corner that comes first."""
    return sorted(min((a, b, c), (b, c, a), (c, a, b)) for a, b, c in triangles.tolist())


@pytest.mark.parametrize("count", [1, 2, 15, 16, 17, 255, 256, 257, 1000])
@pytest.mark.parametrize("stride", [4, 8, 12, 48, 220, 256])
def test_attributes_decode_to_themselves(count, stride):
    for largest_step in (0, 1, 3, 9, 127):
        elements = rows(count, stride, largest_step)
        data = encode_attributes(elements)
        np.testing.assert_array_equal(decode_attributes(data, count, stride), elements)


@pytest.mark.parametrize(
    ("mode", "count", "stride", "text"),
    [
        (mode, count, stride, text)
        for mode, kind, count, stride, text, _ in STREAMS
        if kind == "NONE" and base64.b64decode(text)[0] != 0xA1
    ],
)
def test_streams_are_as_short_as_those_of_the_library(mode, count, stride, text):
    stored = base64.b64decode(text)
    decoded = decode_view(stored, count, stride, mode, "NONE")
    dtype = f"<u{stride}" if mode == "TRIANGLES" else "u1"
    data, _ = encode_view(decoded.view(dtype).reshape(count, -1), mode)
    assert len(data) <= len(stored) + (8 if mode == "TRIANGLES" else 0)


def test_attributes_of_several_pieces_decode_to_themselves(monkeypatch):
    elements = rows(3000, 8, 4)
    whole = encode_attributes(elements)
    monkeypatch.setattr("meshreel.formats.gltf.meshopt_encoding.PIECE_BLOCKS", 2)
    assert encode_attributes(elements) == whole
    np.testing.assert_array_equal(decode_attributes(whole, 3000, 8), elements)


def test_attributes_have_the_shortest_group_modes():
    deltas = np.zeros(64, np.uint8)
    deltas[16:32] = 1  # code 2, in 2 bits each
    deltas[32:48] = 3  # code 6, in 4 bits each
    deltas[48:64] = 90  # in bytes
    elements = np.zeros((64, 4), np.uint8)
    elements[:, 0] = np.cumsum(deltas)
    head, headers, groups, tail = 1, 4, 4 + 8 + 16, 32
    assert len(encode_attributes(elements)) == head + headers + groups + tail


@pytest.mark.parametrize("n_verts", [1, 3, 12, 60, 2**31])
def test_triangles_decode_to_themselves_in_order(n_verts):
    for count in (1, 5, draws(500)):
        triangles = RNG.integers(0, n_verts, (count, 3))
        decoded = decode_triangles(encode_triangles(triangles), triangles.size).reshape(-1, 3)
        turns = np.stack([np.roll(decoded, turn, axis=1) for turn in range(3)])
        assert (turns == triangles).all(axis=2).any(axis=0).all()


def test_triangles_along_edges_take_little_more_than_a_byte():
    mesh = waving_grid(1, 40, 50)
    [part] = split_parts(mesh.faces, mesh.surface, mesh.n_verts, "")
    [primitive] = split_at_seams(part).along_edges().primitives
    assert len(encode_triangles(primitive.triangles)) < 1.15 * len(primitive.triangles)


def test_depth_first_order_visits_every_triangle_across_shared_edges():
    faces = waving_grid(1, 9, 9).faces
    both = np.concatenate([faces, faces + 100]).astype(np.int64)
    order = depth_first_order(both)
    assert sorted(order) == list(range(len(both)))
    shared = [len({*both[one]} & {*both[other]}) for one, other in pairwise(order)]
    assert np.count_nonzero(np.array(shared) < 2) < 0.1 * len(both)


@pytest.mark.parametrize("exponent", [-90, -20, 0, 60])
def test_exponential_filter_is_exact_where_it_applies(exponent):
    values = np.ldexp(RNG.integers(-(2**22), 2**22, (50, 3)), exponent).astype(np.float32)
    values[3] = 0
    data = encode_attributes(encode_exponential(values))
    decoded = decode_view(data, 50, 12, "ATTRIBUTES", "EXPONENTIAL")
    np.testing.assert_array_equal(decoded.view("<f4").reshape(50, 3), values)


@pytest.mark.parametrize("values", [[1, 1e-9], [2.0**127], [np.pi, 100.1]])
def test_exponential_filter_does_not_apply_where_it_would_round(values):
    assert encode_exponential(np.float32([values])) is None


@pytest.mark.parametrize("values", [np.float32([[0.5], [-3], [0]]), RNG.random((99, 4), "f4")])
def test_floats_decode_to_themselves_through_the_shorter_filter(values):
    data, kind = encode_view(values, "ATTRIBUTES")
    decoded = decode_view(data, len(values), values[0].nbytes, "ATTRIBUTES", kind)
    np.testing.assert_array_equal(decoded.view("<f4").reshape(values.shape), values)


def test_buffer_is_plain_where_compression_saves_nothing():
    buffer = BufferWriter(is_compressed=True)
    buffer.add_indices(np.array([0, 1, 2]))
    assert buffer.required_extensions == []
    assert [buffer.size_bytes, *map(len, (buffer.views, buffer.buffers()))] == [8, 1, 1]


def test_compressed_views_refer_to_a_buffer_without_data():
    buffer = BufferWriter(is_compressed=True)
    buffer.add_vertices([np.zeros((1000, 3), np.int16)])
    buffer.add_indices(np.arange(999) % 7)
    stored, decompressed = buffer.buffers()
    assert stored == {"byteLength": buffer.size_bytes}
    assert decompressed["byteLength"] == 8 * 1000 + 2 * 1000
    assert [view["buffer"] for view in buffer.views] == [1, 1]


def sources_of(sequence):
    """Return the original vertices in the order of the compressed file."""
    [part] = split_parts(sequence.faces, sequence.surface, sequence.n_verts, "")
    return split_at_seams(part).along_edges().sources


@pytest.mark.parametrize("options", [{}, {"normals": False}, {"max_error": 0.02}])
@pytest.mark.parametrize("make", [lambda: waving_grid(20, 15, 17), irregular_sequence])
def test_compressed_file_has_the_positions_and_triangles_of_the_sequence(tmp_path, make, options):
    sequence, notes = make(), Notes()
    result = written(tmp_path, sequence, notes, meshopt=True, **options)
    assert "EXT_meshopt_compression" in result.document["extensionsRequired"]
    [name] = [node["name"] for node in result.document["nodes"]]
    sources, (low, high) = sources_of(sequence), (sequence.extent.low, sequence.extent.high)
    distances = np.linalg.norm(result.world(name) - sequence.vertices[:, sources], axis=2)
    error = 100 * distances.max() / np.linalg.norm(high - low)
    [stated] = [float(note.split()[4]) for note in notes if note.startswith("the largest")]
    assert error == pytest.approx(stated, abs=1e-4)
    assert rotated(sources[result.triangles(name)]) == rotated(sequence.faces)


def test_compressed_surface_is_read_back_like_the_plain_one(tmp_path):
    cube = rich_cube()
    for name, meshopt in (("plain", False), ("compressed", True)):
        save(cube, tmp_path / f"{name}.glb", meshopt=meshopt)
    plain, compressed = (load(tmp_path / f"{name}.glb") for name in ("plain", "compressed"))
    assert len(plain.faces) == len(compressed.faces)
    assert [one.name for one in plain.surface.attributes] == [
        one.name for one in compressed.surface.attributes
    ]
    for one, other in zip(plain.surface.attributes, compressed.surface.attributes, strict=True):
        values, others = (np.sort(each.per_item(), axis=0) for each in (one, other))
        np.testing.assert_array_equal(values, others)


def test_vertices_of_a_compressed_file_are_matched_across_seams(tmp_path):
    grid = waving_grid(12, 15, 17)
    uv = Attribute("uv", Kind.UV, Domain.CORNER, RNG.random((grid.faces.size, 2), "f4"))
    sequence = grid.replace(surface=Surface(None, (uv,)))
    save(sequence, tmp_path / "a.glb", meshopt=True)
    _, matched, is_matched = match_order(sequence, load(tmp_path / "a.glb"))
    assert is_matched
    np.testing.assert_allclose(matched.vertices, grid.vertices, atol=4e-3)


def test_compressed_weights_are_those_of_the_plain_accessor(tmp_path):
    times, weights = written(tmp_path, waving_grid(90, 15, 17), meshopt=True).weights("grid")
    np.testing.assert_allclose(times, np.arange(90) / 25, atol=1e-6)
    steps = np.ldexp(weights.astype(np.float64), 24)
    np.testing.assert_array_equal(steps, np.rint(steps))
