"""USD files of other programs match baked frames, or those computed by USD."""

import math

import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.load import load

pytestmark = pytest.mark.real

UNITS_IN_THE_LAST_PLACE = 8
"""Of the largest coordinate in float32; baking added in another order."""


@pytest.fixture(scope="module")
def walk(data):
    return load(data / "native" / "cesium_man.usdz")


def test_skeletal_animation_matches_the_baked_walk(data, walk):
    baked = load(data / "cesium_man.npz")
    # The baked walk has z up and welded vertices, at time codes 1 to 48.
    rotated = np.stack([walk.vertices[..., 0], -walk.vertices[..., 2], walk.vertices[..., 1]], -1)
    error = np.abs(rotated[:, walk.faces] - baked.vertices[:, baked.faces]).max()
    assert error <= UNITS_IN_THE_LAST_PLACE * np.spacing(np.float32(1))
    assert (walk.fps, walk.start_s, walk.n_frames) == (24.0, 1 / 24, 48)
    assert [attribute.name for attribute in walk.surface.attributes] == ["st"]
    assert walk.surface.groups[0].labels == ("Cesium_Man_effect",)


def placed_by_usd(path, mesh, codes):
    """Return the points of a rigid mesh in world space at time codes, computed by USD."""
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(path))
    prim = stage.GetPrimAtPath(mesh)
    points = np.asarray(UsdGeom.Mesh(prim).GetPointsAttr().Get(), np.float64)
    worlds = [
        np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(code)) for code in codes
    ]
    return np.stack([points @ world[:3, :3] + world[3, :3] for world in worlds])


@pytest.mark.parametrize(
    ("name", "mesh", "n_frames"),
    [
        ("AnimatedTriangle.usdz", "/AnimatedTriangle/Geom/node_0", 25),
        ("BoxAnimated.usdz", "/BoxAnimated/Geom/node_0/node_1/node_2", 90),
    ],
)
@pytest.mark.parametrize("fps", [None, 48, 10])
def test_rotation_between_distant_keys_matches_usd(existing, name, mesh, n_frames, fps):
    path = existing(f"native/odd/{name}")
    loaded = load(path, object=mesh, fps=fps)
    rate = fps or 24
    expected_frames = math.ceil((n_frames - 1) * rate / 24) + 1  # the last shows the final key
    assert (loaded.n_frames, loaded.fps) == (expected_frames, rate)
    expected = placed_by_usd(path, mesh, np.arange(loaded.n_frames) * 24 / rate)
    size = np.ptp(expected, axis=(0, 1)).max()
    np.testing.assert_allclose(loaded.vertices, expected, rtol=0, atol=2e-7 * size)


def test_a_unit_stored_as_float_is_read(existing):
    from pxr import Usd, UsdGeom

    path, notes = existing("native/odd/suzanne.usdc"), []
    loaded = load(path, notes=notes)
    stage = Usd.Stage.Open(str(path))
    points = UsdGeom.Mesh(stage.GetPrimAtPath("/Suzanne/Suzanne")).GetPointsAttr().Get()
    np.testing.assert_array_equal(loaded.vertices[0], np.asarray(points))
    assert any("z points up" in note and "a unit is" not in note for note in notes)


def test_the_error_names_a_mesh_that_is_empty_in_its_first_frame(existing):
    path = existing("native/odd/color_opacity_primvar.usda")
    with pytest.raises(FormatError, match="EmptyColorNoOpacity has 0 vertices and 1 face"):
        load(path, merge=True)


def test_a_rate_of_zero_is_refused_before_the_library_hangs(existing):
    with pytest.raises(FormatError, match="has 0 as timeCodesPerSecond; expected"):
        load(existing("native/odd/timeCodesPerSecond_0.usda"))


@pytest.mark.parametrize(
    ("name", "mesh", "n_faces"),
    [("pyramid.usda", "/Pyramid/geo/shape", 24), ("CubeWithHoles.usda", "/Cube/Geom/Cube", 8)],
)
def test_holes_of_a_mesh_stay_open(existing, name, mesh, n_faces):
    from pxr import Usd, UsdGeom

    path, notes = existing(f"native/odd/{name}"), []
    loaded = load(path, notes=notes)
    stage = Usd.Stage.Open(str(path))
    prim = UsdGeom.Mesh(stage.GetPrimAtPath(mesh))
    counts = np.asarray(prim.GetFaceVertexCountsAttr().Get())
    solid = np.setdiff1d(np.arange(len(counts)), prim.GetHoleIndicesAttr().Get())
    assert len(loaded.faces) == (counts[solid] - 2).sum() == n_faces
    np.testing.assert_array_equal(loaded.surface.face_sizes, counts[solid])
    assert f"left out: subdivision, whose cages are read: {mesh}" in notes
