"""Faces that fold over are found and flattened."""

import numpy as np
import pytest

from meshreel.registration.folds import Folds
from meshreel.registration.triangle_mesh import TriangleMesh
from samples.shapes import square


@pytest.fixture
def plane():
    return TriangleMesh(*square(0.0, 21))


def with_moved_vertices(mesh, is_moved, shift):
    vertices = mesh.vertices.copy()
    vertices[is_moved] += shift
    return TriangleMesh(vertices, mesh.faces)


def test_a_patch_drawn_across_its_neighbors_is_folded_and_flattened(plane):
    is_patch = np.abs(plane.vertices[:, :2] - 0.5).max(axis=1) < 0.13
    folded = with_moved_vertices(plane, is_patch, [0.2, 0.0, 0.0])
    folds = Folds(plane)
    assert len(folds.find(folded, plane)) == 10
    flattened = folds.flattened(folded, plane)
    assert len(folds.find(flattened, plane)) == 0
    is_far = np.abs(plane.vertices[:, :2] - 0.5).max(axis=1) > 0.45
    assert np.array_equal(flattened.vertices[is_far], plane.vertices[is_far])


def test_a_mesh_without_folds_stays(plane):
    assert Folds(plane).flattened(plane, plane) is plane


def test_neighbors_that_oppose_in_the_key_are_not_folded(plane):
    folded = with_moved_vertices(plane, np.arange(len(plane.vertices)) == 220, [0.2, 0.0, 0.0])
    assert len(Folds(plane).find(folded, plane)) > 0
    assert len(Folds(folded).find(folded, plane)) == 0


def test_a_crease_that_the_surface_has_is_not_a_fold(plane):
    is_right = plane.vertices[:, 0] > 0.5
    vertices = plane.vertices.copy()
    vertices[is_right, 0] = 1.0 - vertices[is_right, 0]
    vertices[is_right, 2] = 0.1 * (0.5 - vertices[is_right, 0])
    creased = TriangleMesh(vertices, plane.faces)
    assert len(Folds(plane).find(creased, creased)) == 0
