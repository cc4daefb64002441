"""Skinned meshes of USD files, compared with linear blend skinning written out here."""

import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.load import load
from samples.usd import RIGID

REST = np.array([[0, 0, 0], [1, 0, 0], [1, 2, 0], [0, 2, 0]], np.float64)
UPPER = np.array([0, 0.25, 1, 0.5])  # weights of the upper joint

STAGE = """#usda 1.0
(
    timeCodesPerSecond = 24
    {header}
)
def SkelRoot "root" {{
    double3 xformOp:translate = (0, 0, 10)
    uniform token[] xformOpOrder = ["xformOp:translate"]

    def Skeleton "skeleton" (prepend apiSchemas = ["SkelBindingAPI"]) {{
        uniform token[] joints = ["low", "low/high"]
        uniform matrix4d[] bindTransforms = [
            ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)),
            ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 1, 0, 1)),
        ]
        uniform matrix4d[] restTransforms = [
            ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)),
            ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 1, 0, 1)),
        ]
        rel skel:animationSource = </root/motion>
    }}
    def SkelAnimation "motion" {{
        uniform token[] joints = ["low", "low/high"]
        quatf[] rotations = [(1, 0, 0, 0), (1, 0, 0, 0)]
        half3[] scales = [(1, 1, 1), (1, 1, 1)]
        float3[] translations.timeSamples = {{
            {first}: [(0, 0, 0), (0, 1, 0)],
            {last}: [(0, 0, 0), (4, 1, 0)],
        }}
        uniform token[] blendShapes = ["other", "bulge"]
        float[] blendShapeWeights.timeSamples = {{ {first}: [0, 0], {last}: [0, 1] }}
    }}
    def Mesh "m" (prepend apiSchemas = ["SkelBindingAPI"]) {{
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 2, 0), (0, 2, 0)]
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        rel skel:skeleton = </root/skeleton>
        {binding}
    }}
}}
{more}
"""
# The mesh lists its joints in another order, and has a bind transform.
JOINTS = """
    uniform token[] skel:joints = ["low/high", "low"]
    matrix4d primvars:skel:geomBindTransform = ( (1, 0, 0, 0), (0, 1, 0, 0),
        (0, 0, 1, 0), (3, 0, 0, 1) )
    int[] primvars:skel:jointIndices = [1, 0, 1, 0, 0, 1, 1, 0] (
        elementSize = 2
        interpolation = "vertex"
    )
    float[] primvars:skel:jointWeights = [1, 0, 0.75, 0.25, 1, 0, 0.5, 0.5] (
        elementSize = 2
        interpolation = "vertex"
    )
"""
SHAPES = """
    uniform token[] skel:blendShapes = ["bulge"]
    rel skel:blendShapeTargets = </root/m/bulge>
    def BlendShape "bulge" {
        uniform vector3f[] offsets = [(0, 0, 8)]
        uniform int[] pointIndices = [2]
        uniform vector3f[] inbetweens:half = [(0, 0, 2)] (weight = 0.5)
    }
"""
PROP = """def Mesh "prop" {
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0)]
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    double3 xformOp:translate.timeSamples = { 1: (0, 0, 0), 5: (4, 0, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}"""


@pytest.fixture
def skinned_file(tmp_path):
    def write(binding, *, header="", first=1, last=5, more=""):
        path = tmp_path / "skinned.usda"
        path.write_text(
            STAGE.format(binding=binding, header=header, first=first, last=last, more=more)
        )
        return path

    return write


def posed(progress):
    """Return the points at a fraction of the motion, by linear blend skinning."""
    return REST + np.array([3, 0, 10]) + np.outer(UPPER, [4 * progress, 0, 0])


def bulged(weight):
    """Return the offsets of the blend shape, with an inbetween at half the weight."""
    offset = np.zeros((4, 3))
    offset[2, 2] = 4 * weight if weight <= 0.5 else 2 + 12 * (weight - 0.5)
    return offset


