"""Primvars, face subsets, holes and subdivision cages of USD meshes."""

from functools import partial

import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.load import load
from meshreel.model.surface import Domain, Kind
from samples.surfaces import srgb
from samples.usd import mesh

# Two adjacent quads.
MESH = """#usda 1.0
{above}
def Mesh "m" {api} {{
    point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)]
    int[] faceVertexCounts = [4, 4]
    int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4]
    {body}
}}
"""
BOUND = '(prepend apiSchemas = ["MaterialBindingAPI"])'


@pytest.fixture
def surface_of(tmp_path):
    """A function that returns the surface of a mesh with the given properties."""

    def read(body, *, above="", api="", notes=None):
        path = tmp_path / "a.usda"
        path.write_text(MESH.format(body=body, above=above, api=api))
        return load(path, notes=notes).surface

    return read


def primvar(declared, values, interpolation, more=""):
    return f'{declared} = {values} (\ninterpolation = "{interpolation}"\n)\n{more}\n'


@pytest.mark.parametrize(
    ("interpolation", "domain", "n_items"),
    [
        ("vertex", Domain.VERTEX, 6),
        ("varying", Domain.VERTEX, 6),
        ("uniform", Domain.FACE, 2),
        ("faceVarying", Domain.CORNER, 8),
    ],
)
def test_attributes_have_the_domain_of_the_interpolation(
    surface_of, interpolation, domain, n_items
):
    values = [(i / 8, i / 16) for i in range(n_items)]
    (result,) = surface_of(primvar("texCoord2f[] primvars:st", values, interpolation)).attributes
    assert (result.name, result.kind, result.domain, result.indices) == (
        "st",
        Kind.UV,
        domain,
        None,
    )
    assert result.values.dtype == np.float32
    np.testing.assert_array_equal(result.values, values)


def test_attributes_keep_their_indices(surface_of):
    body = primvar(
        "texCoord2f[] primvars:st",
        [(0, 0), (1, 1)],
        "faceVarying",
        "int[] primvars:st:indices = [0, 1, 0, 1, 1, 1, 0, 0]",
    )
    (result,) = surface_of(body).attributes
    np.testing.assert_array_equal(result.values, [[0, 0], [1, 1]])
    np.testing.assert_array_equal(result.indices, [0, 1, 0, 1, 1, 1, 0, 0])


def test_constant_color_becomes_an_indexed_attribute(surface_of):
    (result,) = surface_of("color3f[] primvars:displayColor = [(0.5, 0.25, 1)]").attributes
    assert (result.name, result.kind, result.domain) == ("displayColor", Kind.COLOR, Domain.VERTEX)
    np.testing.assert_allclose(result.values, srgb([[0.5, 0.25, 1]]), rtol=1e-6)
    np.testing.assert_array_equal(result.indices, np.zeros(6))


def test_opacity_is_joined_to_a_color_with_the_same_items(surface_of):
    body = primvar("color3f[] primvars:displayColor", [(1, 0, 0), (0, 1, 0)], "uniform")
    opacity = primvar("float[] primvars:displayOpacity", [0.25, 0.75], "uniform")
    (result,) = surface_of(body + opacity).attributes
    np.testing.assert_array_equal(result.values, [[1, 0, 0, 0.25], [0, 1, 0, 0.75]])


def test_opacity_with_other_items_stays_separate(surface_of):
    body = primvar("color3f[] primvars:displayColor", [(1, 0, 0), (0, 1, 0)], "uniform")
    opacity = primvar("float[] primvars:displayOpacity", [0.5] * 6, "vertex")
    color, alpha = surface_of(body + opacity).attributes
    assert (color.values.shape, alpha.values.shape) == ((2, 3), (6, 1))
    assert (alpha.name, alpha.kind) == ("displayOpacity", Kind.OTHER)


@pytest.mark.parametrize(
    ("declared", "value", "kind", "dtype", "width"),
    [
        ("float2[] primvars:UVMap", (0, 1), Kind.UV, np.float32, 2),
        ("texCoord2h[] primvars:map1", (0, 1), Kind.UV, np.float32, 2),
        ("texCoord2d[] primvars:x", (0, 1), Kind.UV, np.float64, 2),
        ("color4f[] primvars:paint", (0, 1, 0, 1), Kind.COLOR, np.float32, 4),
        ("color3h[] primvars:paint", (0, 1, 0), Kind.COLOR, np.float32, 3),
        ("float[] primvars:heat", 1.5, Kind.OTHER, np.float32, 1),
        ("vector3d[] primvars:wind", (1, 2, 3), Kind.OTHER, np.float64, 3),
        ("int[] primvars:number", 7, Kind.OTHER, np.int32, 1),
        ("uchar[] primvars:byte", 7, Kind.OTHER, np.uint8, 1),
        ("bool[] primvars:isWet", 1, Kind.OTHER, np.uint8, 1),
        ("matrix2d[] primvars:turn", ((1, 2), (3, 4)), Kind.OTHER, np.float64, 4),
    ],
)
def test_attributes_have_the_number_type_of_the_primvar(
    surface_of, declared, value, kind, dtype, width
):
    (result,) = surface_of(primvar(declared, str([value] * 6), "vertex")).attributes
    assert (result.kind, result.values.dtype, result.values.shape) == (kind, dtype, (6, width))
    np.testing.assert_array_equal(result.values, np.tile(np.ravel(value), (6, 1)))


