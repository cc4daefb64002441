from dataclasses import replace

import numpy as np
import pytest

from meshreel.formats.surfaces.hard_edges import (
    HardEdges,
    NormalNotes,
    edges_between_groups,
    find_hard_edges,
)
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.geometry.hard_edges import corner_normals
from meshreel.model.geometry.normals import face_normals
from meshreel.model.geometry.polygons import join_triangles
from meshreel.model.notes import NORMALS
from samples.meshes import cake, cake_normals, hard_box, hard_sheet, quad_sheet, waving_grid


def polygons_of(sequence):
    sizes = sequence.surface.sizes(sequence.n_faces)
    return PolygonMesh(
        sequence.vertices[0], sizes.astype(np.int64), join_triangles(sizes, sequence.faces)
    )


def ascending(edges):
    return np.unique(np.sort(edges, axis=1), axis=0)


def computed(sequence):
    return corner_normals(sequence.vertices[0], sequence.faces, sequence.surface)


@pytest.mark.parametrize("make", [hard_box, hard_sheet])
def test_hard_edges_are_recovered_from_their_normals(make):
    sequence = make()
    hard_edges = find_hard_edges(polygons_of(sequence), computed(sequence))
    again = find_hard_edges(polygons_of(sequence), np.nan_to_num(computed(sequence)) * 7)
    np.testing.assert_array_equal(ascending(hard_edges.edges), ascending(again.edges))
    assert hard_edges.n_far == 0
    # A hard edge that ends inside a fan does not change normals, so it cannot be recovered.
    given = ascending(sequence.surface.hard_edges)
    assert {*map(tuple, ascending(hard_edges.edges))} <= {*map(tuple, given)}
    kept = corner_normals(
        sequence.vertices[0], sequence.faces, surface_with(sequence, hard_edges.edges)
    )
    np.testing.assert_allclose(kept, computed(sequence), atol=1e-12)


def surface_with(sequence, edges):
    return replace(sequence.surface, hard_edges=edges)


def test_smooth_normals_give_no_hard_edges():
    sheet = quad_sheet()
    hard_edges = find_hard_edges(polygons_of(sheet), computed(sheet))
    assert (hard_edges.edges, hard_edges.n_far) == (None, 0)


def test_rims_of_a_cylinder_are_hard():
    sequence = cake()
    for normals in (cake_normals(sequence), -cake_normals(sequence)):
        hard_edges = find_hard_edges(polygons_of(sequence), normals)
        np.testing.assert_array_equal(
            ascending(hard_edges.edges), ascending(sequence.surface.hard_edges)
        )
        assert (hard_edges.n_far, hard_edges.n_shared) == (0, 24 * 5)


def test_quantized_normals_give_the_same_hard_edges():
    sequence = cake()
    rounded = np.rint(cake_normals(sequence) * 127) / 127
    hard_edges = find_hard_edges(polygons_of(sequence), rounded)
    np.testing.assert_array_equal(
        ascending(hard_edges.edges), ascending(sequence.surface.hard_edges)
    )


def test_nearest_candidate_set_of_hard_edges_is_chosen():
    # A crease that ends at an inner vertex, around which all faces share a normal.
    sheet = hard_sheet()
    dart = sheet.surface.hard_edges[[5]]
    next_one = {*dart[0].tolist()}
    touching = [e for e in sheet.surface.hard_edges if len(next_one & {*e.tolist()}) == 1]
    edges = np.array([dart[0], *touching])
    given = corner_normals(sheet.vertices[0], sheet.faces, surface_with(sheet, edges))
    hard_edges = find_hard_edges(polygons_of(sheet), given)
    if hard_edges.edges is not None:
        assert {*map(tuple, ascending(hard_edges.edges))} <= {*map(tuple, ascending(edges))}
    kept = corner_normals(sheet.vertices[0], sheet.faces, surface_with(sheet, hard_edges.edges))
    np.testing.assert_allclose(kept, given, atol=1e-12)


def test_normals_with_large_errors_are_counted():
    box = hard_box()
    bent = computed(box) + [[0, 0, 0], [0, 0, 0], [0, 0, 0], [1, 1, 1]] * 6
    hard_edges = find_hard_edges(polygons_of(box), bent)
    assert 0 < hard_edges.n_far <= 6
    assert hard_edges.n_corners == 24


def test_faceted_surface_has_only_hard_edges():
    grid = waving_grid(1, 60, 60)
    mesh = polygons_of(grid)
    hard_edges = find_hard_edges(
        mesh, np.repeat(face_normals(grid.vertices[0], grid.faces), 3, axis=0)
    )
    assert len(hard_edges.edges) == hard_edges.n_shared


def test_missing_normals_give_no_hard_edges():
    box = hard_box()
    normals = computed(box)
    normals[:20] = [[0, 0, 0], [np.nan, 0, 1]] * 10
    hard_edges = find_hard_edges(polygons_of(box), normals)
    assert (hard_edges.edges, hard_edges.n_corners) == (None, 4)


def test_edges_between_smoothing_groups_are_hard_and_all_of_group_0():
    mesh = polygons_of(hard_box())
    assert len(edges_between_groups(mesh, np.zeros(6, int)).edges) == 12
    assert edges_between_groups(mesh, np.full(6, 3)).edges is None
    rim = edges_between_groups(mesh, np.array([7, 1, 1, 1, 1, 1])).edges
    assert ascending(rim).tolist() == [[0, 1], [0, 2], [1, 3], [2, 3]]


def test_notes_on_several_meshes_are_one_sentence():
    notes = ["before"]
    normals = NormalNotes(notes)
    normals.add("/a", HardEdges(None, 10, 0, 30))
    assert notes == ["before", f"left out: {NORMALS}"]
    normals.add("/b", HardEdges(np.zeros((4, 2), np.int32), 10, 3, 30))
    normals.add("/b", HardEdges(np.zeros((4, 2), np.int32), 10, 3, 30))
    normals.add("/c", HardEdges(None, 10, 3, 30), is_track=True)
    assert notes == [
        "before",
        "kept 4 of 20 edges as hard edges, from which normals are computed in every frame",
        "normals do not follow from the faces at 3 of 60 corners, by more than 15 degrees",
    ]


@pytest.mark.filterwarnings("error")
def test_single_face_has_no_hard_edges():
    mesh = PolygonMesh(np.eye(3), np.array([3]), np.array([0, 1, 2], np.int32))
    hard_edges = find_hard_edges(mesh, np.ones((3, 3)))
    assert (hard_edges.edges, hard_edges.n_shared, hard_edges.n_corners) == (None, 0, 3)
