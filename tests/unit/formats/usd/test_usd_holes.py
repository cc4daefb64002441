"""Holes and subdivision cages of USD meshes."""

from functools import partial

import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.load import load
from samples.usd import mesh

STRIP = """point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0), (2, 1, 0)]
int[] faceVertexCounts = [4, 3, 3]
int[] faceVertexIndices = [0, 1, 2, 3, 1, 4, 5, 1, 5, 2]"""
PROPERTIES = """
int[] primvars:tag = [10, 11, 12] (interpolation = "uniform")
float[] primvars:heat = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9] (interpolation = "faceVarying")
texCoord2f[] primvars:st = [(0, 0), (1, 1)] (interpolation = "faceVarying")
int[] primvars:st:indices = [0, 1, 0, 1, 0, 0, 0, 1, 1, 1]
float[] primvars:mass = [0, 1, 2, 3, 4, 5] (interpolation = "vertex")
uniform token subsetFamily:side:familyType = "partition"
def GeomSubset "left" {
    uniform token familyName = "side"
    int[] indices = [0, 1]
}
def GeomSubset "right" {
    uniform token familyName = "side"
    int[] indices = [2]
}"""


strip = partial(mesh, points=STRIP, faces="")


@pytest.mark.parametrize("holes", ["[1]", "[1, 1]", "[1, -1, 3, 99]"])
def test_load_removes_faces_that_are_holes(stage_file, holes, notes):
    loaded = load(stage_file(strip(f"int[] holeIndices = {holes}")), notes=notes)
    np.testing.assert_array_equal(loaded.surface.face_sizes, [4, 3])
    np.testing.assert_array_equal(loaded.faces, [[0, 1, 2], [0, 2, 3], [1, 5, 2]])
    assert loaded.n_verts == 6
    assert "left out: faces that are holes: 1 of 3 of /m" in notes


@pytest.mark.parametrize("is_reversed", [False, True])
def test_load_removes_attributes_of_holes(stage_file, is_reversed):
    orientation = "leftHanded" if is_reversed else "rightHanded"
    lines = f'{PROPERTIES}\nuniform token orientation = "{orientation}"'
    result = load(stage_file(strip(f"{lines}\nint[] holeIndices = [1]"))).surface
    values = {attribute.name: attribute.per_item() for attribute in result.attributes}
    heat = [0, 3, 2, 1, 7, 9, 8] if is_reversed else [0, 1, 2, 3, 7, 8, 9]
    np.testing.assert_array_equal(values["tag"][:, 0], [10, 12])
    np.testing.assert_array_equal(values["heat"][:, 0], heat)
    np.testing.assert_array_equal(values["st"][:, 0], np.isin(heat, [1, 3, 7, 8, 9]))
    np.testing.assert_array_equal(values["mass"][:, 0], np.arange(6))
    assert [groups.labels[number] for groups in result.groups for number in groups.numbers] == [
        "left",
        "right",
    ]


def test_load_rejects_a_mesh_with_only_holes(stage_file):
    with pytest.raises(FormatError, match="mesh /m has 3 faces, and all of them are holes"):
        load(stage_file(strip("int[] holeIndices = [0, 1, 2]")))


def test_faces_change_where_holes_do(stage_file):
    path = stage_file(strip("int[] holeIndices.timeSamples = { 0: [1], 1: [] }"))
    assert [len(one.surface.sizes(len(one.faces))) for one in load(path).segments] == [2, 3]


@pytest.mark.parametrize(
    ("scheme", "is_noted"),
    [("catmullClark", True), ("loop", True), ("none", False), (None, True)],
)
def test_load_notes_that_it_reads_the_cage_of_a_subdivision_surface(stage_file, scheme, is_noted):
    notes = []
    lines = f'uniform token subdivisionScheme = "{scheme}"' if scheme else ""
    load(stage_file(strip(lines)), notes=notes)
    assert ("left out: subdivision, whose cages are read: /m" in notes) == is_noted


def test_load_notes_several_subdivision_surfaces_in_one_sentence(stage_file, notes):
    load(stage_file(strip() + strip(name="n")), merge=True, notes=notes)
    assert notes == ["left out: subdivision, whose cages are read: /m, /n"]
