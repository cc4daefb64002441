"""Round trips of sequences through USD files, and the names in them."""

import zipfile

import numpy as np
import pytest
from pxr import Usd, UsdGeom

import meshreel
from meshreel.errors import FormatError
from meshreel.formats.load import load
from meshreel.formats.scenes.parts import unique_name
from meshreel.formats.usd.material_writing import prim_name
from meshreel.formats.usd.writing import mesh_paths
from meshreel.kernel.polygons import triangulate
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Part, Surface
from meshreel.operations.save import save
from samples.opening import open_source
from samples.usd import assert_is_valid

EXTENSIONS = ["usd", "usda", "usdc", "usdz"]
# A quad, a triangle and a pentagon of nine vertices.
SIZES = np.array([4, 3, 5], np.int32)
CORNERS = np.array([0, 1, 4, 3, 1, 2, 4, 3, 4, 5, 8, 7], np.int32)


def sheets(n_frames=4, dtype=np.float32, *, fps=24.0, start_s=0.0, n_parts=2, offset=0.0):
    """Return a sequence of polygons, in parts, with attributes of every kind and domain."""
    rng = np.random.default_rng(5)
    vertices = (rng.normal(size=(n_frames, 9 * n_parts, 3)) + offset).astype(dtype)
    sizes = np.tile(SIZES, n_parts)
    corners = np.concatenate([CORNERS + 9 * k for k in range(n_parts)])
    n_faces, n_corners = 3 * n_parts, 12 * n_parts
    uv = rng.random((7 * n_parts, 2), np.float32)
    rows = np.concatenate(
        [np.concatenate([np.arange(7), rng.integers(0, 7, 5)]) + 7 * k for k in range(n_parts)]
    )
    numbers = np.tile([0, 1, -1], n_parts)
    surface = Surface(
        sizes,
        (
            Attribute("st", Kind.UV, Domain.CORNER, uv, rows.astype(np.int32)),
            Attribute("uv 2", Kind.UV, Domain.VERTEX, rng.random((9 * n_parts, 2))),
            Attribute(
                "displayColor", Kind.COLOR, Domain.VERTEX, rng.random((9 * n_parts, 4), np.float32)
            ),
            Attribute("paint", Kind.COLOR, Domain.FACE, rng.random((n_faces, 3), np.float32)),
            Attribute("heat", Kind.OTHER, Domain.FACE, rng.random((n_faces, 1), np.float32)),
            Attribute(
                "tag", Kind.OTHER, Domain.CORNER, rng.integers(0, 9, (n_corners, 2), np.int32)
            ),
            Attribute(
                "bits", Kind.OTHER, Domain.VERTEX, np.arange(9 * n_parts, dtype="u1")[:, None]
            ),
            Attribute("wide", Kind.OTHER, Domain.FACE, rng.random((n_faces, 16))),
        ),
        (
            FaceGroups("material", ("red", "grün und blau"), numbers),
            FaceGroups("side", ("left", "right"), np.tile([1, 0, 1], n_parts)),
        ),
        (Part("/root/a", 9, 3), Part("/root/b/c", 9, 3))[:n_parts] if n_parts > 1 else (),
    )
    return MeshSequence(
        vertices, triangulate(sizes, corners, vertices[0])[0], fps, "sheets", start_s, surface
    )


def assert_same_attributes(found, expected):
    for one, other in zip(found.attributes, expected.attributes, strict=True):
        assert (one.kind, one.domain) == (other.kind, other.domain)
        assert one.values.dtype == other.values.dtype
        np.testing.assert_array_equal(one.values, other.values)
        assert (one.indices is None) == (other.indices is None)
        np.testing.assert_array_equal(one.per_item(), other.per_item())


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_sequence_round_trips(tmp_path, extension, notes):
    expected = sheets(start_s=1001 / 24)
    meshreel.save(expected, tmp_path / f"x.{extension}", notes=notes)
    loaded = meshreel.load(tmp_path / f"x.{extension}", merge=True)
    assert notes == []
    assert [path.name for path in tmp_path.iterdir()] == [f"x.{extension}"]
    assert loaded.dtype == np.float32
    np.testing.assert_array_equal(loaded.vertices, expected.vertices)
    np.testing.assert_array_equal(loaded.faces, expected.faces)
    np.testing.assert_array_equal(loaded.surface.face_sizes, expected.surface.face_sizes)
    assert loaded.surface.parts == expected.surface.parts
    assert (loaded.fps, loaded.start_s) == (24.0, 1001 / 24)
    names = ["st", "uv_2", "displayColor", "paint", "heat", "tag", "bits", "wide"]
    by_name = {attribute.name: attribute for attribute in loaded.surface.attributes}
    reordered = Surface(None, tuple(by_name[name] for name in names))
    assert len(loaded.surface.attributes) == len(names)
    assert_same_attributes(reordered, expected.surface)
    for one, other in zip(loaded.surface.groups, expected.surface.groups, strict=True):
        assert (one.name, one.labels) == (other.name, other.labels)
        np.testing.assert_array_equal(one.numbers, other.numbers)


