import numpy as np
import pytest

from meshreel.model.surface import Attribute, Domain, Kind, Surface
from meshreel.rendering.scenes import surface_colors
from samples.meshes import quad_sheet

RED, GREEN = [255, 0, 0], [0, 255, 0]
FACES = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4]], np.int32)  # a quad and a triangle
SIZES = np.array([4, 3], np.int32)


def colored(domain, values):
    return Surface(SIZES, (Attribute("color", Kind.COLOR, domain, values),)).validated(5, FACES)


def test_mesh_without_color_attributes_has_no_colors():
    assert surface_colors(Surface(), FACES) is None


def test_colors_of_vertices_are_returned_without_opacity():
    values = np.arange(20, dtype=np.uint8).reshape(5, 4)
    actual = surface_colors(colored(Domain.VERTEX, values), FACES)
    np.testing.assert_array_equal(actual, values[:, :3])


def test_colors_of_faces_are_repeated_at_all_corners():
    values = np.array([RED, GREEN], np.float32) / 255
    actual = surface_colors(colored(Domain.FACE, values), FACES)
    np.testing.assert_allclose(actual, [[RED] * 3, [RED] * 3, [GREEN] * 3])


def test_colors_of_polygon_corners_follow_the_triangle_fan():
    values = np.repeat(np.arange(7, dtype=np.uint8)[:, None], 3, axis=1)
    actual = surface_colors(colored(Domain.CORNER, values), FACES)
    np.testing.assert_array_equal(actual[..., 0], [[0, 1, 2], [0, 2, 3], [4, 5, 6]])


@pytest.mark.parametrize("value", [-1.0, 2.0, float("nan")])
def test_float_colors_are_clamped(value):
    values = np.full((5, 3), value, np.float32)
    actual = surface_colors(colored(Domain.VERTEX, values), FACES)
    assert 0 <= actual.min() <= actual.max() <= 255


def test_colors_of_a_whole_sheet_fit_its_vertices():
    sheet = quad_sheet()
    assert surface_colors(sheet.surface, sheet.faces).shape == (sheet.n_verts, 3)
