from dataclasses import replace

import numpy as np
import pytest

from meshreel.formats.notes import NORMALS_LEFT_OUT
from meshreel.formats.surfaces.hard_edges import (
    HardEdges,
    NormalNotes,
    edges_of_creases,
    edges_of_groups,
    find_hard_edges,
)
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.geometry.fans import join_fans
from meshreel.model.geometry.hard_edges import corner_normals
from meshreel.model.geometry.normals import face_normals
from samples.meshes import cake, cake_normals, hard_box, hard_sheet, quad_sheet, waving_grid


def polygons_of(sequence):
    sizes = sequence.surface.sizes(sequence.n_faces)
    return PolygonMesh(sequence[0], sizes.astype(np.int64), join_fans(sizes, sequence.faces))


def ascending(edges):
    return np.unique(np.sort(edges, axis=1), axis=0)


def computed(sequence):
    return corner_normals(sequence[0], sequence.faces, sequence.surface)


@pytest.mark.parametrize("make", [hard_box, hard_sheet])
def test_hard_edges_are_found_again_when_normals_were_computed_by_them(make):
    sequence = make()
    found = find_hard_edges(polygons_of(sequence), computed(sequence))
    again = find_hard_edges(polygons_of(sequence), np.nan_to_num(computed(sequence)) * 7)
    np.testing.assert_array_equal(ascending(found.edges), ascending(again.edges))
    assert found.n_far == 0
    # An edge that ends within a fan parts no normals: only the others can be told from them.
    given = ascending(sequence.surface.hard_edges)
    assert {*map(tuple, ascending(found.edges))} <= {*map(tuple, given)}
    kept = corner_normals(sequence[0], sequence.faces, surface_with(sequence, found.edges))
    np.testing.assert_allclose(kept, computed(sequence), atol=1e-12)


def surface_with(sequence, edges):
    return replace(sequence.surface, hard_edges=edges)


def test_no_edge_is_hard_when_normals_are_smooth():
    sheet = quad_sheet()
    found = find_hard_edges(polygons_of(sheet), computed(sheet))
    assert (found.edges, found.n_far) == (None, 0)


def test_rims_of_a_cake_are_hard_when_its_side_is_smooth():
    sequence = cake()
    for normals in (cake_normals(sequence), -cake_normals(sequence)):
        found = find_hard_edges(polygons_of(sequence), normals)
        np.testing.assert_array_equal(
            ascending(found.edges), ascending(sequence.surface.hard_edges)
        )
        assert (found.n_far, found.n_shared) == (0, 24 * 5)


def test_normals_of_bytes_have_the_same_hard_edges():
    sequence = cake()
    rounded = np.rint(cake_normals(sequence) * 127) / 127
    found = find_hard_edges(polygons_of(sequence), rounded)
    np.testing.assert_array_equal(ascending(found.edges), ascending(sequence.surface.hard_edges))


def test_edges_are_hard_at_both_ends_or_one_whichever_is_nearer_to_the_normals():
    # A crease of a sheet that ends at a vertex, whose faces share a normal again.
    sheet = hard_sheet()
    dart = sheet.surface.hard_edges[[5]]
    next_one = {*dart[0].tolist()}
    touching = [e for e in sheet.surface.hard_edges if len(next_one & {*e.tolist()}) == 1]
    edges = np.array([dart[0], *touching])
    given = corner_normals(sheet[0], sheet.faces, surface_with(sheet, edges))
    found = find_hard_edges(polygons_of(sheet), given)
    if found.edges is not None:
        assert {*map(tuple, ascending(found.edges))} <= {*map(tuple, ascending(edges))}
    kept = corner_normals(sheet[0], sheet.faces, surface_with(sheet, found.edges))
    np.testing.assert_allclose(kept, given, atol=1e-12)


def test_far_normals_are_counted_when_they_do_not_follow_from_the_faces():
    box = hard_box()
    bent = computed(box) + [[0, 0, 0], [0, 0, 0], [0, 0, 0], [1, 1, 1]] * 6
    found = find_hard_edges(polygons_of(box), bent)
    assert 0 < found.n_far <= 6
    assert found.n_corners == 24


def test_all_edges_are_hard_when_a_fine_surface_is_faceted():
    grid = waving_grid(1, 60, 60)
    mesh = polygons_of(grid)
    found = find_hard_edges(mesh, np.repeat(face_normals(grid[0], grid.faces), 3, axis=0))
    assert len(found.edges) == found.n_shared


def test_unknown_normals_part_no_faces():
    box = hard_box()
    normals = computed(box)
    normals[:20] = [[0, 0, 0], [np.nan, 0, 1]] * 10
    found = find_hard_edges(polygons_of(box), normals)
    assert (found.edges, found.n_corners) == (None, 4)


def test_edges_between_smoothing_groups_are_hard_and_all_of_group_0():
    mesh = polygons_of(hard_box())
    assert len(edges_of_groups(mesh, np.zeros(6, int)).edges) == 12
    assert edges_of_groups(mesh, np.full(6, 3)).edges is None
    rim = edges_of_groups(mesh, np.array([7, 1, 1, 1, 1, 1])).edges
    assert ascending(rim).tolist() == [[0, 1], [0, 2], [1, 3], [2, 3]]


def test_creases_are_hard_where_they_lie_between_faces():
    mesh = polygons_of(hard_box())
    found = edges_of_creases(mesh, np.array([[0, 1], [0, 7], [3, 1], [8, 9], [-1, 0]]))
    assert ascending(found.edges).tolist() == [[0, 1], [1, 3]]


def test_notes_are_one_sentence_when_several_meshes_are_told_of():
    notes = ["before"]
    normals = NormalNotes(notes)
    normals.add("/a", HardEdges(None, 10, 0, 30))
    assert notes == ["before", NORMALS_LEFT_OUT]
    normals.add("/b", HardEdges(np.zeros((4, 2), np.int32), 10, 3, 30))
    normals.add("/b", HardEdges(np.zeros((4, 2), np.int32), 10, 3, 30))
    normals.add("/c", HardEdges(None, 10, 3, 30), is_track=True)
    assert notes == [
        "before",
        "kept 4 of 20 edges as hard edges, by which normals are computed in every frame",
        "normals do not follow from the faces at 3 of 60 corners, where those computed are more "
        "than 15 degrees off",
    ]


@pytest.mark.filterwarnings("error")
def test_no_edge_is_hard_when_there_is_a_single_face():
    mesh = PolygonMesh(np.eye(3), np.array([3]), np.array([0, 1, 2], np.int32))
    found = find_hard_edges(mesh, np.ones((3, 3)))
    assert (found.edges, found.n_shared, found.n_corners) == (None, 0, 3)
