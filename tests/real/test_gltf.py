"""A skinned walk as glTF against the same walk as other programs bake it."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.codec.surface.uv_errors import measure_uvs
from meshreel.formats.load import load
from samples.opening import open_source

pytestmark = pytest.mark.real

TOLERANCE = 1e-6
"""Of a model 1.5 high; all are float32, and positions differ by 7e-7 at most."""


@pytest.fixture(scope="module")
def folder():
    name = os.environ.get("MESHREEL_DATA")
    if not name:
        pytest.skip("MESHREEL_DATA names no folder of real sequences")
    return Path(name)


@pytest.fixture(scope="module")
def walk(folder):
    return load(folder / "native" / "cesium_man.glb")


def test_walk_has_the_frames_of_the_baked_one_when_its_axes_are_turned(folder, walk):
    baked = load(folder / "cesium_man.npz")  # z is up, in glTF it is y
    turned = baked.vertices[:, :, [0, 2, 1]] * [1, 1, -1]
    np.testing.assert_array_equal(walk.faces, baked.faces)
    np.testing.assert_allclose(walk.vertices, turned, rtol=0, atol=TOLERANCE)
    assert (walk.fps, walk.start_s) == (baked.fps, 1 / 24)


def test_walk_is_where_openusd_puts_it_when_it_comes_from_the_same_scene(folder, walk):
    usd, geom, skel, vt = (
        pytest.importorskip(f"pxr.{name}") for name in ("Usd", "UsdGeom", "UsdSkel", "Vt")
    )
    stage = usd.Stage.Open(str(folder / "native" / "cesium_man.usdz"))
    prims = {prim.GetTypeName(): prim for prim in stage.Traverse()}
    cache = skel.Cache()
    cache.Populate(skel.Root(prims["SkelRoot"]), usd.PrimDefaultPredicate)
    skeleton = cache.GetSkelQuery(skel.Skeleton(prims["Skeleton"]))
    mesh = geom.Mesh(prims["Mesh"])
    corners = np.array(mesh.GetFaceVertexIndicesAttr().Get())
    for frame in range(walk.n_frames):
        points = vt.Vec3fArray(mesh.GetPointsAttr().Get())
        transforms = skeleton.ComputeSkinningTransforms(frame + 1)
        assert cache.GetSkinningQuery(mesh.GetPrim()).ComputeSkinnedPoints(
            transforms, points, frame + 1
        )
        world = np.array(geom.XformCache(frame + 1).GetLocalToWorldTransform(prims["Skeleton"]))
        expected = np.array(points) @ world[:3, :3] + world[3, :3]
        found = walk.vertices[frame][walk.faces.ravel()]
        np.testing.assert_allclose(found, expected[corners], rtol=0, atol=TOLERANCE)


def test_walk_is_sampled_between_its_keys_when_fps_is_given(folder, walk):
    found = load(folder / "native" / "cesium_man.glb", fps=48)
    assert (found.n_frames, found.fps, found.start_s) == (95, 48, walk.start_s)
    np.testing.assert_array_equal(found.vertices[::2], walk.vertices)


def test_walk_is_read_bit_by_bit_when_it_stays_in_its_file(folder, walk):
    opened = open_source(folder / "native" / "cesium_man.glb", max_loaded_bytes=0)
    assert opened.read(0, walk.n_frames).tobytes() == walk.vertices.tobytes()
    assert opened.read(30, 31).tobytes() == walk.vertices[30:31].tobytes()


def test_walk_has_its_seams_at_corners_when_vertices_are_welded(folder, walk):
    notes = []
    load(folder / "native" / "cesium_man.glb", notes=notes)
    assert "welded 3273 vertices, split at seams, to 2338" in notes
    [uv] = walk.surface.attributes
    assert (uv.name, uv.domain, len(uv.values)) == ("uv", "corner", 2612)
    [materials] = walk.surface.groups
    assert materials.labels == ("Cesium_Man-effect",)


def test_walk_takes_a_third_less_when_its_texture_coordinates_are_texels(walk):
    bare = replace(walk, surface=walk.surface.without_materials())
    exact, texels = (meshreel.encode(bare, uv_bits=bits) for bits in (None, 12))
    bytes_of = [meshreel.info(data).budget_bytes["attribute"] for data in (exact, texels)]
    assert bytes_of[1] < 0.45 * bytes_of[0]
    assert len(texels) < 0.7 * len(exact)
    assert measure_uvs(walk, texels).texels <= 0.5


def test_walk_is_shaded_within_5_degrees_when_it_is_written_by_default(walk, tmp_path):
    notes = []
    meshreel.save(walk, tmp_path / "walk.glb", notes=notes)
    (said,) = (note.split() for note in notes if note.startswith("normals are smooth"))
    assert float(said[said.index("degrees") - 1]) < 5