def test_load_skins_at_every_frame_between_keys(skinned_file, notes):
    normals = f"{{ 1: {4 * [(0, 0, 1)]}, 5: {4 * [(1, 0, 0)]} }}"
    loaded = load(skinned_file(f"{JOINTS} normal3f[] normals.timeSamples = {normals}"), notes=notes)
    assert not loaded.tracks  # skinning does not deform normals
    assert (loaded.fps, loaded.start_s, loaded.vertices.dtype) == (24.0, 1 / 24, np.float32)
    np.testing.assert_array_equal(loaded.vertices, [posed(s) for s in (0, 0.25, 0.5, 0.75, 1)])
    assert any("2 samples" in note and "5 frames" in note for note in notes)


STEPS = (0, 0.25, 0.5, 0.75, 1)


@pytest.mark.parametrize(
    ("binding", "expected"),
    [
        (JOINTS + SHAPES, [posed(step) + bulged(step) for step in STEPS]),
        (SHAPES, [REST + np.array([0, 0, 10]) + bulged(step) for step in STEPS]),
        (RIGID % 1, [REST + np.array([4 * step, 0, 10]) for step in STEPS]),
    ],
    ids=["shapes before joints", "shapes alone", "constant weights"],
)
def test_load_applies_blend_shapes_and_constant_weights(skinned_file, binding, expected):
    np.testing.assert_array_equal(load(skinned_file(binding)).vertices, expected)


def test_load_samples_skinning_at_the_requested_rate(skinned_file):
    loaded = load(skinned_file(JOINTS), fps=48)
    assert (loaded.fps, loaded.start_s) == (48, 1 / 24)
    np.testing.assert_array_equal(loaded.vertices, [posed(s / 8) for s in range(9)])


def test_load_samples_all_meshes_alike_if_one_is_skinned(skinned_file):
    loaded = load(skinned_file(JOINTS, more=PROP), fps=12, merge=True)
    assert (loaded.n_frames, loaded.fps) == (3, 12)
    np.testing.assert_array_equal(loaded.vertices[:, :4], [posed(s) for s in (0, 0.5, 1)])
    np.testing.assert_array_equal(loaded.vertices[:, 4, 0], [0, 2, 4])


def test_load_uses_the_frame_rate_of_the_stage_for_finer_time_codes(skinned_file):
    header = "framesPerSecond = 12"
    loaded = load(skinned_file(JOINTS, header=header))
    assert (loaded.fps, loaded.n_frames) == (12.0, 3)


def test_load_uses_the_rest_pose_of_a_skeleton_without_animation(skinned_file):
    path = skinned_file(JOINTS)
    path.write_text(path.read_text().replace("rel skel:animationSource", "rel other"))
    loaded = load(path)
    np.testing.assert_array_equal(loaded.vertices, posed(0)[None])


def test_load_skins_every_instance_of_a_skinned_model(skinned_file, tmp_path):
    skinned_file(JOINTS + SHAPES)
    copies = [
        f"""def "copy{k}" (
            instanceable = true
            references = @skinned.usda@</root> (offset = {10 * k})
        ) {{
            double3 xformOp:translate = ({k}, 0, 10)
        }}"""
        for k in range(2)
    ]
    (tmp_path / "x.usda").write_text("#usda 1.0\n" + "\n".join(copies))
    for k in range(2):
        loaded = load(tmp_path / "x.usda", object=f"/copy{k}/m")
        expected = [posed(s) + bulged(s) + np.array([k, 0, 0]) for s in (0, 0.25, 0.5, 0.75, 1)]
        np.testing.assert_array_equal(loaded.vertices, expected)
        assert loaded.start_s == (1 + 10 * k) / 24


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("[1, 0, 1, 0, 0, 1, 1, 0]", "[1, 0, 1, 0]"),
        ("[1, 0, 1, 0, 0, 1, 1, 0]", "[1, 0, 1, 0, 0, 1, 1, 9]"),
        ("[(0, 0, 8)]", "[(0, 0, 8), (0, 0, 1)]"),
        ("pointIndices = [2]", "pointIndices = [9]"),
    ],
)
def test_load_rejects_mismatched_weights_and_shapes(skinned_file, capfd, old, new):
    path = skinned_file(JOINTS + SHAPES)
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(FormatError, match=r"mesh /root/m .* weights or blend shapes"):
        load(path)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    ("last", "message"), [(1e8, "the limit is 1000000"), (1e300, "expected -")]
)
def test_load_rejects_a_skeleton_with_too_many_frames(skinned_file, last, message):
    with pytest.raises(FormatError, match=message):
        load(skinned_file(JOINTS, last=last))
