"""Point instancers of USD, whose instances are baked, compared with matrices written out here."""

import numpy as np
import pytest

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.inspection import inspect_source
from meshreel.formats.load import load
from meshreel.formats.options import ReadOptions
from meshreel.model.surface import Domain
from samples import usd
from samples.opening import open_same_faces

pytest.importorskip("pxr")

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 2, 0], [0, 2, 3]], np.float64)
CORNERS = [[0, 1, 2], [0, 2, 3]]
ROTATION = (0.5, 0.5, 0.5, 0.5)
"""Quaternion w, x, y, z of 120 degrees about (1, 1, 1): x becomes y, y becomes z, z becomes x."""


def points(rows=POINTS):
    return f"point3f[] points = {[tuple(row) for row in np.asarray(rows).tolist()]}"


def mesh(more="", name="m", stored=None):
    return usd.mesh(more, name=name, points=points() if stored is None else stored)


def translated(translate, name="xform", body="", more=""):
    return (
        f'def Xform "{name}" {{\ndouble3 xformOp:translate = {translate}\n'
        f'uniform token[] xformOpOrder = ["xformOp:translate"]\n{more}\n{body}}}\n'
    )


def instancer(arrays, body, prototypes=("/many/m",), name="many", metadata=""):
    targets = ", ".join(f"<{path}>" for path in prototypes)
    return (
        f'def PointInstancer "{name}" ({metadata}) {{\n{arrays}\n'
        f"rel prototypes = [{targets}]\n{body}}}\n"
    )


def translated_copies(*offsets, of=POINTS):
    return np.concatenate([of + np.asarray(offset, np.float64) for offset in offsets])


THREE = "int[] protoIndices = [0, 0, 0]\npoint3f[] positions = [(0, 0, 0), (5, 0, 0), (0, 7, 0)]"
OFFSETS = (0, 0, 0), (5, 0, 0), (0, 7, 0)


def test_load_bakes_the_instances_of_a_prototype_mesh(stage_file):
    notes = []
    found = load(stage_file(instancer(THREE, mesh())), notes=notes)
    assert (found.name, found.n_frames, found.dtype) == ("m", 1, np.float32)
    np.testing.assert_allclose(found.vertices[0], translated_copies(*OFFSETS), atol=1e-6)
    expected = [[corner + 4 * number for corner in face] for number in range(3) for face in CORNERS]
    assert found.faces.tolist() == expected
    assert notes[0] == "baked 3 instances into one mesh per prototype mesh"


@pytest.mark.parametrize("kind", ["quath[] orientations", "quatf[] orientationsf"])
def test_load_rotates_scales_and_translates_instances(stage_file, kind):
    arrays = (
        f"int[] protoIndices = [0, 0]\npoint3f[] positions = [(1, 2, 3), (4, 5, 6)]\n"
        f"{kind} = [(1, 0, 0, 0), {ROTATION}]\nfloat3[] scales = [(1, 1, 1), (2, 3, 4)]"
    )
    body = translated((0, 0, 50), "place", instancer(arrays, mesh(), ["/place/many/m"]))
    found = load(stage_file(body))
    rotated = np.roll(POINTS * [2, 3, 4], 1, axis=1)
    expected = np.concatenate([POINTS + np.array([1, 2, 53]), rotated + np.array([4, 5, 56])])
    np.testing.assert_allclose(found.vertices[0], expected, atol=1e-4)


def test_load_reverses_the_faces_of_mirrored_instances(stage_file):
    arrays = THREE + "\nfloat3[] scales = [(1, 1, 1), (-1, 1, 1), (-1, -1, 1)]"
    uv = (
        "texCoord2f[] primvars:st = [(0, 0), (1, 0), (2, 0), (3, 0)] "
        '(interpolation = "faceVarying")'
    )
    found = load(stage_file(instancer(arrays, mesh(uv))))
    assert found.faces.tolist() == [
        [0, 1, 2], [0, 2, 3], [4, 7, 6], [4, 6, 5], [8, 9, 10], [8, 10, 11],
    ]  # fmt: skip
    [attribute] = found.surface.attributes
    assert attribute.domain is Domain.CORNER
    rows = attribute.values[attribute.indices, 0].tolist()
    assert rows == [0, 1, 2, 3, 0, 3, 2, 1, 0, 1, 2, 3]


