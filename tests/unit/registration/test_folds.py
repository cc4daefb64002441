"""Faces that fold over are found, flattened, opened and restored."""

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
    flattened = folds.flatten(folded, plane)
    assert len(folds.find(flattened, plane)) == 0
    is_far = np.abs(plane.vertices[:, :2] - 0.5).max(axis=1) > 0.45
    assert np.array_equal(flattened.vertices[is_far], plane.vertices[is_far])


def test_opening_unfolds_along_a_crease_that_flattening_leaves(plane):
    """The crease is as sharp as that of a roof, and the fold crosses it."""
    creased = TriangleMesh(plane.vertices.copy(), plane.faces)
    creased.vertices[:, 2] = np.abs(plane.vertices[:, 0] - 0.5)
    is_patch = np.abs(plane.vertices[:, :2] - 0.5).max(axis=1) < 0.13
    folded = with_moved_vertices(creased, is_patch, [0.0, 0.1, 0.0])
    folds = Folds(creased)
    assert len(folds.find(folded, creased)) == 10
    distances = []
    for repair in (folds.flatten, folds.open):
        mesh = repair(folded, creased)
        assert len(folds.find(mesh, creased)) == 0
        distances.append(creased.closest(mesh.vertices).distances.max())
    flattened, opened = distances
    assert opened < 0.2 * flattened


def test_restoring_keeps_a_part_of_the_key_that_the_surface_lacks():
    """The part is a mushroom, whose overhang folds when it is pressed onto the plane."""
    plane = TriangleMesh(*square(0.0, 41))
    offsets = plane.vertices - [0.5, 0.5, 0.0]
    radii = np.linalg.norm(offsets, axis=1)
    rings = [0.0, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.36, 1.0]
    outlines = [0.0, 0.1, 0.15, 0.15, 0.11, 0.12, 0.2, 0.36, 1.0], [0.2, 0.2, 0.15, 0.1, 0.06, 0.01]
    reach = np.interp(radii, rings, outlines[0]) / np.maximum(radii, 1e-9)
    heights = np.interp(radii, rings, outlines[1] + [0.0] * 3)
    key = TriangleMesh(offsets * reach[:, None] + heights[:, None] * [0.0, 0.0, 1.0], plane.faces)
    folds, is_overhang = Folds(key), (radii > 0.15) & (radii < 0.3)
    pressed = with_moved_vertices(key, is_overhang, -heights[is_overhang, None] * [0.0, 0.0, 1.0])
    surface = TriangleMesh(offsets, plane.faces)
    folded = np.unique(key.faces[folds.find(pressed, surface)])
    assert len(folded) > 20
    restored = folds.restore(pressed, surface, key.vertices)
    assert len(folds.find(restored, surface)) == 0
    was, now = (np.abs(one.vertices - key.vertices)[folded].max() for one in (pressed, restored))
    assert now < 0.1 * was
    assert np.array_equal(restored.vertices[radii > 0.45], key.vertices[radii > 0.45])


def test_a_component_may_unfold_as_a_whole(plane):
    """Every vertex of the triangle moves, so that no neighbor holds it."""
    corners = np.array([[0.2, 0.2, 0.01], [0.3, 0.2, 0.01], [0.2, 0.3, 0.01], [0.3, 0.3, 0.01]])
    key = TriangleMesh(corners, np.array([[0, 1, 2], [1, 3, 2]], np.int32))
    folded = TriangleMesh(corners.copy(), key.faces)
    folded.vertices[3] = [0.2, 0.2, 0.02]
    folds = Folds(key)
    assert len(folds.find(folded, plane)) == 1
    assert np.isfinite(folds.flatten(folded, plane).vertices).all()
    assert len(folds.find(folds.open(folded, plane), plane)) == 0


def test_a_mesh_without_folds_stays(plane):
    folds = Folds(plane)
    assert folds.flatten(plane, plane) is folds.open(plane, plane) is plane
    assert folds.restore(plane, plane, np.zeros_like(plane.vertices)) is plane


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


@pytest.mark.parametrize(("degrees", "n_folded"), [(85, 0), (109, 0), (111, 20)])
def test_a_crease_folds_if_it_bends_more_than_in_the_key_by_30_degrees(plane, degrees, n_folded):
    """Half of the plane is a wall, at 80 degrees in the key."""

    def with_wall(angle):
        beyond = np.maximum(plane.vertices[:, :1] - 0.5, 0.0)
        turn = np.radians(angle)
        shift = beyond * [np.cos(turn) - 1.0, 0.0, np.sin(turn)]
        return TriangleMesh(plane.vertices + shift, plane.faces)

    folds, mesh = Folds(with_wall(80)), with_wall(degrees)
    assert len(folds.find(mesh, plane)) == n_folded
    assert len(folds.find(mesh, plane, min_turn=0.0)) == 20 * (degrees > 90)
