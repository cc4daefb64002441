import numpy as np
import pytest

from meshreel.formats.gltf.mesh_writer import describe_losses, split_at_seams
from meshreel.formats.scenes.parts import PartMesh, split_parts
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Surface

QUADS = np.array([[0, 1, 2, 3], [1, 4, 5, 2]], np.int32)
CORNERS = QUADS.ravel()


def two_quads(*attributes, groups=(), n_verts=6):
    """Return two adjacent squares with corners 0 to 7."""
    faces = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]], np.int32)
    surface = Surface(np.array([4, 4], np.int32), attributes, groups)
    (part,) = split_parts(faces, surface.validated(n_verts, faces), n_verts, "squares")
    assert isinstance(part, PartMesh)
    return part


def attribute(kind, domain, values, dtype=np.float32, name="a"):
    return Attribute(name, kind, domain, np.asarray(values, dtype))


def uv(domain, values):
    return attribute(Kind.UV, domain, values)


def triangles(split):
    """Return the corners of all triangles as original vertices."""
    return np.concatenate(
        [split.sources[primitive.verts][primitive.triangles] for primitive in split.primitives]
    )


def test_vertices_without_seams_are_not_split():
    split = split_at_seams(two_quads())
    assert split.sources.tolist() == list(range(6))
    assert triangles(split).tolist() == [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]]


def test_vertices_without_faces_are_left_out():
    assert split_at_seams(two_quads(n_verts=9)).sources.tolist() == list(range(6))


def test_vertices_are_split_where_uvs_differ():
    values = np.zeros((8, 2))
    values[4] = 0.5, 0.25  # vertex 1, in the second square only
    split = split_at_seams(two_quads(uv(Domain.CORNER, values)))
    assert split.sources.tolist() == [0, 1, 1, 2, 3, 4, 5]
    written = split.attributes["TEXCOORD_0"]
    corner = np.flatnonzero((written == [0.5, 0.75]).all(axis=1))
    assert split.sources[corner].tolist() == [1]
    assert triangles(split).tolist() == [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]]


@pytest.mark.parametrize("kind", [Kind.OTHER, Kind.COLOR])
def test_vertices_are_not_split_for_the_sign_of_zero(kind):
    values = np.zeros((8, 3))
    values[4:] = -0.0
    split = split_at_seams(two_quads(attribute(kind, Domain.CORNER, values)))
    assert split.sources.tolist() == list(range(6))


def test_vertices_are_not_split_where_uvs_agree():
    values = np.array([[0.1, 0.2], [0.3, 0.4], [0.5, -0.0], [1, 0], [0, 0], [1, 1]])
    split = split_at_seams(two_quads(uv(Domain.CORNER, values[CORNERS])))
    assert split.sources.tolist() == list(range(6))
    expected = np.stack([values[:, 0], 1 - values[:, 1]], axis=1).astype(np.float32)
    np.testing.assert_array_equal(split.attributes["TEXCOORD_0"], expected)


def test_vertex_attributes_split_nothing():
    colors = np.arange(24).reshape(6, 4)
    split = split_at_seams(two_quads(attribute(Kind.COLOR, Domain.VERTEX, colors, np.uint8)))
    assert split.sources.tolist() == list(range(6))
    np.testing.assert_array_equal(split.attributes["COLOR_0"], colors)


def test_vertices_are_split_along_edges_where_face_colors_differ():
    colors = [[255, 0, 0], [0, 255, 0]]
    split = split_at_seams(two_quads(attribute(Kind.COLOR, Domain.FACE, colors, np.uint8)))
    assert split.sources.tolist() == [0, 1, 1, 2, 2, 3, 4, 5]
    corners = split.primitives[0].triangles
    expected = np.repeat(np.array(colors), 2, axis=0)[:, None].repeat(3, axis=1)
    np.testing.assert_array_equal(split.attributes["COLOR_0"][corners], expected)


def test_each_used_material_has_a_primitive():
    groups = (FaceGroups("material", ("unused", "red"), np.array([1, -1], np.int32)),)
    split = split_at_seams(two_quads(groups=groups))
    assert [primitive.material for primitive in split.primitives] == ["red", None]
    assert [split.sources[primitive.verts].tolist() for primitive in split.primitives] == [
        [0, 1, 2, 3],
        [1, 2, 4, 5],
    ]
    assert split.primitives[1].triangles.tolist() == [[0, 2, 3], [0, 3, 1]]


def test_attributes_of_the_same_kind_are_numbered():
    zeros = np.zeros((6, 2))
    own = attribute(Kind.OTHER, Domain.VERTEX, np.zeros((6, 1)), name="heat")
    split = split_at_seams(two_quads(uv(Domain.VERTEX, zeros), own, uv(Domain.VERTEX, zeros + 1)))
    assert list(split.attributes) == ["TEXCOORD_0", "_heat", "TEXCOORD_1"]


@pytest.mark.parametrize(
    ("values", "dtype", "expected"),
    [
        ([-1, 0, 1.5], np.float64, np.array([0, 0, 1], np.float32)),
        ([0, 255, 7], np.uint8, np.array([0, 255, 7], np.uint8)),
        ([-4, 300, 7], np.int32, np.array([0, 255, 7], np.uint8)),
    ],
)
def test_colors_are_clipped_to_the_valid_range(values, dtype, expected):
    colors = attribute(Kind.COLOR, Domain.VERTEX, np.tile(values, (6, 1)), dtype)
    result = split_at_seams(two_quads(colors)).attributes["COLOR_0"]
    assert result.dtype == expected.dtype
    np.testing.assert_array_equal(result, np.tile(expected, (6, 1)))


def test_describe_losses_names_what_gltf_cannot_store():
    wide = attribute(Kind.OTHER, Domain.VERTEX, np.zeros((6, 5)), name="wide")
    integer = attribute(Kind.OTHER, Domain.VERTEX, np.zeros((6, 1)), np.int32, "id")
    bright = attribute(Kind.COLOR, Domain.VERTEX, np.full((6, 3), 2.0), name="hot")
    groups = (FaceGroups("group", ("left",), np.zeros(2, np.int32)),)
    surface = two_quads(wide, integer, bright, groups=groups).surface  # of triangles
    assert list(describe_losses(surface, 4)) == [
        "clipped colors 'hot' to 0..1",
        "left out attribute 'wide': glTF does not support 5 components of float32",
        "left out attribute 'id': glTF does not support 1 components of int32",
        "left out face groups 'group': glTF supports only materials",
    ]
