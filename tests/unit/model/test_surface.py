from dataclasses import replace

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.model.cells import Cells
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Part, Surface
from meshreel.model.surface_description import describe_surface
from meshreel.model.surface_selection import missing_names, select
from samples.materials import dressed_sheet
from samples.meshes import quad_sheet, two_sheets, waving_grid

UV = Attribute("uv", Kind.UV, Domain.VERTEX, np.zeros((99, 2), np.float32))


def test_validated_drops_face_sizes_when_all_are_triangles():
    assert Surface(np.full(160, 3)).validated(99, waving_grid().faces).face_sizes is None


@pytest.mark.parametrize(
    ("surface", "message"),
    [
        (Surface(np.array([2, 4])), "face_sizes must be at least 3; face 0 has 2"),
        (Surface(np.array([4, 4])), "imply 4 triangles; the mesh has 160"),
        (Surface(np.full(80, 4)), "do not adjoin"),
        (Surface(np.array([4.0, 4.0])), "must be integers"),
        (Surface(attributes=(replace(UV, values=UV.values[:5]),)), "5 values; vertex needs 99"),
        (Surface(attributes=(replace(UV, values=UV.values[:, 0]),)), "shape (N, 1..16)"),
        (Surface(attributes=(replace(UV, values=UV.values.astype(np.int64)),)), "int64"),
        (Surface(attributes=(replace(UV, indices=np.full(99, 99)),)), "indices outside 0..98"),
        (Surface(attributes=(replace(UV, indices=np.zeros(5, int)),)), "5 indices"),
        (Surface(groups=(FaceGroups("m", ("a",), np.zeros(3, int)),)), "3 numbers"),
        (Surface(groups=(FaceGroups("m", ("a",), np.ones(160, int)),)), "outside -1..0"),
        (Surface(groups=(FaceGroups("m", ("a",), np.full(160, -2)),)), "outside -1..0"),
        (Surface(parts=(Part("a", 99, 3),)), "99 vertices and 3 faces"),
        (Surface(parts=(Part("a", -1, 160), Part("b", 100, 0))), "negative"),
        (Surface(hard_edges=np.array([[0, 1, 2]])), "hard_edges must be integers of shape (H, 2)"),
        (Surface(hard_edges=np.array([[0.0, 1.0]])), "hard_edges must be integers"),
        (Surface(hard_edges=np.array([[0, 99]])), "vertex indices in 0..98"),
        (Surface(hard_edges=np.array([[-1, 3]])), "vertex indices in 0..98"),
        (Surface(hard_edges=np.array([[3, 4], [5, 5]])), "has vertex 5 twice"),
    ],
)
def test_sequence_is_rejected_when_the_surface_does_not_fit(surface, message):
    grid = waving_grid()
    with pytest.raises(InvalidInputError) as error:
        grid.replace(surface=surface)
    assert message in str(error.value)


def test_validated_sorts_hard_edges_and_removes_duplicates():
    surface = Surface(hard_edges=np.array([[9, 2], [1, 0], [2, 9], [0, 1]])).validated(
        99, waving_grid().faces
    )
    assert surface.hard_edges.tolist() == [[0, 1], [2, 9]]
    assert not surface.hard_edges.flags.writeable
    assert not surface.is_plain
    assert surface.size_bytes == surface.hard_edges.nbytes
    assert repr(surface) == "<Surface: 2 hard edges>"


def test_surface_is_plain_when_no_edge_is_hard():
    assert Surface(hard_edges=np.empty((0, 2), int)).validated(99, waving_grid().faces).is_plain


def test_faces_may_be_in_no_group():
    surface = Surface(groups=(FaceGroups("m", (), np.full(160, -1)),))
    assert waving_grid().replace(surface=surface).surface.groups[0].numbers.tolist() == [-1] * 160


def test_validated_surface_is_read_only():
    surface = quad_sheet().surface
    for array in (surface.face_sizes, surface.attributes[0].values, surface.groups[0].numbers):
        assert not array.flags.writeable


