"""Meshes of trimesh and PyVista become frames and back."""

import sys

import numpy as np
import pytest

import meshreel
from samples.meshes import quad_sheet, waving_grid


def test_frames_of_trimesh_become_segments_of_equal_faces():
    pytest.importorskip("trimesh")
    grid, sheet = waving_grid(3), quad_sheet(2)
    meshes = [meshreel.to_trimesh(one, frame) for one in (grid, sheet) for frame in (0, -1)]
    assert meshes[1].vertices.tolist() == grid.vertices[-1].tolist()
    found = meshreel.from_trimesh(meshes, fps=25)
    assert (found.n_frames, found.n_segments, found.fps) == (4, 2, 25)
    for frame, one in enumerate((grid, grid, sheet, sheet)):
        assert np.array_equal(found[frame].vertices, one.vertices[-(frame % 2)])
        assert np.array_equal(found[frame].faces, one.faces)
    [color] = found.segments[1].surface.attributes
    assert np.array_equal(color.values, sheet.surface.attributes[1].values)
    assert found.segments[0].surface.attributes == ()


def test_colors_of_trimesh_that_change_become_a_track():
    pytest.importorskip("trimesh")
    meshes = [meshreel.to_trimesh(quad_sheet(2), frame) for frame in (0, 1)]
    meshes[1].visual.vertex_colors = np.full((30, 4), 7, np.uint8)
    colors = meshreel.from_trimesh(meshes).tracks["color"].values
    assert np.array_equal(colors, [mesh.visual.vertex_colors for mesh in meshes])


@pytest.mark.slow
def test_frames_of_pyvista_keep_polygons_and_arrays():
    pytest.importorskip("pyvista")
    sheet = quad_sheet(3)
    meshes = [meshreel.to_pyvista(sheet, frame) for frame in range(3)]
    assert meshes[0].n_cells == len(sheet.surface.face_sizes)
    for frame, mesh in enumerate(meshes):
        mesh.point_data["heat"] = np.full(sheet.n_verts, frame, np.float32)
    found = meshreel.from_pyvista(meshes, fps=24)
    assert np.array_equal(found.vertices, sheet.vertices)
    assert np.array_equal(found.surface.face_sizes, sheet.surface.face_sizes)
    assert found.tracks["heat"].values[:, 0, 0].tolist() == [0, 1, 2]
    assert found.fps == 24


@pytest.mark.slow
@pytest.mark.parametrize("convert", [meshreel.to_trimesh, meshreel.to_pyvista])
def test_frames_that_do_not_exist_are_refused(convert):
    pytest.importorskip(convert.__name__.removeprefix("to_"))
    with pytest.raises(IndexError):
        convert(waving_grid(3), 3)


def test_a_library_that_is_not_installed_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(meshreel.InvalidInputError, match="pip install trimesh"):
        meshreel.to_trimesh(waving_grid(3))