def test_attributes_start_with_texture_coordinates(surface_of):
    body = (
        primvar("float[] primvars:a", [0] * 6, "vertex")
        + "color3f[] primvars:displayColor = [(1, 0, 0)]\n"
        + primvar("texCoord2f[] primvars:st", [(0, 0)] * 6, "vertex")
    )
    body += primvar("texCoord2f[] primvars:map2", [(0, 0)] * 6, "vertex")
    results = [attribute.name for attribute in surface_of(body).attributes]
    assert results == ["st", "map2", "displayColor", "a"]


def test_colors_are_inherited_from_ancestors(surface_of, tmp_path):
    path = tmp_path / "b.usda"
    text = MESH.format(above="", api="", body="").removeprefix("#usda 1.0")
    path.write_text(
        '#usda 1.0\ndef Xform "x" {\ncolor3f[] primvars:displayColor = [(0, 0, 1)]\n' + text + "}"
    )
    (result,) = load(path).surface.attributes
    np.testing.assert_array_equal(result.values, [[0, 0, 1]])


@pytest.mark.parametrize(
    "body",
    [
        primvar("texCoord2f[] primvars:st", [(0, 0)] * 5, "vertex"),
        primvar("texCoord2f[] primvars:st", [], "vertex"),
        primvar("token[] primvars:st", '["a", "b"]', "uniform"),
        primvar("int64[] primvars:st", [1, 2], "uniform"),
        primvar("texCoord2f[] primvars:st", [(0, 0)] * 2, "constant"),
        primvar(
            "texCoord2f[] primvars:st", [(0, 0)], "uniform", "int[] primvars:st:indices = [0, 1]"
        ),
        primvar(
            "texCoord2f[] primvars:st", [(0, 0)], "uniform", "int[] primvars:st:indices = [0, -1]"
        ),
        primvar("texCoord2f[] primvars:st", [(0, 0)], "uniform", "int[] primvars:st:indices = [0]"),
        primvar("color3f[] primvars:displayColor", [(0, 0, 0)] * 2, "constant"),
        'float[] primvars:x = [1] (\nelementSize = 1000000000\ninterpolation = "uniform"\n)',
        'float[] primvars:x = [1, 2] (\nelementSize = -2\ninterpolation = "vertex"\n)',
        "normal3f[] primvars:normals = [(0, 0, 1)]",
    ],
)
def test_primvars_that_do_not_fit_are_left_out(surface_of, body, notes):
    assert surface_of(body, notes=notes).attributes == ()
    is_setting = "constant" in body and "texCoord" in body
    assert is_setting or "normals" in body or any("left out" in note for note in notes)


MATERIALS = 'def Material "red" { }\ndef Material "b" (displayName = "blåt") { }'


def subset(name, faces, family, material=""):
    bound = f"rel material:binding = </{material}>" if material else ""
    return f"""def GeomSubset "{name}" {BOUND if material else ""} {{
        uniform token elementType = "face"
        uniform token familyName = "{family}"
        int[] indices = {faces}
        {bound}
    }}
    """


def test_material_subsets_become_material_groups(surface_of):
    body = subset("one", [1], "materialBind", "red") + subset("two", [0], "materialBind", "b")
    (result,) = surface_of(body, above=MATERIALS).groups
    assert (result.name, result.labels) == ("material", ("red", "blåt"))
    np.testing.assert_array_equal(result.numbers, [1, 0])


def test_faces_without_subset_have_the_material_of_the_mesh(surface_of):
    body = subset("one", [1], "materialBind", "red") + "rel material:binding = </b>"
    (result,) = surface_of(body, above=MATERIALS, api=BOUND).groups
    assert result.labels == ("red", "blåt")
    np.testing.assert_array_equal(result.numbers, [1, 0])


def test_subsets_without_material_are_labeled_by_name(surface_of):
    body = subset("one", [1], "materialBind") + subset("left", [0], "side") + subset("x", [1], "")
    materials, sides, others = surface_of(body).groups
    assert (materials.name, materials.labels) == ("material", ("one",))
    np.testing.assert_array_equal(materials.numbers, [-1, 0])
    assert (sides.name, sides.labels) == ("side", ("left",))
    assert (others.name, others.labels) == ("group", ("x",))


def test_overlapping_or_invalid_subsets_are_noted(surface_of, notes):
    body = subset("one", [0, 1], "side") + subset("two", [1, 2, -1], "side")
    (result,) = surface_of(body, notes=notes).groups
    np.testing.assert_array_equal(result.numbers, [0, 1])
    assert any("side subsets of /m overlap" in note for note in notes)


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
    ("scheme", "is_noted"), [("catmullClark", True), ("loop", True), ("none", False), (None, True)]
)
def test_load_notes_that_it_reads_the_cage_of_a_subdivision_surface(stage_file, scheme, is_noted):
    notes = []
    lines = f'uniform token subdivisionScheme = "{scheme}"\n' if scheme else ""
    load(stage_file(strip(lines + "int[] creaseIndices = [0, 1]")), notes=notes)
    assert ("left out: subdivision, whose cages are read: /m" in notes) == is_noted
    creases = "left out: creases of meshes that are not subdivided: creaseIndices"
    assert [note for note in notes if "crease" in note] == ([] if is_noted else [creases])
