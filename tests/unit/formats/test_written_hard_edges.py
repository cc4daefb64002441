"""Hard edges written to every format and read back."""

import numpy as np
import pytest

import meshreel
from meshreel.formats.load import load
from meshreel.formats.save import save
from samples.glb import written
from samples.meshes import assert_same_surface, cake, hard_box, hard_sheet, waving_grid


def ascending(edges):
    return np.unique(np.sort(edges, axis=1), axis=0)


def loaded(path):
    notes = []
    return load(path, notes=notes), notes


def assert_same_normals(found, expected, atol=1e-5):
    """Corner normals of all frames of a sequence."""
    one, other = (
        meshreel.corner_normals(x.vertices, x.faces, x.surface) for x in (found, expected)
    )
    np.testing.assert_allclose(one, other, atol=atol)


@pytest.mark.parametrize("extension", [".npz", ".h5"])
def test_array_formats_round_trip_hard_edges(tmp_path, extension):
    if extension == ".h5":
        pytest.importorskip("h5py")
    box = hard_box()
    save(box, tmp_path / f"a{extension}")
    result, notes = loaded(tmp_path / f"a{extension}")
    assert_same_surface(result.surface, box.surface)
    assert notes == []


@pytest.mark.parametrize("make", [hard_box, cake, hard_sheet])
@pytest.mark.parametrize("extension", [".usdc", ".abc"])
def test_scene_formats_round_trip_hard_edges_without_a_track(tmp_path, make, extension):
    pytest.importorskip("pxr" if extension == ".usdc" else "alembic3d")
    sequence = make()
    save(sequence, tmp_path / f"a{extension}")
    result, notes = loaded(tmp_path / f"a{extension}")
    assert_same_normals(result, sequence, 1e-4)
    assert result.tracks == {}
    assert not any("do not follow" in note for note in notes)


def test_usd_stores_corner_normals_for_other_programs(tmp_path):
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom

    box = hard_box()
    save(box, tmp_path / "a.usda")
    stage = Usd.Stage.Open(str(tmp_path / "a.usda"))
    mesh = next(prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh))
    normals = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("normals")
    assert normals.GetInterpolation() == "faceVarying"
    for frame, code in enumerate(normals.GetTimeSamples()):
        expected = meshreel.corner_normals(box.vertices[frame], box.faces, box.surface)
        np.testing.assert_allclose(normals.ComputeFlattened(code), expected, atol=1e-6)


def test_normals_of_all_parts_are_written(tmp_path):
    pytest.importorskip("pxr")
    box = hard_box()
    save(box, tmp_path / "a.usda")
    save(load(tmp_path / "a.usda", merge=True), tmp_path / "b.usda")
    assert len(load(tmp_path / "b.usda").surface.hard_edges) == 12


@pytest.mark.parametrize("make", [hard_box, cake])
def test_glb_splits_vertices_at_hard_edges(tmp_path, make, notes):
    sequence = make()
    glb = written(tmp_path, sequence, notes)
    primitive = glb.document["meshes"][0]["primitives"][0]
    normals = glb.array(primitive["attributes"]["NORMAL"])
    corners = glb.array(primitive["indices"]).ravel()
    count = {8: 24, 50: 98}[sequence.n_verts]
    assert len(normals) == count
    sizes = sequence.surface.face_sizes
    still = sequence.replace(vertices=sequence.vertices.mean(axis=0, keepdims=True))
    expected = meshreel.corner_normals(still.vertices[0], still.faces, still.surface)
    of_corner = dict(zip(triangle_corners(sizes), corners.tolist(), strict=True))
    for corner, normal in enumerate(expected):
        assert normals[of_corner[corner]] @ normal > 0.99
    assert any("smooth except at hard edges" in note for note in notes)


def triangle_corners(sizes):
    """Face corner of each triangle corner."""
    starts = np.cumsum(sizes) - sizes
    return [
        start + k
        for start, size in zip(starts.tolist(), sizes.tolist(), strict=True)
        for second in range(1, size - 1)
        for k in (0, second, second + 1)
    ]


@pytest.mark.parametrize("make", [hard_box, cake])
def test_glb_round_trips_hard_edges(tmp_path, make):
    sequence = make(1)
    save(sequence, tmp_path / "a.glb")
    result, _ = loaded(tmp_path / "a.glb")
    assert result.n_verts == sequence.n_verts
    assert len(result.surface.hard_edges) == len(sequence.surface.hard_edges)


def test_glb_without_normals_splits_no_vertices(tmp_path):
    glb = written(tmp_path, hard_box(), normals=False)
    attributes = glb.document["meshes"][0]["primitives"][0]["attributes"]
    assert "NORMAL" not in attributes
    assert len(glb.array(attributes["POSITION"])) == 8


@pytest.mark.parametrize("make", [hard_box, cake])
def test_obj_hard_edges_become_smoothing_groups(tmp_path, make):
    sequence = make(2)
    save(sequence, tmp_path / "a_%04d.obj")
    text = next(tmp_path.glob("*.obj")).read_text()
    assert "vn " not in text
    n_groups = {8: 1, 50: 3}[sequence.n_verts]
    assert text.count("\ns ") == n_groups
    assert ("\ns off\n" in text) == (n_groups == 1)
    result, notes = loaded(tmp_path)
    np.testing.assert_array_equal(
        ascending(result.surface.hard_edges), ascending(sequence.surface.hard_edges)
    )
    assert not any("left out" in note for note in notes)


def test_obj_falls_back_to_normals_for_hard_edges(tmp_path):
    sheet = hard_sheet(1)
    save(sheet, tmp_path / "a.obj")
    text = (tmp_path / "a.obj").read_text()
    assert "\ns " not in text
    rows = np.array([line.split()[1:] for line in text.splitlines() if line.startswith("vn ")])
    words = " ".join(line[2:] for line in text.splitlines() if line.startswith("f ")).split()
    named = rows.astype(float)[[int(word.split("/")[2]) - 1 for word in words]]
    expected = meshreel.corner_normals(sheet.vertices[0], sheet.faces, sheet.surface)
    np.testing.assert_allclose(named, expected, atol=1e-6)
    result, _ = loaded(tmp_path / "a.obj")
    assert_same_normals(result, sheet, 1e-4)


@pytest.mark.parametrize("extension", [".ply", ".off", ".stl", ".pvd"])
def test_unsupported_hard_edges_are_noted(tmp_path, extension, notes):
    save(hard_box(1), tmp_path / f"a{extension}", notes=notes)
    assert any("12 hard edges" in note for note in notes)


def test_surface_without_hard_edges_adds_no_note(tmp_path, notes):
    save(waving_grid(1), tmp_path / "a.ply", notes=notes)
    assert notes == []