def test_load_reads_all_meshes_of_a_prototype_below_transforms(stage_file):
    inner = translated((0, 10, 0), "up", mesh(name="second"))
    root = translated((0, 0, 100), "root", mesh(name="first") + inner)
    path = stage_file(instancer(THREE, root, ["/many/root"]))
    with pytest.raises(InvalidInputError, match=r"/many/root/first, /many/root/up/second"):
        load(path)
    first, second = load(path, object="first"), load(path, object="second")
    np.testing.assert_allclose(
        first.vertices[0], translated_copies(*OFFSETS) + np.array([0, 0, 100]), atol=1e-4
    )
    np.testing.assert_allclose(
        second.vertices[0], translated_copies(*OFFSETS) + np.array([0, 10, 100]), atol=1e-4
    )
    assert load(path, merge=True).n_verts == 24


def test_load_assigns_instances_to_their_prototypes(stage_file):
    arrays = THREE.replace("[0, 0, 0]", "[1, 0, 1]")
    body = mesh() + mesh(name="n", stored=points(POINTS * 2)) + mesh(name="unused")
    notes = []
    path = stage_file(instancer(arrays, body, ["/many/m", "/many/n", "/many/unused"]))
    np.testing.assert_allclose(
        load(path, object="m", notes=notes).vertices[0], translated_copies(OFFSETS[1]), atol=1e-6
    )
    np.testing.assert_allclose(
        load(path, object="n").vertices[0],
        translated_copies(OFFSETS[0], OFFSETS[2], of=POINTS * 2),
        atol=1e-6,
    )
    assert "left out: 1 mesh of prototypes without a rendered instance" in notes


@pytest.mark.parametrize("specifier", ["over", "def"])
def test_load_finds_prototypes_outside_of_the_instancer(stage_file, specifier):
    library = f'{specifier} "Library" {{\n{mesh(name="tree")}}}\n'
    path = stage_file(library + instancer(THREE, "", ["/Library/tree"]))
    found = load(path, object="/many/Library/tree")
    np.testing.assert_allclose(found.vertices[0], translated_copies(*OFFSETS), atol=1e-6)
    n_meshes = len(inspect_source(path, ReadOptions()).meshes)
    assert n_meshes == (1 if specifier == "over" else 2)


def test_load_animates_instances_at_their_samples(stage_file):
    arrays = (
        "int[] protoIndices = [0, 0]\npoint3f[] positions.timeSamples = {\n"
        "0: [(0, 0, 0), (5, 0, 0)], 1: [(0, 0, 1), (5, 2, 0)], 2: [(0, 0, 4), (5, 4, 0)] }\n"
        f"quath[] orientations.timeSamples = {{ 1: [(1, 0, 0, 0), {ROTATION}] }}\n"
        "float3[] scales.timeSamples = { 0: [(1, 1, 1), (2, 2, 2)], 2: [(1, 1, 1), (4, 4, 4)] }"
    )
    found = load(stage_file(instancer(arrays, mesh())))
    assert (found.n_frames, found.fps) == (3, 24)
    rotated = np.roll(POINTS, 1, axis=1)
    for frame, (up, along, scale) in enumerate([(0, 0, 2), (1, 2, 3), (4, 4, 4)]):
        expected = np.concatenate(
            [POINTS + np.array([0, 0, up]), rotated * scale + np.array([5, along, 0])]
        )
        np.testing.assert_allclose(found.vertices[frame], expected, atol=2e-3)