@pytest.mark.parametrize("fps", [1.0, 12.5, 23.976, 24000 / 1001, 25.0, 29.97, 30000 / 1001, 60.0])
@pytest.mark.parametrize("first", [0, 1, 1001, -24, 100_000])
def test_frame_rate_and_start_round_trip(tmp_path, fps, first):
    expected = sheets(3, n_parts=1, fps=fps, start_s=first / fps)
    save(expected, tmp_path / "x.usdc")
    stage = Usd.Stage.Open(str(tmp_path / "x.usdc"))
    codes = UsdGeom.Mesh(stage.GetPrimAtPath("/sheets/sheets")).GetPointsAttr().GetTimeSamples()
    assert codes == [first, first + 1, first + 2]
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (first, first + 2)
    assert (stage.GetTimeCodesPerSecond(), stage.GetFramesPerSecond()) == (fps, fps)
    loaded = load(tmp_path / "x.usdc")
    assert (loaded.fps, loaded.start_s) == (fps, first / fps)


def test_save_converts_byte_colors_to_linear_floats(tmp_path, notes):
    rgb = np.array([[0, 128, 255]] * 9, np.uint8)
    surface = Surface(SIZES, (Attribute("color", Kind.COLOR, Domain.VERTEX, rgb),))
    sheet = sheets(n_parts=1)
    save(
        MeshSequence(sheet.vertices, sheet.faces, 24.0, surface=surface),
        tmp_path / "x.usda",
        notes=notes,
    )
    (result,) = load(tmp_path / "x.usda").surface.attributes
    assert (result.name, result.values.dtype) == ("displayColor", np.float32)
    np.testing.assert_array_equal(result.values, rgb.astype(np.float32) / np.float32(255))
    stage = Usd.Stage.Open(str(tmp_path / "x.usda"))
    [prim] = [one for one in stage.Traverse() if one.IsA(UsdGeom.Mesh)]
    written = UsdGeom.PrimvarsAPI(prim).GetPrimvar("displayColor").Get()[0]
    np.testing.assert_allclose(written, [0, 0.2158605, 1], rtol=1e-6)
    assert notes == []


def test_save_binds_a_single_material_to_the_mesh(tmp_path):
    sheet = sheets(n_parts=1)
    groups = FaceGroups("material", ("skin",), np.zeros(3, np.int32))
    save(
        MeshSequence(sheet.vertices, sheet.faces, 24.0, surface=Surface(SIZES, (), (groups,))),
        tmp_path / "x.usda",
    )
    stage = Usd.Stage.Open(str(tmp_path / "x.usda"))
    assert not [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Subset)]
    (result,) = load(tmp_path / "x.usda").surface.groups
    assert (result.name, result.labels) == ("material", ("skin",))
    np.testing.assert_array_equal(result.numbers, [0, 0, 0])


def test_saved_stage_declares_axes_units_and_extents(tmp_path):
    expected = sheets()
    save(expected, tmp_path / "x.usdc")
    stage = Usd.Stage.Open(str(tmp_path / "x.usdc"))
    assert str(stage.GetDefaultPrim().GetPath()) == "/root"
    assert UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.y
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/root/b/c"))
    assert mesh.GetSubdivisionSchemeAttr().Get() == "none"
    points, extent = mesh.GetPointsAttr(), mesh.GetExtentAttr()
    assert points.GetTimeSamples() == extent.GetTimeSamples() == [0, 1, 2, 3]
    for code in range(4):
        low, high = np.asarray(extent.Get(code))
        np.testing.assert_array_equal(low, np.asarray(points.Get(code)).min(axis=0))
        np.testing.assert_array_equal(high, np.asarray(points.Get(code)).max(axis=0))


