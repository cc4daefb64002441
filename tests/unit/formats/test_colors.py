"""Colors of sequences and pictures are sRGB, also those of files with linear colors."""

import json
import struct
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from meshreel import MeshSequence
from meshreel.formats.load import load
from meshreel.model.colors import colors_of_linear, linear_of_colors, to_linear, to_srgb
from meshreel.model.materials import Material
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Surface
from meshreel.model.tracks import Track
from meshreel.operations.save import save
from meshreel.rendering.scenes import surface_paint
from samples.commands import run_ok
from samples.gltf import SQUARE, SQUARE_FACES, Gltf

PLY = """ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y
property float z\nproperty uchar {0}\nproperty uchar {1}\nproperty uchar {2}\nelement face 2
property list uchar int vertex_indices\nend_header
0 0 0 {3}\n1 0 0 {3}\n1 1 0 {3}\n0 1 0 {3}\n3 0 1 2\n3 0 2 3\n"""
OBJ = "v 0 0 0 {0}\nv 1 0 0 {0}\nv 1 1 0 {0}\nv 0 1 0 {0}\nf 1 2 3\nf 1 3 4\n"
USD = """#usda 1.0\ndef Mesh "m" {{
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    int[] faceVertexCounts = [3, 3]\n    int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
    color3f[] primvars:displayColor = [({0}, {0}, {0})] ({1})\n}}"""
LINEAR_128 = 0.21586050011389926
BYTES = np.arange(256, dtype=np.uint8)[:, None].repeat(4, axis=1)


def gray_file(folder, kind):
    """Write a square of the gray that bytes of sRGB store as 128; return its path."""
    path = folder / f"gray.{kind}"
    if kind == "glb":
        file = Gltf.of_mesh(SQUARE, SQUARE_FACES)
        color = file.accessor(np.full((len(SQUARE), 3), LINEAR_128))
        file.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = color
        return file.save(path)
    if kind == "usda":
        pytest.importorskip("pxr")
    texts = {
        "ply": PLY.format("red", "green", "blue", "128 128 128"),
        "obj": OBJ.format(f"{128 / 255} " * 3),
        "usda": USD.format(LINEAR_128, ""),
    }
    path.write_text(texts[kind])
    return path


def painted(values, domain=Domain.VERTEX):
    """Return a row of triangles with a color at each vertex."""
    n = len(values)
    vertices = np.random.default_rng(0).random((1, n, 3), np.float32)
    faces = np.stack([np.arange(n - 2) + k for k in range(3)], axis=1)
    surface = Surface(attributes=(Attribute("color", Kind.COLOR, domain, values),))
    return MeshSequence(vertices, faces, surface=surface)


def stored_glb(path):
    """Return the numbers of COLOR_0 and its JSON, by a walk of the file."""
    data = path.read_bytes()
    size = struct.unpack_from("<I", data, 12)[0]
    tree = json.loads(data[20 : 20 + size])
    accessor = tree["accessors"][tree["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"]]
    view = tree["bufferViews"][accessor["bufferView"]]
    dtype = np.dtype({5121: "u1", 5123: "<u2", 5126: "<f4"}[accessor["componentType"]])
    width = int(accessor["type"][-1])
    start = 28 + size + view.get("byteOffset", 0)
    strides = view.get("byteStride", width * dtype.itemsize), dtype.itemsize
    return np.ndarray((accessor["count"], width), dtype, data, start, strides), accessor


@pytest.mark.parametrize("kind", ["ply", "obj", "glb", "usda"])
def test_the_same_gray_has_the_same_value_in_files_and_pictures(tmp_path, kind):
    path = gray_file(tmp_path, kind)
    [color] = load(path).surface.attributes
    np.testing.assert_allclose(color.per_item(), 128 if kind == "ply" else 128 / 255, rtol=1e-6)
    picture = tmp_path / "a.png"
    run_ok("render", path, "-o", picture, "--size", "32x32")
    assert Image.open(picture).convert("RGB").getpixel((16, 16)) == (112, 112, 112)
    for extension, expected in (("ply", 128), ("obj", 128 / 255), ("glb", LINEAR_128)):
        [written] = save(load(path), tmp_path / f"b.{extension}", overwrite=True)
        if extension == "ply":
            numbers = pytest.importorskip("trimesh").load(written, process=False)
            numbers = numbers.visual.vertex_colors[:, :3]
            assert b"property uchar red" in written.read_bytes()
        elif extension == "obj":
            numbers = [float(word) for word in written.read_text().split("\n")[0].split()[4:]]
        else:
            numbers, accessor = stored_glb(written)
            assert accessor["normalized"]
            numbers = numbers / 0xFFFF
        np.testing.assert_allclose(numbers, expected, atol=1e-5)


@pytest.mark.parametrize("extension", ["glb", "usdc", "obj", "abc", "npz"])
def test_srgb_bytes_survive_every_format(tmp_path, extension, notes):
    save(painted(BYTES), tmp_path / "a.ply")
    save(load(tmp_path / "a.ply"), tmp_path / f"b.{extension}")
    save(load(tmp_path / f"b.{extension}"), tmp_path / "c.ply", notes=notes)
    width = 3 if extension == "obj" else 4
    [color] = load(tmp_path / "c.ply").surface.attributes
    assert color.values.dtype == np.uint8
    np.testing.assert_array_equal(color.per_item(), BYTES[:, :width])
    assert notes == []