def test_per_item_resolves_indices():
    uv, color = quad_sheet().surface.attributes
    np.testing.assert_array_equal(uv.per_item()[5], uv.values[uv.indices[5]])
    assert color.per_item() is color.values


def test_repr_lists_the_contents():
    assert "polygons" in repr(two_sheets().surface)
    assert "2 parts" in repr(two_sheets().surface)
    assert repr(Surface()) == "<Surface: plain>"


def test_size_counts_every_array():
    sequence = quad_sheet()
    sizes, (uv, color) = sequence.surface.face_sizes, sequence.surface.attributes
    arrays = [sizes, uv.values, uv.indices, color.values, sequence.surface.groups[0].numbers]
    assert sequence.surface.size_bytes == sum(array.nbytes for array in arrays)


def test_cells_are_counted_by_type_and_attributes_name_their_domain():
    types = np.array([12, 10, 25, 12, 14, 27, 15, 16, 13, 26], np.uint8)
    n_nodes = 8 + 4 + 20 + 8 + 5 + 13 + 10 + 12 + 6 + 15
    cells = Cells(types, np.zeros(n_nodes, np.int32))
    density = Attribute("density", Kind.OTHER, Domain.CELL, np.ones((10, 1)))
    texts = describe_surface(Surface(attributes=(density,), cells=cells))
    assert texts["cells"] == (
        "1 tetrahedron", "2 hexahedra", "1 wedge", "1 pyramid", "1 pentagonal prism",
        "1 hexagonal prism", "1 hexahedron of 20 nodes", "1 wedge of 15 nodes",
        "1 pyramid of 13 nodes",
    )  # fmt: skip
    assert texts["attributes"] == ("other 'density' of cells",)


def test_surface_without_cells_has_no_text_about_them():
    assert describe_surface(Surface())["cells"] == ()


def names_of(surface):
    return [attribute.name for attribute in (*surface.attributes, *surface.groups)]


@pytest.mark.parametrize(
    ("names", "kept"),
    [
        ("all", ["st", "color", "material"]),
        ("none", []),
        ("st", ["st"]),
        ("uv", ["st"]),
        ("material, color", ["color", "material"]),
        (["color", "st"], ["st", "color"]),
        ([], []),
    ],
)
def test_select_keeps_named_attributes_and_kinds(names, kept):
    assert names_of(select(two_sheets().surface, names)) == kept


def test_select_always_keeps_polygons_and_parts():
    surface = two_sheets().surface
    selected = select(surface, "none")
    assert selected.face_sizes is surface.face_sizes
    assert selected.parts == surface.parts


def test_select_all_returns_the_surface_itself():
    surface = two_sheets().surface
    assert select(surface, "all") is surface


def test_error_lists_the_attributes_when_a_name_does_not_exist():
    with pytest.raises(InvalidInputError) as error:
        select(two_sheets().surface, "uv,colour")
    message = "has no attribute or group 'colour'; it has 'st', 'color', 'material'"
    assert str(error.value) == message


@pytest.mark.parametrize("names", ["", "uv,,color", "uv,"])
def test_select_rejects_empty_names(names):
    with pytest.raises(InvalidInputError, match="all, none, or names"):
        select(two_sheets().surface, names)


def test_kind_other_is_not_a_name():
    attribute = Attribute("heat", Kind.OTHER, Domain.VERTEX, np.zeros((3, 1), np.float32))
    groups = FaceGroups("material", ("red",), np.zeros(1, np.int32))
    assert missing_names(Surface(None, (attribute,), (groups,)), "other,heat") == ["other"]


@pytest.mark.parametrize(("names", "n_left"), [("none", 0), ("uv", 0), ("uv,material", 2)])
def test_materials_and_images_are_kept_with_their_groups(names, n_left):
    selected = select(dressed_sheet().surface, names)
    assert (len(selected.materials), len(selected.images)) == (n_left, n_left)
