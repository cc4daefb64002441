"""Connectivity coder: lossless for any face list, typed errors for damaged bytes."""

import dataclasses
from contextlib import suppress

import numpy as np
import pytest

from meshreel.codec.connectivity.coder import encode_connectivity
from meshreel.errors import CorruptStreamError, InvalidInputError, MeshReelError
from meshreel.kernel.connectivity import encode_faces
from meshreel.kernel.order import opposite_sides
from meshreel.model.geometry.triangles import lowest_rotation, rotate_corners, sorted_order
from samples.coded_meshes import decode_connectivity, decode_order, sorted_triangles


def coded_and_decoded(mesh, order):
    faces, n_verts = mesh
    coded = encode_connectivity(faces, n_verts, order=order)
    internal = decode_connectivity(coded.payload, n_verts, len(faces))
    return coded, internal, *decode_order(coded.order_payload, internal, n_verts)


@pytest.mark.slow
@pytest.mark.every_case
@pytest.mark.parametrize("order", ["keep", "vertices", "drop"])
def test_triangles_are_lossless_in_the_promised_order(mesh, order):
    coded, internal, internal_to_given, faces = coded_and_decoded(mesh, order)
    names, identity = coded.internal_to_given, np.arange(mesh[1])
    assert coded.internal_faces.dtype == internal.dtype == faces.dtype == np.int32
    assert names.dtype == internal_to_given.dtype == np.int64
    np.testing.assert_array_equal(internal, coded.internal_faces)
    np.testing.assert_array_equal(np.sort(names), identity)
    np.testing.assert_array_equal(internal_to_given, identity if order == "drop" else names)
    original = names[faces] if order == "drop" else faces
    np.testing.assert_array_equal(sorted_triangles(original, mesh[1]), sorted_triangles(*mesh))
    if order != "vertices":
        np.testing.assert_array_equal(faces, mesh[0] if order == "keep" else internal)
    assert coded.order_payload == b"" or order != "drop"


@pytest.mark.parametrize(
    ("name", "order", "bits_per_vertex"),
    [
        ("torus", "drop", 0.7),
        ("shuffled torus", "drop", 0.7),
        ("torus", "keep", 0.9),
        ("grid", "keep", 2.0),
        ("shuffled torus", "vertices", 11.2),  # the order takes 10.2 bits
        ("shuffled torus", "keep", 38.5),  # orders and corners take 35.7 bits
    ],
)
def test_regular_mesh_takes_about_the_entropy_of_its_order(meshes, name, order, bits_per_vertex):
    coded = encode_connectivity(*meshes[name], order=order)
    size_bits = 8 * (len(coded.payload) + len(coded.order_payload))
    assert size_bits < bits_per_vertex * meshes[name][1]


def test_unknown_order_is_refused(meshes):
    with pytest.raises(InvalidInputError, match="keep, vertices, drop"):
        encode_connectivity(*meshes["grid"], order="faces")


def test_decoding_refuses_other_counts_than_the_header(meshes):
    faces, n_verts = meshes["damaged torus"]
    payload = encode_connectivity(faces, n_verts, order="drop").payload
    for wrong in [(0, 1), (0, -1), (1, 0), (-1, 0)]:
        with pytest.raises(CorruptStreamError):
            decode_connectivity(payload, n_verts + wrong[0], len(faces) + wrong[1])


@pytest.mark.parametrize("payload", [b"", b"\x00", b"\xff" * 40, b"\x55" * 40])
def test_decoding_refuses_bytes_that_are_not_faces(payload):
    with pytest.raises(CorruptStreamError):
        decode_connectivity(payload, 3, 100)