@pytest.mark.parametrize("dtype", ["u1", "u2"])
def test_linear_integers_of_glb_return_unchanged(tmp_path, dtype):
    numbers = np.linspace(0, np.iinfo(dtype).max, 3000).astype(dtype)[:, None].repeat(4, axis=1)
    source = painted(colors_of_linear(numbers))
    save(source, tmp_path / "a.glb")
    save(load(tmp_path / "a.glb"), tmp_path / "b.glb")
    for name in "ab":
        written, _ = stored_glb(tmp_path / f"{name}.glb")
        np.testing.assert_array_equal(written, numbers, strict=True)


def test_floats_beyond_the_range_follow_the_mirrored_curve():
    linear = np.array([[-LINEAR_128, 2, np.nan, -3], [0.001, 1e4, 0, 7]], np.float32)
    colors = to_srgb(linear)
    expected = [[-128 / 255, 1.3532560, np.nan, -3], [0.01292, 48.913762, 0, 7]]
    np.testing.assert_allclose(colors, expected, rtol=1e-6)
    np.testing.assert_allclose(to_linear(colors), linear, rtol=1e-12)
    random = np.random.default_rng(0).random((9999, 3), np.float32)
    restored = to_linear(colors_of_linear(random)).astype(np.float32)
    np.testing.assert_allclose(restored, random, rtol=1e-6)
    assert linear_of_colors(random).dtype == np.float32


@pytest.mark.parametrize(
    ("metadata", "expected"),
    [
        ("", 128 / 255),
        ('colorSpace = "srgb_rec709_scene"', LINEAR_128),
        ('colorSpace = "sRGB"', LINEAR_128),
        ('colorSpace = "g22_rec709_scene"', 128 / 255),
    ],
)
def test_color_spaces_of_usd_are_honored(tmp_path, metadata, expected, notes):
    pytest.importorskip("pxr")
    (tmp_path / "a.usda").write_text(USD.format(LINEAR_128, metadata))
    [color] = load(tmp_path / "a.usda", notes=notes).surface.attributes
    np.testing.assert_allclose(color.per_item(), expected, rtol=1e-5)
    is_noted = any("color space 'g22_rec709_scene' of displayColor" in note for note in notes)
    assert is_noted == ("g22" in metadata)


@pytest.mark.parametrize(("program", "expected"), [("Houdini 20.5", 128 / 255), ("", LINEAR_128)])
def test_colors_of_alembic_are_linear_only_in_files_of_houdini(tmp_path, program, expected):
    library = pytest.importorskip("alembic3d")
    make = library.Abc.CreateArchiveWithInfo
    library.Abc.OArchive, original = lambda path: make(path, program, ""), library.Abc.OArchive
    try:
        save(painted(np.full((4, 3), LINEAR_128, np.float32)), tmp_path / "a.abc")
    finally:
        library.Abc.OArchive = original
    [color] = load(tmp_path / "a.abc").surface.attributes
    np.testing.assert_allclose(color.per_item(), expected, rtol=1e-6)


@pytest.mark.parametrize("names", [("diffuse_red", "diffuse_green", "diffuse_blue"), "rgb"])
def test_other_names_of_ply_colors(tmp_path, names):
    (tmp_path / "a.ply").write_text(PLY.format(*names, "10 20 30"))
    [color] = load(tmp_path / "a.ply").surface.attributes
    assert (color.name, color.kind, color.values.dtype) == ("color", Kind.COLOR, np.uint8)
    np.testing.assert_array_equal(color.values, [[10, 20, 30]] * 4)


@pytest.mark.parametrize("is_track", [False, True])
@pytest.mark.parametrize(
    ("high", "dtype", "note"), [(1, "u1", "are rounded to bytes"), (1.5, "f4", "exceed 0..1")]
)
def test_float_colors_of_ply_are_noted(tmp_path, is_track, high, dtype, note, notes):
    values = np.linspace(0, high, 30, dtype=np.float32).reshape(10, 3)
    mesh = painted(values)
    if is_track:
        mesh = mesh.replace(surface=Surface(), tracks={"color": Track(values[None], kind="color")})
    save(mesh, tmp_path / "a.ply", notes=notes)
    [color] = load(tmp_path / "a.ply").surface.attributes
    expected = np.rint(255 * values) if dtype == "u1" else values
    np.testing.assert_array_equal(color.values, expected.astype(dtype), strict=True)
    assert len(notes) == 1
    assert note in notes[0]


def test_pictures_multiply_colors_by_the_base_color_and_show_unlit_faces():
    mesh = painted(np.full((5, 3), 128, np.uint8))
    looks = [Material("lit", (0.5, 1, 0, 1)), Material("unlit", unlit=True)]
    groups = FaceGroups("material", ("lit", "unlit"), np.array([0, 1, -1], np.int32))
    surface = replace(mesh.surface, groups=(groups,), materials=tuple(looks))
    colors, glow = map(np.asarray, surface_paint(surface, mesh.faces))
    red = 255 * to_srgb(np.full((1, 3), LINEAR_128 / 2))[0, 0]
    np.testing.assert_allclose(colors[:, 0], [[red, 128, 0], [128] * 3, [128] * 3], rtol=1e-5)
    assert glow.tolist() == [0, 1, 0]
    colors = np.asarray(surface_paint(replace(surface, attributes=()), mesh.faces)[0])
    np.testing.assert_allclose(colors[1:, 0], [[255] * 3, [180] * 3], rtol=1e-5)
