import numpy as np
import pytest

from meshreel.connectivity.face_order import (
    MAX_RUN,
    decode_face_order,
    encode_face_order,
    list_faces,
)
from meshreel.entropy.coder import encode_integers
from meshreel.entropy.varint import write_varint
from meshreel.errors import CorruptStreamError


def random_corners(n_faces, seed=6):
    rng = np.random.default_rng(seed)
    return 3 * rng.permutation(n_faces) + rng.integers(0, 3, n_faces)


def first_corners(n_faces):
    return 3 * np.arange(n_faces)


def described(lengths, firsts, turns, odd, even, kind=1):
    runs = encode_integers([np.array(lengths, int)])
    rows = [np.array(row, int) for row in (firsts, turns, odd, even)]
    return b"".join(
        [
            write_varint(len(lengths)),
            write_varint(len(runs)),
            runs,
            bytes([kind]),
            encode_integers(rows),
        ]
    )


def test_face_order_comes_back_exactly_when_it_is_anything(mesh):
    faces, n_verts = mesh
    n_faces = len(faces)
    for corners in (
        first_corners(n_faces),
        first_corners(n_faces)[::-1] + 2,
        random_corners(n_faces),
    ):
        data = encode_face_order(corners, faces, n_verts)
        np.testing.assert_array_equal(decode_face_order(data, faces, n_verts), corners)


def test_listed_order_costs_almost_nothing_when_faces_are_neighbours(meshes):
    faces, n_verts = meshes["torus"]
    assert 8 * len(encode_face_order(first_corners(len(faces)), faces, n_verts)) < 0.7 * len(faces)


def test_halves_of_quads_cost_half_when_quads_are_scattered(meshes):
    faces, n_verts = meshes["torus"]
    rng = np.random.default_rng(9)
    pairs = 6 * rng.permutation(len(faces) // 2)
    corners = np.stack([pairs, pairs + 3], axis=1).ravel()
    size_bits = 8 * len(encode_face_order(corners, faces, n_verts))
    assert size_bits < 0.6 * np.log2(len(faces)) * len(faces)


def test_random_order_costs_little_more_than_it_holds_when_nothing_predicts(meshes):
    faces, n_verts = meshes["torus"]
    size_bits = 8 * len(encode_face_order(random_corners(len(faces)), faces, n_verts))
    assert size_bits < 1.05 * np.log2(3 * len(faces)) * len(faces)


def test_list_faces_takes_faces_from_their_corners_when_turned():
    known = np.array([[0, 1, 2], [2, 1, 3]])
    assert list_faces(known, np.array([4, 2])).tolist() == [[1, 3, 2], [2, 0, 1]]


def test_runs_are_cut_when_they_are_longer_than_a_run_may_be(meshes):
    faces, n_verts = meshes["torus"]
    data = encode_face_order(first_corners(len(faces)), faces, n_verts)
    assert data[0] >= len(faces) // MAX_RUN


@pytest.mark.parametrize(
    "data",
    [
        b"",
        described([1], [0], [0], [], []),  # one face is missing
        described([1, 1, 1], [0, 1, 0], [0, 0, 0], [], []),
        described([2, 0], [0, 1], [0, 0], [0], []),
        described([3, -1], [0, 1], [0, 0], [0], [0]),
        described([1, 1], [0, 0], [0, 0], [], []),  # twice the same
        described([1, 1], [0, 2], [0, 0], [], []),
        described([1, 1], [0, -1], [0, 0], [], []),
        described([1, 1], [0, 1], [0, 3], [], []),
        described([1, 1], [0, 1], [0, -1], [], []),
        described([2], [0], [0], [14], []),
        described([2], [0], [0], [-14], []),
        described([2], [0], [0], [-13], []),  # over the boundary
        described([1, 1], [0, 1], [0, 0], [], [], kind=2),
    ],
)
def test_decode_face_order_tells_when_it_is_no_order(data):
    with pytest.raises(CorruptStreamError):
        decode_face_order(data, np.array([[0, 1, 2], [2, 1, 3]]), 4)


def test_decode_face_order_takes_the_hand_written_order_when_it_is_right():
    # Over side 1 of the first face to side 0 of the second, from there turned by 2.
    data = described([2], [0], [0], [3 * 1 + 2 - 13], [])
    assert decode_face_order(data, np.array([[0, 1, 2], [2, 1, 3]]), 4).tolist() == [0, 5]