def test_load_combines_animation_of_mesh_prototype_and_instancer(stage_file):
    def keyed(axis, end):
        row = [0, 0, 0]
        row[axis] = end
        return f"double3 xformOp:translate.timeSamples = {{ 0: (0, 0, 0), 2: {tuple(row)} }}\n"

    order = 'uniform token[] xformOpOrder = ["xformOp:translate"]\n'
    deforming = (
        "point3f[] points.timeSamples = {"
        + ", ".join(
            f"{code}: {[tuple(row) for row in (POINTS * (1 + code / 2)).tolist()]}"
            for code in range(3)
        )
        + "}"
    )
    body = f'def Xform "root" {{\n{keyed(1, 20)}{order}{mesh(stored=deforming)}}}\n'
    whole = instancer(keyed(2, 200) + order + THREE, body, ["/many/root"])
    found = load(stage_file(whole))
    assert found.n_frames == 3
    for frame in range(3):
        expected = translated_copies(*OFFSETS, of=POINTS * (1 + frame / 2)) + np.array(
            [0, 10 * frame, 100 * frame]
        )
        np.testing.assert_allclose(found.vertices[frame], expected, atol=1e-4)


def test_load_leaves_out_masked_instances(stage_file):
    arrays = THREE + "\nint64[] ids = [10, 20, 30]\nint64[] invisibleIds = [30]"
    notes = []
    path = stage_file(instancer(arrays, mesh(), metadata="inactiveIds = [10]"))
    np.testing.assert_allclose(
        load(path, notes=notes).vertices[0], translated_copies(OFFSETS[1]), atol=1e-6
    )
    assert notes[:2] == [
        "baked 1 instance into one mesh per prototype mesh",
        "left out: instances that are inactive or invisible: 2 of 3 of /many",
    ]


def test_load_rejects_masks_that_change_the_vertices_and_segments_separate_them(stage_file):
    path = stage_file(
        instancer(THREE + "\nint64[] invisibleIds.timeSamples = { 0: [], 1: [2] }", mesh())
    )
    with pytest.raises(InvalidInputError, match=r"frame 1 of /many/m has 8 vertices; expected 12"):
        open_same_faces(path)
    segments = load(path).segments
    assert [(segment.n_frames, segment.n_verts) for segment in segments] == [(1, 12), (1, 8)]


def test_load_notes_different_rendered_instances_of_equal_number(stage_file):
    notes = []
    arrays = THREE + "\nint64[] invisibleIds.timeSamples = { 0: [0], 1: [2] }"
    found = load(stage_file(instancer(arrays, mesh())), notes=notes)
    np.testing.assert_allclose(
        found.vertices[0], translated_copies(OFFSETS[1], OFFSETS[2]), atol=1e-6
    )
    np.testing.assert_allclose(
        found.vertices[1], translated_copies(OFFSETS[0], OFFSETS[1]), atol=1e-6
    )
    assert any("the rendered instances change over time: /many;" in note for note in notes)


def test_load_rejects_instances_that_change_their_prototype(stage_file):
    arrays = THREE.replace("[0, 0, 0]", "[0, 0, 1]", 1).replace(
        "int[] protoIndices = [0, 0, 1]",
        "int[] protoIndices.timeSamples = { 0: [0, 0, 1], 1: [0, 1, 1] }",
    )
    path = stage_file(instancer(arrays, mesh() + mesh(name="n"), ["/many/m", "/many/n"]))
    with pytest.raises(InvalidInputError, match=r"frame 1 of /many/m has 4 vertices; expected 8"):
        open_same_faces(path, object="m")


def test_load_bakes_an_instancer_within_a_prototype(stage_file):
    inner = instancer(
        "int[] protoIndices = [0, 0]\npoint3f[] positions = [(0, 0, 0), (0, 0, 1)]",
        mesh(), ["/many/root/inner/m"], "inner",
    )  # fmt: skip
    path = stage_file(instancer(THREE, translated((0, 0, 100), "root", inner), ["/many/root"]))
    found = load(path)
    pair = translated_copies((0, 0, 100), (0, 0, 101))
    np.testing.assert_allclose(found.vertices[0], translated_copies(*OFFSETS, of=pair), atol=1e-4)