@pytest.mark.parametrize("extension", EXTENSIONS)
@pytest.mark.parametrize("n_frames", [1, 3])
def test_saved_files_pass_every_validator_of_usd(tmp_path, extension, n_frames):
    save(sheets(n_frames, dtype=np.float64, offset=1e9), tmp_path / f"x.{extension}")
    assert_is_valid(tmp_path / f"x.{extension}")


def test_package_contains_one_binary_layer(tmp_path):
    save(sheets(), tmp_path / "x.usdz")
    with zipfile.ZipFile(tmp_path / "x.usdz") as package:
        (info,) = package.infolist()
    assert (info.filename, info.compress_type) == ("sheets.usdc", zipfile.ZIP_STORED)


def test_save_replaces_an_open_file(tmp_path):
    save(sheets(3, n_parts=1), tmp_path / "x.usdc")
    source = open_source(tmp_path / "x.usdc")
    before = source.read(0, 3).copy()
    save(sheets(5, n_parts=1, offset=1.0), tmp_path / "x.usdc", overwrite=True)
    assert load(tmp_path / "x.usdc").n_frames == 5
    assert before.shape[0] == 3


@pytest.mark.slow
def test_save_writes_long_sequences_in_pieces(tmp_path, monkeypatch):
    monkeypatch.setattr("meshreel.formats.usd.writing.UNSAVED_BYTES", 1000)
    expected = sheets(40)
    for extension in EXTENSIONS:
        save(expected, tmp_path / f"x.{extension}")
        loaded = load(tmp_path / f"x.{extension}", merge=True)
        np.testing.assert_array_equal(loaded.vertices, expected.vertices)


def test_save_leaves_out_parts_without_faces(tmp_path, notes):
    sheet = sheets(n_parts=1)
    vertices = np.concatenate([sheet.vertices, sheet.vertices[:, :2]], axis=1)
    surface = Surface(SIZES, parts=(Part("a", 9, 3), Part("b", 2, 0)))
    save(
        MeshSequence(vertices, sheet.faces, 24.0, surface=surface), tmp_path / "x.usdc", notes=notes
    )
    np.testing.assert_array_equal(load(tmp_path / "x.usdc").vertices, sheet.vertices)
    assert notes == ["part b is left out, since it is empty"]


def test_errors_of_usd_name_the_file(tmp_path, monkeypatch, capfd):
    def fail(*_, **__):
        from pxr import Tf

        Tf.RaiseRuntimeError("the disk is full")

    monkeypatch.setattr("meshreel.formats.usd.rigged.write_frames", fail)
    with pytest.raises(FormatError, match=r"USD cannot write x\.usdc: .*the disk is full"):
        save(sheets(), tmp_path / "x.usdc")
    assert capfd.readouterr().err == ""
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "expected"),
    [("body", "body"), ("arm.L", "arm_L"), ("3d", "_3d"), ("", "mesh"), ("a b:c", "a_b_c")],
)
def test_prim_name_replaces_forbidden_characters(name, expected):
    assert prim_name(name) == expected


def test_unique_name_appends_numbers():
    used = set()
    names = [unique_name(name, used) for name in ("a", "a", "a_2", "a")]
    assert names == ["a", "a_2", "a_2_2", "a_3"]


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["grid"], ["/scene/grid"]),
        (["/root/a", "/root/b/c"], ["/root/a", "/root/b/c"]),
        (["/a/x", "/b/x"], ["/scene/a/x", "/scene/b/x"]),
        (["a", "a"], ["/scene/a", "/scene/a_2"]),
        (["/r/a", "/r/a/b", "/r/a"], ["/r/a/a", "/r/a/b", "/r/a/a_2"]),
        (["/r/a/a", "/r/a"], ["/r/a/a", "/r/a/a_2"]),
        (["/r/a b", "/r/a_b"], ["/r/a_b", "/r/a_b_2"]),
        (["", "/"], ["/scene/mesh", "/scene/mesh_2"]),
    ],
)
def test_mesh_paths_are_unique_and_below_one_root(names, expected):
    assert mesh_paths(names, "scene") == expected
