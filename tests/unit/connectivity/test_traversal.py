import numpy as np
import pytest

from meshreel.connectivity.traversal import decode_traversal, encode_traversal
from meshreel.entropy.varint import write_varint
from meshreel.errors import CorruptStreamError


def test_traversal_comes_back_exactly_when_mesh_is_anything(mesh):
    faces, n_verts = mesh
    traversal = encode_traversal(faces, n_verts)
    if traversal is None:
        assert (faces == np.roll(faces, 1, axis=1)).any(axis=1).all()
        return
    np.testing.assert_array_equal(
        decode_traversal(traversal.body, traversal.coding, n_verts, len(faces)),
        traversal.internal_faces,
    )


def test_unused_vertices_are_numbered_last_when_there_are_some():
    traversal = encode_traversal(np.array([[1, 4, 6], [6, 4, 8]], np.int32), 10)
    assert traversal.internal_to_given[4:].tolist() == [0, 2, 3, 5, 7, 9]
    assert traversal.internal_faces.max() == 3


def test_degenerate_and_repeated_faces_come_last_when_there_are_some():
    faces = np.array([[0, 0, 1], [0, 1, 2], [1, 2, 0], [2, 1, 3]], np.int32)
    traversal = encode_traversal(faces, 4)
    given = traversal.internal_to_given[traversal.internal_faces]
    assert given[2:].tolist() == [[0, 0, 1], [1, 2, 0]]


def test_split_vertices_are_one_again_when_surfaces_touch_in_them(meshes):
    faces, n_verts = meshes["pinched"]
    used = len(np.unique(faces))
    assert encode_traversal(faces, n_verts).internal_faces.max() == used - 1


def test_decode_traversal_tells_when_announced_numbers_cannot_be(meshes):
    faces, n_verts = meshes["bowtie"]
    traversal = encode_traversal(faces, n_verts)
    for at in range(4):
        for value in (5, 77, 2**40):
            body = traversal.body[:at] + write_varint(value) + traversal.body[at + 1 :]
            with pytest.raises(CorruptStreamError):
                decode_traversal(body, traversal.coding, n_verts, len(faces))
