import numpy as np
import pytest

from meshreel.connectivity.general import (
    decode_face_list,
    encode_face_list,
    face_differences,
    join_differences,
)
from meshreel.errors import CorruptStreamError


def test_face_list_comes_back_exactly_when_mesh_is_anything(mesh):
    faces, n_verts = mesh
    decoded = decode_face_list(encode_face_list(faces, n_verts), n_verts, len(faces))
    assert decoded.dtype == np.int32
    np.testing.assert_array_equal(decoded, faces)


def test_face_list_is_tiny_when_triangles_are_scattered(meshes):
    assert len(encode_face_list(*meshes["scattered"])) < 40


def test_face_differences_are_these_when_written_out():
    rows = face_differences(np.array([[5, 6, 4], [7, 9, 7]]))
    assert [row.tolist() for row in rows] == [[5, 2], [1, 2], [-1, 0]]


@pytest.mark.parametrize("corner", [-1, 4])
def test_join_differences_tells_when_a_corner_is_out_of_range(corner):
    with pytest.raises(CorruptStreamError, match=r"0\.\.3"):
        join_differences(face_differences(np.array([[0, 1, 2], [0, corner, 2]])), 4)


@pytest.mark.parametrize("counts", [(299, 100), (301, 100), (300, 99), (300, 101)])
def test_decode_face_list_tells_when_counts_differ(meshes, counts):
    with pytest.raises(CorruptStreamError, match="100 faces on 300 vertices"):
        decode_face_list(encode_face_list(*meshes["scattered"]), *counts)
