"""Raw meshes are welded, and lose degenerate faces and small components."""

import numpy as np

from meshreel import MeshFrame
from meshreel.registration.cleaning import clean
from samples.captures import capsule
from samples.shapes import cube, square


def frame(vertices, faces):
    return MeshFrame(np.asarray(vertices, np.float32), np.asarray(faces, np.int32))


def test_vertices_at_one_position_are_welded():
    vertices, faces = cube()
    cleaned = clean(frame(vertices[faces].reshape(-1, 3), np.arange(36).reshape(-1, 3)))
    assert len(cleaned.vertices) == 8
    assert np.array_equal(cleaned.vertices[cleaned.faces], vertices[faces])


def test_faces_without_area_are_removed_and_counted():
    vertices, faces = cube()
    cleaned = clean(frame(vertices, np.vstack([[[0, 0, 1]], faces, [[3, 3, 3]]])))
    assert cleaned.removed.n_degenerate == 2
    assert np.array_equal(cleaned.raw_faces, np.arange(1, 13))


def test_components_below_an_area_are_removed_and_counted():
    vertices, faces = capsule(12, 12)
    crumb = 5 + 1e-3 * np.eye(3)
    both = frame(np.vstack([crumb, vertices]), np.vstack([[[0, 1, 2]], faces + 3]))
    cleaned = clean(both)
    assert (cleaned.n_components, cleaned.removed.n_small_components) == (1, 1)
    assert len(cleaned.vertices) == len(vertices)
    assert clean(both, max_removed_area=1e-7).removed.n_small_components == 0


def test_signs_of_zero_are_one_position():
    cleaned = clean(frame([[0, 0, 0], [-0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 2, 3], [1, 3, 2]]))
    assert len(cleaned.vertices) == 3


def test_a_frame_without_area_is_empty():
    assert clean(frame(np.zeros((3, 3)), [[0, 1, 2]])).is_empty


def test_vertices_at_cracks_are_welded():
    """But for the outline of a mesh whose edges are shorter than the distance."""
    vertices, faces = square(n=11)
    rng = np.random.default_rng(0)
    corners = vertices[faces].reshape(-1, 3)
    offsets = rng.uniform(-1e-3, 1e-3, corners.shape) * (rng.random((len(corners), 1)) < 0.5)
    soup = frame(corners + offsets, np.arange(len(corners)).reshape(-1, 3))
    cleaned = clean(soup, max_crack=0.01)
    assert (len(cleaned.vertices), len(cleaned.faces), cleaned.n_components) == (121, 200, 1)
    assert cleaned.removed.n_welded > 100
    np.testing.assert_allclose(cleaned.vertices[cleaned.faces], vertices[faces], atol=2e-3)
    closer = clean(soup, max_crack=1e-5)
    assert closer.removed.n_welded == 0
    fine = clean(frame(vertices, faces), max_crack=0.11)
    assert (len(fine.vertices), fine.removed.n_welded) == (121, 0)
