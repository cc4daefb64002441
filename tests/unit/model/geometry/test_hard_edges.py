import numpy as np
import pytest

import meshreel
from meshreel.errors import InvalidInputError
from meshreel.formats.gltf.morphs import creased_share
from meshreel.model.geometry.hard_edges import normal_rows, shared_edges
from meshreel.model.geometry.normals import vertex_normals
from meshreel.model.geometry.polygons import join_triangles
from meshreel.model.surface import Surface
from samples.meshes import BOX_QUADS, hard_box, hard_sheet, quad_sheet, waving_grid
from samples.surfaces import CUBE, CUBE_FACES


def test_shared_edges_are_in_the_order_of_their_first_sides():
    # Two triangles share 1, 2, a third shares 2, 3, and one uses a vertex twice.
    corners = np.array([0, 1, 2, 2, 1, 3, 3, 2, 4, 5, 5, 0])
    edges = shared_edges(np.full(4, 3), corners)
    assert edges.ends.tolist() == [[1, 2], [2, 3], [0, 5]]
    assert edges.of_side.tolist() == [-1, 0, -1, 0, -1, 1, 1, -1, -1, -1, 2, 2]


def test_corner_normals_are_vertex_normals_without_hard_edges():
    sheet = quad_sheet(2)
    computed = meshreel.corner_normals(sheet.vertices, sheet.faces, sheet.surface)
    corners = join_triangles(sheet.surface.face_sizes, sheet.faces)
    for frame, normals in zip(sheet.vertices, computed, strict=True):
        expected = vertex_normals(frame, sheet.faces)[corners]
        np.testing.assert_allclose(normals, expected, atol=1e-12)


def test_corner_normals_are_face_normals_when_all_edges_are_hard():
    box = hard_box()
    normals = meshreel.corner_normals(box.vertices[2], box.faces, box.surface)
    axes = [[0, 0, -1], [0, 0, 1], [0, -1, 0], [0, 1, 0], [-1, 0, 0], [1, 0, 0]]
    np.testing.assert_allclose(normals.reshape(6, 4, 3), np.repeat(np.array(axes)[:, None], 4, 1))


def test_faces_share_a_normal_around_the_end_of_a_hard_edge():
    # One hard edge of a box: both ends have a single fan around it.
    rows = normal_rows(np.full(6, 4), BOX_QUADS.ravel(), np.array([[0, 1]], np.int32), 8)
    np.testing.assert_array_equal(rows.of_corner, BOX_QUADS.ravel())
    np.testing.assert_array_equal(rows.vertices, np.arange(8))


def test_vertices_have_one_row_per_fan():
    # The rim of the bottom separates its corners from those of the sides.
    rim = np.array([[0, 1], [1, 3], [2, 3], [0, 2]], np.int32)
    rows = normal_rows(np.full(6, 4), BOX_QUADS.ravel(), rim, 8)
    assert rows.of_corner[:4].tolist() == [0, 2, 3, 1]
    np.testing.assert_array_equal(rows.vertices, [*range(8), 0, 1, 2, 3])
    of_sides = rows.of_corner[8:]
    assert set(of_sides.tolist()) == {*range(4, 12)}
    np.testing.assert_array_equal(rows.vertices[rows.of_corner], BOX_QUADS.ravel())


def test_faces_that_share_only_a_vertex_are_one_fan_without_hard_edges():
    corners = np.array([0, 1, 2, 0, 2, 3, 0, 4, 5, 0, 5, 6])
    counts = np.full(4, 3)
    assert len(normal_rows(counts, corners, np.array([[0, 2]]), 7).vertices) == 10
    assert len(normal_rows(counts, corners, None, 7).vertices) == 7


def test_hard_edges_split_the_same_corners_as_a_traversal_of_fans():
    sheet = hard_sheet(1)
    counts, corners = (
        sheet.surface.face_sizes,
        join_triangles(sheet.surface.face_sizes, sheet.faces),
    )
    rows = normal_rows(counts, corners, sheet.surface.hard_edges, sheet.n_verts).of_corner
    assert len(set(rows.tolist())) > sheet.n_verts
    assert partition(rows) == partition(merged_labels(counts, corners, sheet.surface.hard_edges))


def partition(labels):
    groups = {}
    for corner, label in enumerate(labels):
        groups.setdefault(int(label), set()).add(corner)
    return sorted(map(sorted, groups.values()))


def merged_labels(counts, corners, hard_edges):
    """Return a label per corner, merging neighbors until nothing changes."""
    starts = np.cumsum(counts) - counts
    sides = {}
    for start, size in zip(starts.tolist(), counts.tolist(), strict=True):
        for k in range(size):
            one, other = start + k, start + (k + 1) % size
            edge = frozenset((int(corners[one]), int(corners[other])))
            sides.setdefault(edge, []).append({int(corners[one]): one, int(corners[other]): other})
    hard = {frozenset(edge.tolist()) for edge in hard_edges}
    split = {vertex for edge in hard for vertex in edge}
    labels = list(range(len(corners)))
    joined = [pair for edge, near in sides.items() if edge not in hard for pair in pairs(near)]
    for vertex in set(corners.tolist()) - split:
        own = np.flatnonzero(corners == vertex).tolist()
        joined += [(own[0], other) for other in own]
    for _ in range(len(corners)):
        for one, other in joined:
            labels[one] = labels[other] = min(labels[one], labels[other])
    return labels


def pairs(sides):
    for side in sides[1:]:
        for vertex, corner in side.items():
            yield sides[0][vertex], corner


def test_hard_edge_is_rejected_when_the_mesh_has_no_such_edge():
    grid = waving_grid(1)
    surface = Surface(hard_edges=np.array([[0, 50]], np.int32))
    with pytest.raises(InvalidInputError, match="hard edge 0, 50 must have two or more faces"):
        meshreel.corner_normals(grid[0].vertices, grid.faces, surface)


STRIP = np.array([[0, 1, 2], [2, 1, 3]], np.int32)


def folded_strip(angle_deg):
    """Return two triangles with an angle at their common edge."""
    angle = np.radians(angle_deg)
    far = [1 + np.cos(angle), 0, np.sin(angle)]
    return np.array([[0, 0, 0], [1, -1, 0], [1, 1, 0], far])


@pytest.mark.parametrize(("angle_deg", "share"), [(0, 0), (59, 0), (61, 1), (179, 1)])
def test_edge_is_a_crease_when_faces_turn_by_more_than_60_degrees(angle_deg, share):
    assert creased_share(folded_strip(angle_deg), STRIP) == share


def test_creased_share_is_weighted_by_edge_length():
    assert creased_share(CUBE, np.array(CUBE_FACES)) == pytest.approx(12 / (12 + 6 * 2**0.5))


def test_creased_share_of_a_smooth_sheet_is_0():
    grid = waving_grid()
    assert creased_share(grid.vertices[3], grid.faces) == 0


@pytest.mark.parametrize(
    "faces", [[[0, 1, 2]], [[0, 1, 2], [0, 1, 2], [0, 1, 2]], [[0, 0, 1], [1, 0, 0]]]
)
def test_creased_share_is_1_without_edges_between_two_proper_faces(faces):
    assert creased_share(folded_strip(10), np.array(faces)) == 1