@pytest.mark.parametrize("specifier", ["def", "over"])
def test_load_bakes_a_skinned_prototype(stage_file, specifier):
    skinned = """def SkelRoot "root" {
def Skeleton "skeleton" (prepend apiSchemas = ["SkelBindingAPI"]) {
    uniform token[] joints = ["a"]
    uniform matrix4d[] bindTransforms = [((1,0,0,0), (0,1,0,0), (0,0,1,0), (0,0,0,1))]
    uniform matrix4d[] restTransforms = [((1,0,0,0), (0,1,0,0), (0,0,1,0), (0,0,0,1))]
    rel skel:animationSource = <../animation>
}
def SkelAnimation "animation" {
    uniform token[] joints = ["a"]
    float3[] translations.timeSamples = { 0: [(0, 0, 0)], 2: [(0, 0, 8)] }
    quatf[] rotations = [(1, 0, 0, 0)]
    half3[] scales = [(1, 1, 1)]
}
%s
}
"""
    binding = f"rel skel:skeleton = <../skeleton>\n{usd.RIGID % 0}"
    bound = mesh(binding).replace('"m"', '"m" (prepend apiSchemas = ["SkelBindingAPI"])')
    body = f'{specifier} "Library" {{\n{skinned % bound}}}\n'
    path = stage_file(body + instancer(THREE, "", ["/Library/root"]))
    found = load(path, object="/many/Library/root/m")
    assert found.n_frames == 3
    for frame in range(3):
        expected = translated_copies(*OFFSETS) + np.array([0, 0, 4 * frame])
        np.testing.assert_allclose(found.vertices[frame], expected, atol=1e-5)


def test_tracks_are_repeated_and_rotated_with_instances(stage_file):
    arrays = (
        "int[] protoIndices = [0, 0]\npoint3f[] positions = [(0, 0, 0), (5, 0, 0)]\n"
        f"quath[] orientations = [(1, 0, 0, 0), {ROTATION}]"
    )
    more = """float[] primvars:heat ( interpolation = "uniform" )
float[] primvars:heat.timeSamples = { 0: [1], 1: [2] }
normal3f[] normals.timeSamples = {
0: [(1, 0, 0), (1, 0, 0), (1, 0, 0), (1, 0, 0)], 1: [(0, 1, 0), (0, 1, 0), (0, 1, 0), (0, 1, 0)] }
"""
    found = load(stage_file(instancer(arrays, mesh(more))))
    assert found.tracks["heat"].values[..., 0].tolist() == [[1, 1], [2, 2]]
    normals = found.tracks["normals"].values
    np.testing.assert_allclose(normals[0], [[1, 0, 0]] * 4 + [[0, 1, 0]] * 4, atol=1e-3)
    np.testing.assert_allclose(normals[1], [[0, 1, 0]] * 4 + [[0, 0, 1]] * 4, atol=1e-3)


def test_corner_tracks_match_mirrored_instances_with_holes(stage_file):
    arrays = (
        "int[] protoIndices = [0, 0]\npoint3f[] positions = [(0, 0, 0), (5, 0, 0)]\n"
        "float3[] scales = [(1, 1, 1), (-1, 1, 1)]"
    )
    more = """int[] holeIndices = [0]
float[] primvars:heat ( interpolation = "faceVarying" )
float[] primvars:heat.timeSamples = { 0: [9, 9, 9, 0, 1, 2], 1: [8, 8, 8, 3, 4, 5] }
"""
    two = mesh(more).replace("[4]", "[3, 3]").replace("[0, 1, 2, 3]", "[0, 1, 2, 0, 2, 3]")
    found = load(stage_file(instancer(arrays, two)))
    assert found.faces.tolist() == [[0, 2, 3], [4, 7, 6]]
    heat = found.tracks["heat"].values[..., 0]
    assert heat.tolist() == [[0, 1, 2, 0, 2, 1], [3, 4, 5, 3, 5, 4]]


