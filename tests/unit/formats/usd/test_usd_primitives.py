"""Cubes, spheres and other primitives of USD, read as meshes."""

import math

import numpy as np
import pytest

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.load import load

Z_AXIS_ORDER = {"X": [1, 2, 0], "Y": [2, 0, 1], "Z": [0, 1, 2]}
"""Order of coordinates that makes the axis of a primitive the z axis."""


@pytest.fixture
def prim_file(tmp_path):
    """A function that writes prims, and returns their file."""

    def write(body):
        path = tmp_path / "a.usda"
        lines = body.replace("{", "{\n").replace("}", "\n}").replace(";", "\n")
        path.write_text(f"#usda 1.0\n{lines}\n")
        return path

    return write


def volume(sequence):
    """Return the volume of the first frame, positive for counterclockwise faces from outside."""
    corners = sequence.vertices[0].astype(np.float64)[sequence.faces]
    return np.linalg.det(corners).sum() / 6


def is_closed(faces):
    """Return whether each edge has two faces with opposite directions along it."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    forward, backward = (set(map(tuple, one.tolist())) for one in (edges, edges[:, ::-1]))
    return len(forward) == len(edges) and forward == backward


@pytest.mark.parametrize(
    ("body", "size", "expected"),
    [
        ('def Cube "p" { }', [2, 2, 2], 8),
        ('def Cube "p" { double size = 3 }', [3, 3, 3], 27),
        ('def Sphere "p" { }', [2, 2, 2], 4 / 3 * math.pi),
        ('def Sphere "p" { double radius = 2 }', [4, 4, 4], 32 / 3 * math.pi),
        ('def Cylinder "p" { double height = 5 }', [2, 2, 5], 5 * math.pi),
        ('def Cone "p" { double radius = 2 }', [4, 4, 2], 8 / 3 * math.pi),
        ('def Capsule "p" { }', [1, 1, 2], math.pi / 4 + math.pi / 6),
        (
            'def Cylinder_1 "p" { double radiusBottom = 2; double radiusTop = 1 }',
            [4, 4, 2],
            14 / 3 * math.pi,
        ),
        (
            'def Capsule_1 "p" { double radiusBottom = 2; double radiusTop = 1 }',
            [4, 4, 4],
            7 / 3 * math.pi + 16 / 3 * math.pi + 2 / 3 * math.pi,
        ),
    ],
)
@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_load_reads_primitives_as_closed_meshes_of_their_size(
    prim_file, body, size, expected, axis
):
    if "Cube" not in body and "Sphere" not in body:
        body = body.replace("{", f'{{ uniform token axis = "{axis}";')
    found = load(prim_file(body))
    assert is_closed(found.faces)
    around_z = found.vertices[0][:, Z_AXIS_ORDER[axis]]
    np.testing.assert_allclose(np.ptp(around_z, axis=0), size, rtol=1e-6)
    exact = "Cube" in body
    assert volume(found) == pytest.approx(expected, rel=1e-6 if exact else 0.025)
    assert found.vertices.dtype == np.float32


def test_load_points_a_cone_along_its_axis(prim_file):
    found = load(prim_file('def Cone "p" { uniform token axis = "X" }'))
    tip = found.vertices[0][found.vertices[0][:, 0] > 0]
    np.testing.assert_allclose(tip, [[1, 0, 0]], rtol=0, atol=1e-7)


def test_load_approximates_a_sphere_within_one_percent(prim_file):
    notes = []
    found = load(prim_file('def Sphere "p" { double radius = 5 }'), notes=notes)
    centers = found.vertices[0][found.faces].mean(axis=1)
    middles = found.vertices[0][found.faces[:, [0, 2]]].mean(axis=1)
    for points in (found.vertices[0], centers, middles):
        distance = np.linalg.norm(points, axis=1)
        assert (distance <= 5 + 1e-5).all()
        assert (distance >= 5 * 0.99).all()
    assert notes == ["read as meshes with 32 faces around, within 1 % of the radius: /p (Sphere)"]


@pytest.mark.parametrize(
    ("axis", "spans", "normal"),
    [("X", [0, 3, 2], [1, 0, 0]), ("Y", [2, 0, 3], [0, 1, 0]), ("Z", [2, 3, 0], [0, 0, 1])],
)
def test_load_reads_a_plane_as_a_quad_facing_its_axis(prim_file, axis, spans, normal):
    body = (
        f'def Plane "p" {{\nuniform token axis = "{axis}"\ndouble width = 2\ndouble length = 3\n}}'
    )
    found = load(prim_file(body))
    a, b, c = found.vertices[0][found.faces[0]]
    np.testing.assert_array_equal(np.ptp(found.vertices[0], axis=0), spans)
    np.testing.assert_array_equal(np.cross(b - a, c - a) / 6, normal)
    np.testing.assert_array_equal(found.surface.face_sizes, [4])


def test_load_animates_transform_and_size_of_a_primitive(prim_file):
    body = """def Sphere "p" {
        double radius.timeSamples = { 0: 1, 4: 3 }
        double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 4: (8, 0, 0) }
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }"""
    found = load(prim_file(body))
    assert (found.n_frames, found.fps) == (5, 24.0)
    center = (found.vertices.max(axis=1) + found.vertices.min(axis=1)) / 2
    np.testing.assert_allclose(center[:, 0], [0, 2, 4, 6, 8], atol=1e-6)
    height = np.ptp(found.vertices[..., 2], axis=1)
    np.testing.assert_allclose(height, [2, 3, 4, 5, 6], rtol=1e-6)


def test_load_keeps_face_colors_of_a_cube(prim_file):
    body = """def Cube "p" {
        color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (0, 1, 1),
            (1, 0, 1)] (interpolation = "uniform")
        float[] primvars:displayOpacity = [0.5] (interpolation = "constant")
    }"""
    found = load(prim_file(body)).surface.attributes
    colors = next(one for one in found if one.name == "displayColor")
    assert colors.values[:, :3].shape == (6, 3)


def test_load_keeps_the_color_of_a_sphere(prim_file):
    body = 'def Sphere "p" { color3f[] primvars:displayColor = [(1, 0.5, 0)] }'
    colors = load(prim_file(body)).surface.attributes[0]
    np.testing.assert_array_equal(np.unique(colors.per_item(), axis=0), [[1, 0.5, 0]])


def test_load_lists_and_merges_primitives_with_meshes(prim_file):
    body = """def Cube "box" { }
    def Sphere "ball" { }
    def Mesh "m" {
        point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
    }"""
    path, notes = prim_file(body), []
    with pytest.raises(InvalidInputError, match="holds 3 meshes: /box, /ball, /m"):
        load(path)
    merged = load(path, merge=True, notes=notes)
    assert [(part.name, part.n_verts) for part in merged.surface.parts] == [
        ("/box", 8), ("/ball", 482), ("/m", 3),
    ]  # fmt: skip
    assert "read as meshes: /box (Cube)" in notes


def test_load_names_the_primitive_with_an_invalid_size(prim_file):
    with pytest.raises(FormatError, match="Sphere /p has no number as radius at time code 0"):
        load(prim_file('def Sphere "p" { string radius = "x" }'))


@pytest.mark.parametrize("size", ["inf", "nan", "1e300"])
def test_load_rejects_primitives_that_are_not_finite(prim_file, size):
    with pytest.raises(InvalidInputError, match="every position must be finite"):
        load(prim_file(f'def Cylinder "p" {{ double height = {size} }}'))
