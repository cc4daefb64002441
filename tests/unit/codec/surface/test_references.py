import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from conformance.surface import CornerReferences, Polygons, read_references
from meshreel.codec.surface.rows import encode_corner_references, encode_references
from meshreel.errors import InvalidInputError
from meshreel.kernel.polygons import triangulate
from meshreel.model.surface import PLAIN, Surface
from samples.meshes import waving_grid

ROWS = st.integers(0, 80).flatmap(lambda size: arrays(np.int32, size, elements=st.integers(0, 20)))


@given(ROWS)
def test_references_of_vertices_round_trip(rows):
    assert read_references(encode_references(rows), len(rows)) == rows.tolist()


@st.composite
def polygon_rows(draw):
    """Sizes and corners of polygons on a few vertices, and a row of each corner."""
    sizes = np.array(draw(st.lists(st.integers(3, 6), min_size=1, max_size=12)))
    n_corners = int(sizes.sum())
    corners = draw(arrays(np.int64, n_corners, elements=st.integers(0, 6)))
    return sizes, corners, draw(arrays(np.int32, n_corners, elements=st.integers(0, 9)))


@given(polygon_rows())
def test_references_of_corners_of_any_polygons_round_trip(case):
    sizes, corners, rows = case
    faces, _ = triangulate(sizes, corners, np.random.default_rng(0).random((7, 3)))
    surface = Surface(face_sizes=sizes.astype(np.int32))
    polygons = Polygons(None, [tuple(face) for face in faces.tolist()])
    polygons.sizes = sizes.tolist()
    coded = encode_corner_references(rows, surface, faces)
    assert CornerReferences(coded, polygons).read() == rows.tolist()


def test_corners_that_share_the_row_of_their_vertex_take_few_bytes():
    faces = waving_grid(1, 40, 40).faces
    assert len(encode_corner_references(faces.ravel(), PLAIN, faces)) < 200


def test_a_seam_costs_little_more_than_its_vertices():
    sheet = waving_grid(1, 40, 40)
    is_right = sheet.vertices[0][sheet.faces].mean(axis=1)[:, 0] > sheet.vertices[0][:, 0].mean()
    keys = (2 * sheet.faces + is_right[:, None]).ravel()
    _, first, number = np.unique(keys, return_index=True, return_inverse=True)
    rows = np.argsort(np.argsort(first))[number]  # numbered by first use
    n_split = len(first) - sheet.n_verts
    assert n_split > 40
    assert len(encode_corner_references(rows, PLAIN, sheet.faces)) < 100 + 2 * n_split


def test_negative_rows_are_refused():
    with pytest.raises(InvalidInputError, match="rows of corners"):
        encode_corner_references(np.array([0, -1, 2]), PLAIN, np.array([[0, 1, 2]], np.int32))