def test_load_notes_primvars_of_instances(stage_file):
    notes = []
    arrays = THREE + (
        "\ncolor3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0), (0, 0, 1)] "
        '(interpolation = "varying")'
    )
    load(stage_file(instancer(arrays, mesh())), notes=notes)
    assert "left out: primvars of instances: displayColor" in notes


def test_load_rejects_an_invisible_instancer(stage_file):
    body = instancer(THREE + '\ntoken visibility = "invisible"', mesh())
    with pytest.raises(FormatError, match="no mesh that is rendered, only 1 mesh invisible"):
        load(stage_file(body))


def test_visibility_above_an_external_prototype_does_not_hide_instances(stage_file):
    library = f'def Scope "Library" {{\ntoken visibility = "invisible"\n{mesh(name="tree")}}}\n'
    found = load(stage_file(library + instancer(THREE, "", ["/Library/tree"])))
    assert found.n_verts == 12


def test_load_bakes_an_instancer_within_an_instance(stage_file):
    scene = f'def Xform "scene" {{\n{instancer(THREE, mesh(), ["/scene/many/m"])}}}\n'
    metadata = "(\ninstanceable = true\nreferences = </scene>\n)"
    copy = translated((0, 0, 100), "copy").replace('"copy"', f'"copy" {metadata}')
    path = stage_file(scene + copy)
    found = load(path, object="/copy/many/m")
    np.testing.assert_allclose(
        found.vertices[0], translated_copies(*OFFSETS) + np.array([0, 0, 100]), atol=1e-4
    )


@pytest.mark.parametrize(
    ("arrays", "body", "message"),
    [
        ("int[] protoIndices = [0, 3]", mesh(), "protoIndices from 0 to 3 .* but 1 prototypes"),
        (
            "int[] protoIndices = [0, 0]\npoint3f[] positions = [(0, 0, 0)]",
            mesh(),
            "2 protoIndices but another number of positions, orientations or scales",
        ),
        ("", mesh(), "only 1 mesh of prototypes without a rendered instance"),
        (THREE, "", "1 missing prototype of /many, 1 PointInstancer whose prototypes"),
        (
            THREE + "\nint64[] ids = [1, 2]\nint64[] invisibleIds = [2]",
            mesh(),
            "3 protoIndices but another number of ids at time code 0",
        ),
        (
            "int[] protoIndices.timeSamples = { 0: [], 1: [0] }\n"
            "point3f[] positions.timeSamples = { 0: [], 1: [(0, 0, 0)] }",
            mesh(),
            "/many/m has no instance at time code 0, so its frame would be empty",
        ),
        (
            "int[] protoIndices = [0]\npoint3f[] positions = [(nan, 0, 0)]",
            mesh(),
            "not finite|NaN|finite",
        ),
    ],
)
def test_load_rejects_invalid_instancers(stage_file, arrays, body, message):
    with pytest.raises((FormatError, InvalidInputError), match=message):
        load(stage_file(instancer(arrays, body)))


def test_load_rejects_an_instancer_within_its_own_prototype(stage_file):
    with pytest.raises(FormatError, match="point instancer /root/many is in one of its prototypes"):
        load(stage_file(translated((0, 0, 0), "root", instancer(THREE, mesh(), ["/root"]))))


def test_load_rejects_instances_that_exceed_the_limits(stage_file, monkeypatch):
    monkeypatch.setattr("meshreel.formats.usd.meshes.MAX_FRAME_BYTES", 200)
    with pytest.raises(FormatError, match=r"3 instances of 4 vertices need .* the limit is 200"):
        load(stage_file(instancer(THREE, mesh())))
    monkeypatch.setattr("meshreel.formats.usd.rendered.MAX_INSTANCES", 2)
    with pytest.raises(FormatError, match="makes 3 instances of a prototype; the limit is 2"):
        load(stage_file(instancer(THREE, mesh())))
