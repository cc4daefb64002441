import numpy as np
import pytest

from meshreel.connectivity.order import (
    FACES_FIRST,
    VERTICES_FIRST,
    VERTICES_ONLY,
    decode_given_order,
    encode_order,
    naming_order,
)
from meshreel.connectivity.vertex_order import inverse_permutation
from meshreel.errors import CorruptStreamError


def in_other_order(faces, n_verts, seed=4):
    """The same mesh with other names and another order: internal faces, and back."""
    rng = np.random.default_rng(seed)
    internal_to_given = rng.permutation(n_verts)
    internal = inverse_permutation(internal_to_given)[faces][rng.permutation(len(faces))]
    turned = (rng.integers(0, 3, len(faces))[:, None] + np.arange(3)) % 3
    return np.take_along_axis(internal, turned, axis=1), internal_to_given


@pytest.mark.parametrize("keep_faces", [True, False])
def test_order_comes_back_exactly_when_internal_order_is_another(mesh, keep_faces):
    faces, n_verts = mesh
    internal, internal_to_given = in_other_order(faces, n_verts)
    payload = encode_order(faces, internal, internal_to_given, keep_faces)
    found, given = decode_given_order(payload, internal, n_verts)
    np.testing.assert_array_equal(found, internal_to_given)
    np.testing.assert_array_equal(given, faces if keep_faces else internal_to_given[internal])


def test_faces_come_first_when_vertices_are_numbered_as_faces_name_them(meshes):
    faces, n_verts = meshes["shuffled torus"]
    faces = inverse_permutation(naming_order(faces, n_verts))[faces]
    payload = encode_order(faces, *in_other_order(faces, n_verts), keep_faces=True)
    assert payload[0] == FACES_FIRST


def test_vertices_come_first_when_faces_are_sorted_by_them(meshes):
    faces, n_verts = meshes["shuffled torus"]
    faces = faces[np.lexsort(np.sort(faces, axis=1).T[::-1])]
    payload = encode_order(faces, *in_other_order(faces, n_verts), keep_faces=True)
    assert payload[0] == VERTICES_FIRST


def test_naming_order_ends_with_the_others_when_vertices_are_unused():
    assert naming_order(np.array([[4, 2, 4], [5, 2, 1]]), 7).tolist() == [4, 2, 5, 1, 0, 3, 6]


@pytest.mark.parametrize(
    "change",
    [
        lambda payload: b"",
        lambda payload: payload[:1],
        lambda payload: b"\x03" + payload[1:],
        lambda payload: payload[:1] + b"\x03" + payload[2:],
        lambda payload: payload[:2] + b"\xff\xff\x7f" + payload[3:],
        lambda payload: bytes([VERTICES_ONLY]) + payload[1:],
    ],
)
def test_decode_given_order_tells_when_the_start_is_damaged(meshes, change):
    faces, n_verts = meshes["octahedron"]
    internal, internal_to_given = in_other_order(faces, n_verts)
    payload = encode_order(faces, internal, internal_to_given, keep_faces=True)
    with pytest.raises(CorruptStreamError):
        decode_given_order(change(payload), internal, n_verts)
