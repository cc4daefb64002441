"""A skinned glTF walk matches the same walk baked by other programs."""

import numpy as np
import pytest

import meshreel
from meshreel.codec.achieved import measure_uvs
from meshreel.formats.load import load

pytestmark = pytest.mark.real

TOLERANCE = 1e-6
"""The model is 1.5 high; positions in float32 differ by at most 7e-7."""


@pytest.fixture(scope="module")
def walk(data):
    return load(data / "native" / "cesium_man.glb")


def test_walk_matches_the_baked_frames(data, walk):
    baked = load(data / "cesium_man.npz")  # z is up, in glTF it is y
    rotated = baked.vertices[:, :, [0, 2, 1]] * [1, 1, -1]
    np.testing.assert_array_equal(walk.faces, baked.faces)
    np.testing.assert_allclose(walk.vertices, rotated, rtol=0, atol=TOLERANCE)
    assert (walk.fps, walk.start_s) == (baked.fps, 1 / 24)


def test_walk_matches_openusd_skinning(data, walk):
    usd, geom, skel, vt = (
        pytest.importorskip(f"pxr.{name}") for name in ("Usd", "UsdGeom", "UsdSkel", "Vt")
    )
    stage = usd.Stage.Open(str(data / "native" / "cesium_man.usdz"))
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
        result = walk.vertices[frame][walk.faces.ravel()]
        np.testing.assert_allclose(result, expected[corners], rtol=0, atol=TOLERANCE)


def test_welded_vertices_keep_seams_at_corners(data, walk):
    notes = []
    load(data / "native" / "cesium_man.glb", notes=notes)
    assert "welded 3273 vertices, split at seams, to 2338" in notes
    [uv] = walk.surface.attributes
    assert (uv.name, uv.domain, len(uv.values)) == ("uv", "corner", 2612)
    [materials] = walk.surface.groups
    assert materials.labels == ("Cesium_Man-effect",)


def test_rounding_uvs_to_texels_saves_a_third(walk):
    bare = walk.replace(surface=walk.surface.without_materials())
    exact, texels = (meshreel.encode(bare, uv_bits=bits) for bits in (None, 12))
    budgets = [meshreel.info(data).budget_bytes.items() for data in (exact, texels)]
    bytes_of = [sum(size for name, size in one if name.startswith("attribute")) for one in budgets]
    assert bytes_of[1] < 0.45 * bytes_of[0]
    assert len(texels) < 0.7 * len(exact)
    assert measure_uvs(walk, texels) * 4096 <= 0.5


def test_default_glb_normals_are_within_5_degrees(walk, tmp_path):
    notes = []
    meshreel.save(walk, tmp_path / "walk.glb", notes=notes)
    (words,) = (note.split() for note in notes if note.startswith("normals are smooth"))
    assert float(words[words.index("degrees") - 1]) < 5
