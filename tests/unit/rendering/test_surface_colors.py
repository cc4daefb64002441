import numpy as np
import pytest

from meshreel.model.surface import Attribute, Domain, Kind, Surface
from meshreel.rendering.scenes import surface_colors
from samples.meshes import quad_sheet

RED, GREEN = [255, 0, 0], [0, 255, 0]
FACES = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4]], np.int32)  # a quad and a triangle
SIZES = np.array([4, 3], np.int32)


def colored(domain, values):
    return Surface(SIZES, (Attribute("color", Kind.COLOR, domain, values),)).validated(5, 3)


def test_there_are_no_colours_when_the_mesh_carries_none():
    assert surface_colors(Surface(), FACES) is None


def test_colours_are_those_of_vertices_when_they_carry_them():
    values = np.arange(20, dtype=np.uint8).reshape(5, 4)
    found = surface_colors(colored(Domain.VERTEX, values), FACES)
    np.testing.assert_array_equal(found, values[:, :3])


def test_colours_are_the_same_at_all_corners_when_faces_carry_them():
    values = np.array([RED, GREEN], np.float32) / 255
    found = surface_colors(colored(Domain.FACE, values), FACES)
    np.testing.assert_allclose(found, [[RED] * 3, [RED] * 3, [GREEN] * 3])


def test_colours_follow_the_fan_when_corners_of_polygons_carry_them():
    values = np.repeat(np.arange(7, dtype=np.uint8)[:, None], 3, axis=1)
    found = surface_colors(colored(Domain.CORNER, values), FACES)
    np.testing.assert_array_equal(found[..., 0], [[0, 1, 2], [0, 2, 3], [4, 5, 6]])


@pytest.mark.parametrize("value", [-1.0, 2.0, float("nan")])
def test_colours_stay_in_range_when_floats_do_not(value):
    values = np.full((5, 3), value, np.float32)
    found = surface_colors(colored(Domain.VERTEX, values), FACES)
    assert 0 <= found.min() <= found.max() <= 255


def test_colours_of_a_whole_sheet_fit_its_vertices():
    sheet = quad_sheet()
    assert surface_colors(sheet.surface, sheet.faces).shape == (sheet.n_verts, 3)
