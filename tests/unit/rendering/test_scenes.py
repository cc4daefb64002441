import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.metrics.heat import HEATS, heat_field
from meshreel.metrics.reference import bounding_box_reference
from meshreel.rendering.scenes import Scene
from meshreel.rendering.views import View
from meshreel.sequence import MeshSequence
from samples.meshes import quad_sheet, waving_grid


def drawn(scene, number=3, heat_range=None):
    camera = View().camera(scene.framed.vertices, 160, 120)
    return scene.draw(scene.read(number), camera, heat_range)


def test_scene_names_the_option_when_there_is_heat_and_no_original(grid):
    with pytest.raises(InvalidInputError, match="--original"):
        Scene(grid, None, "angle")


def test_scene_is_refused_when_the_original_is_another_mesh(grid):
    with pytest.raises(InvalidInputError, match="only sequences of the same mesh"):
        Scene(grid, waving_grid(12, 5, 5))


def test_scene_has_a_view_for_each_title_when_drawn(grid, lifted):
    for scene, titles in (
        (Scene(grid), [""]),
        (Scene(lifted, grid), ["original", "decoded"]),
        (Scene(lifted, grid, "angle"), ["original", "decoded", HEATS["angle"].label]),
    ):
        assert scene.titles == titles
        assert len(drawn(scene, heat_range=scene.heat_range([3]))) == len(titles)


@pytest.mark.parametrize("kind", HEATS)
def test_heat_range_covers_nearly_all_values_when_frames_are_measured(kind, grid, lifted):
    heat_range = Scene(lifted, grid, kind).heat_range(range(12))
    diagonal = bounding_box_reference(grid.vertices).diagonal
    field = heat_field(kind, grid.faces, grid.n_verts, diagonal)
    values = np.concatenate(
        [field(*pair) for pair in zip(grid.vertices, lifted.vertices, strict=True)]
    )
    assert heat_range.largest == values.max()
    assert (values <= heat_range.high).mean() > 0.99
    assert heat_range.high <= 2 * values.max()


def test_heat_map_is_bright_where_vertices_are_off_and_dark_elsewhere(grid, lifted):
    same, off = Scene(grid, grid, "distance"), Scene(lifted, grid, "distance")
    heat_range = off.heat_range([3])
    dark, bright = (drawn(scene, heat_range=heat_range)[2].astype(int) for scene in (same, off))
    changed = np.abs(bright - dark).max(axis=2) > 60
    assert 0.02 < changed.mean() < 0.5
    assert np.abs(drawn(off)[0].astype(int) - drawn(same)[0]).max() == 0


def test_scene_without_heat_has_no_range(grid):
    assert Scene(grid, grid).heat_range([0]) is None


def test_scene_shows_the_colours_of_the_surface_when_there_are_any():
    sheet = quad_sheet()
    plain = MeshSequence(sheet.vertices, sheet.faces)
    colored, grey = (drawn(Scene(one))[0].astype(int) for one in (sheet, plain))
    spread = [np.ptp(view, axis=2)[(view != 255).any(axis=2)].mean() for view in (colored, grey)]
    assert spread[0] > 2 * spread[1]