def test_truncated_bytes_decode_to_other_faces_or_our_error(mesh):
    faces, n_verts = mesh
    coded = encode_connectivity(faces, n_verts)
    for size in range(0, len(coded.payload), 1 + len(coded.payload) // 80):
        try:
            result = decode_connectivity(coded.payload[:size], n_verts, len(faces))
        except CorruptStreamError:
            continue
        assert not np.array_equal(result, coded.internal_faces)
        assert 0 <= result.min() <= result.max() < n_verts
    for size in range(1, len(coded.order_payload), 1 + len(coded.order_payload) // 80):
        with suppress(CorruptStreamError):
            decode_order(coded.order_payload[:size], coded.internal_faces, n_verts)


def test_decoding_refuses_extra_bytes(mesh):
    faces, n_verts = mesh
    coded = encode_connectivity(faces, n_verts)
    with pytest.raises(CorruptStreamError):
        decode_connectivity(coded.payload + b"\xff" * 20, n_verts, len(faces))
    if coded.order_payload:
        with pytest.raises(CorruptStreamError):
            decode_order(coded.order_payload + b"\x00", coded.internal_faces, n_verts)


def test_changed_bytes_decode_to_a_valid_mesh_or_our_error(mesh):
    faces, n_verts = mesh
    rng = np.random.default_rng(8)
    coded = encode_connectivity(faces, n_verts)
    for _ in range(60):
        payload, order_payload = (bytearray(part) for part in dataclasses.astuple(coded)[:2])
        for part in (payload, order_payload):
            if part:
                part[rng.integers(len(part))] ^= rng.integers(1, 256)
        try:
            internal = decode_connectivity(bytes(payload), n_verts, len(faces))
        except MeshReelError:
            internal = coded.internal_faces
        assert internal.shape == faces.shape
        assert 0 <= internal.min() <= internal.max() < n_verts
        try:
            result, given = decode_order(bytes(order_payload), internal, n_verts)
        except MeshReelError:
            continue
        np.testing.assert_array_equal(np.sort(result), np.arange(n_verts))
        np.testing.assert_array_equal(
            sorted_triangles(given, n_verts), sorted_triangles(result[internal], n_verts)
        )


def test_faces_are_listed_when_that_takes_fewer_bytes_than_a_traversal():
    rng = np.random.default_rng(8)
    faces = (rng.integers(0, 400, (500, 1)) + rng.integers(0, 6, (500, 3))).astype(np.int32)
    sizes = [len(encode_faces(faces, 406, listed=listed)[0]) for listed in (False, True)]
    coded = encode_connectivity(faces, 406, order="vertices")
    assert len(coded.payload) == sizes[1] < sizes[0]


@pytest.mark.parametrize("face", [[3, 1, 2], [5, 9, 7], [1, 1, 0], [0, 0, 1], [4, 4, 4]])
def test_lowest_rotation_does_not_depend_on_the_first_corner(face):
    turned = np.array([np.roll(face, by) for by in range(3)])
    lowest, _ = lowest_rotation(turned, 10)
    assert lowest.tolist() == [min(turned.tolist())] * 3


def test_lowest_rotation_distinguishes_mirrored_faces():
    lowest, _ = lowest_rotation(np.array([[2, 0, 1], [1, 0, 2]]), 3)
    assert lowest.tolist() == [[0, 1, 2], [0, 2, 1]]


def test_rotate_corners_inverts_lowest_rotation(mesh):
    faces, n_verts = mesh
    lowest, front = lowest_rotation(faces, n_verts)
    np.testing.assert_array_equal(rotate_corners(lowest, (-front) % 3), faces)


def test_sorted_order_is_lexicographic_and_stable():
    faces = np.array([[1, 2, 3], [0, 5, 2], [1, 2, 3], [0, 5, 1], [0, 2, 9]])
    assert sorted_order(faces, 10).tolist() == [4, 3, 1, 0, 2]


def test_twin_sides_pair_the_sides_of_a_shared_edge_in_either_direction():
    # Side 1 of the first face runs 1 -> 2, side 0 of the second 2 -> 1.
    assert opposite_sides(np.array([[0, 1, 2], [2, 1, 3]]), 4).tolist() == [0, 3, 2, 1, 4, 5]
    assert opposite_sides(np.array([[0, 1, 2], [1, 2, 3]]), 4)[1] == 3


def test_twin_sides_of_any_mesh_share_an_edge_and_refer_to_each_other(mesh):
    faces, n_verts = mesh
    twins = opposite_sides(faces, n_verts)
    ends = np.sort(np.stack([faces.ravel(), np.roll(faces, -1, axis=1).ravel()], 1), axis=1)
    np.testing.assert_array_equal(twins[twins], np.arange(len(twins)))
    np.testing.assert_array_equal(ends[twins], ends)


def test_every_side_of_a_closed_surface_has_a_twin(meshes):
    twins = opposite_sides(*meshes["torus"])
    assert (twins != np.arange(len(twins))).all()
