import numpy as np
import pytest

from meshreel.connectivity.vertex_order import (
    ALONG_MESH,
    CONSECUTIVE,
    UNPREDICTED,
    decode_numbering,
    encode_numbering,
    inverse_permutation,
    mesh_parents,
    require_permutation,
)
from meshreel.entropy.coder import encode_integers
from meshreel.errors import CorruptStreamError


def numberings(n_verts):
    rng = np.random.default_rng(5)
    swapped = np.arange(n_verts)
    pick = rng.permutation(n_verts)[: n_verts // 2]
    swapped[pick] = swapped[np.roll(pick, 1)]
    return [np.arange(n_verts), np.arange(n_verts)[::-1], rng.permutation(n_verts), swapped]


def test_numbering_comes_back_exactly_when_it_is_anything(mesh):
    faces, n_verts = mesh
    for numbers in numberings(n_verts):
        prediction, data = encode_numbering(numbers, faces)
        np.testing.assert_array_equal(decode_numbering(data, prediction, faces, n_verts), numbers)


@pytest.mark.parametrize(
    ("which", "prediction"), [("scrambled", UNPREDICTED), ("blocks", CONSECUTIVE)]
)
def test_the_best_prediction_is_chosen_when_numbering_has_its_structure(meshes, which, prediction):
    faces, n_verts = meshes["shuffled torus"]
    rng = np.random.default_rng(1)
    numbers = {
        "scrambled": rng.permutation(n_verts),
        "blocks": np.concatenate(rng.permutation(np.arange(n_verts).reshape(40, -1))),
    }[which]
    assert encode_numbering(numbers, faces)[0] == prediction


def test_the_mesh_predicts_when_its_vertices_are_numbered_in_another_order(meshes):
    faces, n_verts = meshes["torus"]
    order = np.random.default_rng(2).permutation(n_verts)
    # The vertices come in random order, so that only neighbours predict the number.
    prediction, data = encode_numbering(order, inverse_permutation(order)[faces])
    assert prediction == ALONG_MESH
    assert 8 * len(data) < 8.5 * n_verts


def test_random_numbering_costs_no_more_than_plain_bits_when_nothing_predicts(meshes):
    faces, n_verts = meshes["torus"]
    _, data = encode_numbering(np.random.default_rng(3).permutation(n_verts), faces)
    assert 8 * len(data) < 1.02 * np.ceil(np.log2(n_verts)) * n_verts


def test_mesh_parents_are_the_highest_lower_neighbours_when_there_are_any():
    faces = np.array([[0, 1, 3], [3, 1, 2], [5, 5, 0]])
    assert mesh_parents(faces, 6).tolist() == [6, 0, 1, 2, 3, 0]


@pytest.mark.parametrize("order", [[0, 0], [1, 2], [-1, 0], [0, 2**40]])
def test_require_permutation_tells_when_it_is_none(order):
    with pytest.raises(CorruptStreamError, match="vertex order"):
        require_permutation(np.array(order), "vertex")


@pytest.mark.parametrize("prediction", [UNPREDICTED, ALONG_MESH, CONSECUTIVE])
def test_decode_numbering_tells_when_numbers_repeat(prediction):
    data = encode_integers([np.full(4, 2**31 - 1)])
    with pytest.raises(CorruptStreamError):
        decode_numbering(data, prediction, np.array([[0, 1, 2]]), 4)


def test_decode_numbering_tells_when_prediction_is_unknown():
    with pytest.raises(CorruptStreamError, match="prediction 3 is unknown"):
        decode_numbering(encode_integers([np.arange(3)]), 3, np.array([[0, 1, 2]]), 3)
