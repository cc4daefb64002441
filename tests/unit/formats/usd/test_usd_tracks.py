"""Animated primvars, normals and velocities of USD files, read and written as tracks."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("pxr")
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from meshreel.formats.load import load
from meshreel.model.surface import Domain
from meshreel.model.tracks import Track
from meshreel.operations.save import save
from samples.meshes import quad_sheet
from samples.surfaces import srgb
from samples.tracks import assert_same_tracks, tracked_sheet
from samples.usd import assert_is_valid

RNG = np.random.default_rng(8)
COUNTS, CORNERS = [4, 4], [0, 1, 4, 3, 1, 2, 5, 4]
SIZES = {"vertex": 6, "varying": 6, "uniform": 2, "faceVarying": 8}
DOMAINS = {"vertex": "vertex", "varying": "vertex", "uniform": "face", "faceVarying": "corner"}
POINTS = RNG.normal(size=(4, 6, 3)).astype(np.float32)


def new_mesh(path, points=POINTS):
    """Return a stage and its mesh of two quads, with points sampled at codes 1, 2, ..."""
    stage = Usd.Stage.CreateNew(str(path))
    stage.SetTimeCodesPerSecond(10)
    mesh = UsdGeom.Mesh.Define(stage, "/world/m")
    mesh.CreateFaceVertexCountsAttr(COUNTS)
    mesh.CreateFaceVertexIndicesAttr(CORNERS)
    mesh.CreateSubdivisionSchemeAttr("none")
    for number, frame in enumerate(points):
        code = Usd.TimeCode.Default() if len(points) == 1 else number + 1
        mesh.CreatePointsAttr().Set(Vt.Vec3fArray.FromNumpy(frame), code)
    return stage, mesh


def saved(stage):
    """Save a stage; return the path of its file."""
    stage.Save()
    return stage.GetRootLayer().realPath


def add_primvar(mesh, name, kind, values, interpolation, codes=None):
    """Add a primvar with a sample per time code."""
    declared = Sdf.ValueTypeNames.Find(f"{kind}[]")
    primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(name, declared, interpolation)
    array = getattr(Vt, declared.type.pythonClass.__name__)
    for code, value in zip(codes or range(1, len(values) + 1), values, strict=True):
        primvar.Set(array.FromNumpy(np.ascontiguousarray(value)), code)
    return primvar


def as_usd(values, dtype):
    return np.ascontiguousarray(values, dtype)


@pytest.mark.parametrize("interpolation", SIZES)
@pytest.mark.parametrize(
    ("kind", "dtype", "width", "name", "track_kind"),
    [
        ("float", "f4", 1, "stress", "scalar"),
        ("double", "f8", 1, "stress", "scalar"),
        ("int", "i4", 1, "id", "scalar"),
        ("int64", "i8", 1, "id", "scalar"),
        ("vector3f", "f4", 3, "flow", "vector"),
        ("color3f", "f4", 3, "displayColor", "color"),
        ("color4f", "f4", 4, "paint", "color"),
        ("texCoord2f", "f4", 2, "st", "uv"),
        ("float2", "f4", 2, "map1", "uv"),
    ],
)
def test_animated_primvars_become_tracks(
    tmp_path, read, interpolation, kind, dtype, width, name, track_kind
):
    stage, mesh = new_mesh(tmp_path / "a.usdc")
    shape = (4, SIZES[interpolation], width)
    values = (100 * RNG.random(shape)).astype(dtype)
    add_primvar(mesh, name, kind, values[..., 0] if width == 1 else values, interpolation)
    notes = []
    result = read(saved(stage), notes=notes)
    [(found_name, track)] = result.tracks.items()
    assert (found_name, track.kind, track.domain) == (name, track_kind, DOMAINS[interpolation])
    assert track.dtype == np.dtype(dtype)
    expected = srgb(values) if track_kind == "color" else values
    np.testing.assert_allclose(track.read(0, 4), expected, rtol=1e-6 * (track_kind == "color"))
    assert track.read(2, 3).tobytes() == track.read(0, 4)[2:3].tobytes()
    assert result.surface.attributes == ()
    assert [note for note in notes if "left out" in note] == []


def test_constant_primvars_become_attributes(tmp_path):
    stage, mesh = new_mesh(tmp_path / "a.usdc")
    uv = np.tile(RNG.random((8, 2)).astype(np.float32), (4, 1, 1))
    add_primvar(mesh, "st", "texCoord2f", uv, "faceVarying")
    add_primvar(mesh, "heat", "float", RNG.random((1, 6)).astype(np.float32), "vertex")
    loaded = load(saved(stage))
    assert loaded.tracks == {}
    assert [attribute.name for attribute in loaded.surface.attributes] == ["st", "heat"]


def test_indices_of_animated_primvars_are_applied(tmp_path):
    stage, mesh = new_mesh(tmp_path / "a.usdc")
    values = RNG.random((4, 3, 3)).astype(np.float32)
    primvar = add_primvar(mesh, "paint", "color3f", values, "vertex")
    rows = [[0, 1, 2, 2, 1, 0], [0, 0, 0, 1, 1, 2], [2, 2, 2, 2, 2, 2], [1, 0, 1, 0, 1, 0]]
    for code, indices in enumerate(rows):
        primvar.SetIndices(Vt.IntArray(indices), code + 1)
    stage.Save()
    expected = np.stack([value[row] for value, row in zip(values, rows, strict=True)])
    found = load(tmp_path / "a.usdc").tracks["paint"].values
    np.testing.assert_allclose(found, srgb(expected), rtol=1e-6)


def test_animated_constant_color_is_repeated_per_vertex(tmp_path):
    stage, mesh = new_mesh(tmp_path / "a.usdc")
    values = RNG.random((4, 1, 3)).astype(np.float32)
    add_primvar(mesh, "displayColor", "color3f", values, "constant")
    result = load(saved(stage)).tracks["displayColor"]
    np.testing.assert_allclose(result.values, srgb(np.repeat(values, 6, axis=1)), rtol=1e-6)


def test_animated_opacity_becomes_the_fourth_color_component(tmp_path):
    stage, mesh = new_mesh(tmp_path / "a.usdc")
    values = RNG.random((4, 6, 4)).astype(np.float32)
    add_primvar(mesh, "displayColor", "color3f", values[..., :3], "vertex")
    add_primvar(mesh, "displayOpacity", "float", values[..., 3], "vertex")
    [(name, track)] = load(saved(stage)).tracks.items()
    assert (name, track.kind) == ("displayColor", "color")
    np.testing.assert_allclose(track.values, srgb(values), rtol=1e-6)


def test_static_mesh_has_the_frames_of_its_animated_colors(tmp_path):
    stage, mesh = new_mesh(tmp_path / "a.usdc", POINTS[:1])
    values = RNG.random((5, 6, 3)).astype(np.float32)
    add_primvar(mesh, "displayColor", "color3f", values, "vertex")
    loaded = load(saved(stage))
    assert (loaded.n_frames, loaded.fps, loaded.start_s) == (5, 10, 0.1)
    np.testing.assert_allclose(loaded.tracks["displayColor"].values, srgb(values), rtol=1e-6)


def test_samples_without_a_frame_are_noted(tmp_path, notes):
    stage, mesh = new_mesh(tmp_path / "a.usdc")
    codes = [1, 2, 3, 4, 4.5, 6]
    add_primvar(mesh, "heat", "float", RNG.random((6, 6)).astype(np.float32), "vertex", codes)
    assert "heat" in load(saved(stage), notes=notes).tracks
    assert "left out: samples where positions have no frame: heat (2 of 6)" in notes


def test_values_are_nan_in_frames_where_they_do_not_fit(tmp_path, notes):
    stage, mesh = new_mesh(tmp_path / "a.usdc")
    add_primvar(mesh, "heat", "float", list(np.ones((3, 6), np.float32)), "vertex", [1, 2, 4])
    UsdGeom.PrimvarsAPI(mesh).GetPrimvar("heat").Set(Vt.FloatArray([1, 2]), 3)
    add_primvar(mesh, "bad", "float", RNG.random((4, 5)).astype(np.float32), "vertex")
    [(name, track)] = load(saved(stage), notes=notes).tracks.items()
    assert name == "heat"
    assert np.isnan(track[2]).all()
    assert not np.isnan(track.values[[0, 1, 3]]).any()
    assert "'heat' is in 3 of 4 frames, and NaN in the others" in notes
    assert "left out: primvars for a whole mesh, or that do not fit its faces: bad" in notes


@pytest.mark.parametrize("as_primvar", [False, True])
def test_normals_and_velocities_are_transformed_with_the_mesh(tmp_path, as_primvar, notes):
    stage, mesh = new_mesh(tmp_path / "a.usdc")
    matrix = Gf.Matrix4d(0, 2, 0, 0, -1, 0, 0, 0, 0, 0, 3, 0, 5, 6, 7, 1)
    UsdGeom.Xformable(mesh).AddTransformOp().Set(matrix)
    normals = RNG.normal(size=(4, 6, 3))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    velocities = RNG.normal(size=(4, 6, 3)).astype(np.float32)
    if as_primvar:
        add_primvar(mesh, "normals", "normal3f", normals.astype("f4"), "vertex")
    else:
        mesh.SetNormalsInterpolation("vertex")
    for code in range(4):
        if not as_primvar:
            one = as_usd(normals[code], "f4")
            mesh.CreateNormalsAttr().Set(Vt.Vec3fArray.FromNumpy(one), code + 1)
        mesh.CreateVelocitiesAttr().Set(Vt.Vec3fArray.FromNumpy(velocities[code]), code + 1)
    tracks = load(saved(stage), notes=notes).tracks
    linear = np.array(matrix)[:3, :3]
    expected = normals @ np.linalg.inv(linear).T
    expected /= np.linalg.norm(expected, axis=2, keepdims=True)
    assert (tracks["normals"].kind, tracks["velocities"].kind) == ("normal", "velocity")
    np.testing.assert_allclose(tracks["normals"].values, expected, atol=1e-6)
    np.testing.assert_allclose(tracks["velocities"].values, velocities @ linear, atol=1e-5)
    assert not any("normals" in note or "velocities" in note for note in notes)


def test_corner_tracks_follow_reversed_left_handed_faces(tmp_path):
    stage, mesh = new_mesh(tmp_path / "a.usdc")
    mesh.CreateOrientationAttr("leftHanded")
    corners = np.tile(np.array(CORNERS, np.int32), (4, 1))
    corners[1:] += 10 * np.arange(1, 4)[:, None]
    add_primvar(mesh, "corner", "int", corners, "faceVarying")
    loaded = load(saved(stage))
    quads = loaded.tracks["corner"].values[0, :, 0].reshape(2, 4)
    assert quads.tolist() == [[0, 3, 4, 1], [1, 4, 5, 2]]
    assert np.array_equal(loaded.faces[0], quads[0, :3])


def test_tracks_leave_out_holes(tmp_path):
    stage, mesh = new_mesh(tmp_path / "a.usdc")
    mesh.CreateHoleIndicesAttr([0])
    add_primvar(mesh, "area", "int", np.arange(8, dtype="i4").reshape(4, 2), "uniform")
    add_primvar(mesh, "mark", "int", np.arange(32, dtype="i4").reshape(4, 8), "faceVarying")
    tracks = load(saved(stage)).tracks
    assert tracks["area"].values[..., 0].tolist() == [[1], [3], [5], [7]]
    assert tracks["mark"].values[1, :, 0].tolist() == [12, 13, 14, 15]


def with_usd_types(sheet):
    """Return the sheet with tracks in number types of USD: float32 colors and velocities."""
    tracks = {}
    for name, track in sheet.tracks.items():
        values = track.values
        if track.kind == "color":
            values = (values / 255.0).astype(np.float32)
        if track.kind == "velocity" and track.domain is Domain.VERTEX:
            values = values.astype(np.float32)
        tracks[name] = Track(values, track.domain, track.kind, track.unit)
    return sheet.replace(tracks=tracks)


@pytest.mark.parametrize("extension", ["usda", "usdc", "usdz"])
@pytest.mark.parametrize("n_frames", [1, 5])
def test_tracks_round_trip_exactly(tmp_path, extension, n_frames, notes):
    sheet = with_usd_types(tracked_sheet(n_frames))
    save(sheet, tmp_path / f"x.{extension}", notes=notes)
    loaded = load(tmp_path / f"x.{extension}")
    assert np.array_equal(loaded.vertices, sheet.vertices.astype(np.float32))
    assert_same_tracks(loaded.tracks, sheet.tracks)
    assert not any("track" in note for note in notes)
    assert {attribute.name for attribute in loaded.surface.attributes} == {"st", "displayColor"}


def test_saved_tracks_are_normals_velocities_and_primvars_in_usd(tmp_path):
    sheet = quad_sheet(3).replace(surface=replace(quad_sheet(3).surface, attributes=()))
    n_verts = sheet.n_verts
    normals = RNG.normal(size=(3, n_verts, 3))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    colors = (RNG.integers(0, 256, (3, n_verts, 4)) / 255).astype(np.float32)
    speeds = RNG.normal(size=(3, n_verts, 3)).astype(np.float32)
    uv = RNG.random((3, n_verts, 2))
    tracks = {
        "N": Track(normals.astype(np.float32), kind="normal"),
        "Cd": Track(colors, kind="color"),
        "v": Track(speeds, kind="velocity", unit="m/s"),
        "map": Track(uv, kind="uv"),
        "stress": Track(RNG.random((3, n_verts)).astype(np.float32), unit="Pa"),
    }
    save(sheet.replace(tracks=tracks, start_s=0.0), tmp_path / "x.usdc")
    stage = Usd.Stage.Open(str(tmp_path / "x.usdc"))
    [prim] = [one for one in stage.Traverse() if one.IsA(UsdGeom.Mesh)]
    mesh, api = UsdGeom.Mesh(prim), UsdGeom.PrimvarsAPI(prim)
    assert mesh.GetNormalsInterpolation() == "vertex"
    assert mesh.GetVelocitiesAttr().GetTimeSamples() == [0, 1, 2]
    stress = api.GetPrimvar("stress")
    assert (stress.GetInterpolation(), stress.GetTypeName()) == ("vertex", "float[]")
    for code in range(3):
        assert np.array_equal(mesh.GetNormalsAttr().Get(code), tracks["N"][code])
        assert np.array_equal(mesh.GetVelocitiesAttr().Get(code), speeds[code])
        linear = np.asarray(api.GetPrimvar("displayColor").Get(code))
        np.testing.assert_allclose(srgb(linear), colors[code, :, :3], rtol=1e-5)
        assert np.array_equal(api.GetPrimvar("displayOpacity").Get(code), colors[code, :, 3])
        assert np.array_equal(api.GetPrimvar("st").Get(code), uv[code])
        assert np.array_equal(stress.Get(code), tracks["stress"][code][:, 0])
    assert_same_tracks(load(tmp_path / "x.usdc").tracks, tracks)


@pytest.mark.parametrize("n_frames", [1, 3])
def test_saved_tracks_pass_every_validator_of_usd(tmp_path, n_frames):
    sheet = tracked_sheet(n_frames)
    normals = np.tile(np.array([0.0, 0, 1], np.float32), (n_frames, sheet.n_verts, 1))
    tracks = {**sheet.tracks, "N": Track(normals, kind="normal")}
    save(sheet.replace(tracks=tracks), tmp_path / "x.usdc")
    assert_is_valid(tmp_path / "x.usdc")


@pytest.mark.parametrize(
    ("values", "kind", "written_as"),
    [
        (RNG.integers(0, 256, (2, 30, 3)).astype("u1"), "color", "float32, not uint8"),
        (RNG.normal(size=(2, 30, 3)), "velocity", "float32, not float64"),
        (RNG.integers(0, 9, (2, 30)).astype("i2"), "scalar", "int32, not int16"),
        (RNG.integers(0, 256, (2, 30, 3)).astype("i2"), "color", "int32, not int16"),
    ],
)
def test_conversions_of_number_types_are_noted(tmp_path, values, kind, written_as, notes):
    sheet = quad_sheet(2)
    surface = replace(sheet.surface, attributes=())
    save(
        sheet.replace(surface=surface, tracks={"x": Track(values, kind=kind)}),
        tmp_path / "x.usdc",
        notes=notes,
    )
    assert f"track 'x' is written as {written_as}" in notes
    scale = 255 if values.dtype == np.uint8 else 1
    result = load(tmp_path / "x.usdc").tracks["x"].values
    np.testing.assert_allclose(
        result, np.atleast_3d(values).reshape(result.shape) / scale, rtol=1e-6
    )
