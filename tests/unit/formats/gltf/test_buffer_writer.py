import numpy as np
import pytest

from meshreel.formats.gltf.container import BufferWriter


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
    buffer.vertex_accessor(name, stored, slice(1, 3))
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
    compressed = BufferWriter("ext")
    [stored] = compressed.add_vertices([vectors])
    assert compressed.is_quantized
    assert stored.values.dtype == np.int8
