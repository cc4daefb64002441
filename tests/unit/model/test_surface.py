from dataclasses import replace

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Part, Surface
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
        (
            Surface(attributes=(replace(UV, indices=np.full(99, 99)),)),
            "indices outside 0..98",
        ),
        (Surface(attributes=(replace(UV, indices=np.zeros(5, int)),)), "5 indices"),
        (Surface(groups=(FaceGroups("m", ("a",), np.zeros(3, int)),)), "3 numbers"),
        (Surface(groups=(FaceGroups("m", ("a",), np.ones(160, int)),)), "outside -1..0"),
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
