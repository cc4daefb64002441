from functools import partial

import DracoPy
import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.gltf import morphs
from meshreel.formats.gltf.document import FAN, STRIP, TRIANGLES
from meshreel.formats.gltf.geometry import assemble_triangles
from meshreel.formats.gltf.morphs import BYTE, SHORT, best_weights, project
from meshreel.formats.load import load
from meshreel.model.surface import Domain, Kind
from samples.gltf import SQUARE, SQUARE_FACES, TRIANGLE, Gltf, shifted
from samples.surfaces import srgb

SPLIT = [*SQUARE, SQUARE[0], SQUARE[2]]
SPLIT_FACES = [0, 1, 2, 4, 5, 3]


def split_square(**attributes):
    """Return a square with a seam on its diagonal; attributes are values or accessor arguments."""
    file = Gltf()
    numbers = {
        name: file.accessor(attribute)
        if not isinstance(attribute, tuple)
        else file.accessor(*attribute[:2], **attribute[2])
        for name, attribute in attributes.items()
    }
    file.node(mesh=file.mesh(SPLIT, SPLIT_FACES, attributes=numbers))
    return file


def test_coincident_vertices_are_welded(read):
    result, notes = read(split_square(NORMAL=[[0, 0, 1]] * 6))
    np.testing.assert_array_equal(result.vertices[0], SQUARE)
    np.testing.assert_array_equal(result.faces, [[0, 1, 2], [0, 2, 3]])
    assert notes == [
        "left out: normals, which programs compute",
        "welded 6 vertices, split at seams, to 4",
    ]
    assert result.surface.is_plain


def test_vertices_that_differ_in_the_sign_of_zero_are_welded(read):
    assert read(Gltf.of_mesh([*SQUARE, [-0.0, 0, -0.0], SQUARE[2]], SPLIT_FACES))[0].n_verts == 4


def test_vertices_separated_by_a_morph_target_are_not_welded(read):
    file = Gltf()
    target = np.zeros((6, 3))
    target[4] = [0, 0, 1e-30]
    file.node(mesh=file.mesh(SPLIT, SPLIT_FACES, [target]))
    result, notes = read(file)
    np.testing.assert_array_equal(result.faces, [[0, 1, 2], [4, 2, 3]])
    assert notes == ["welded 6 vertices, split at seams, to 5"]


def test_vertices_with_different_joints_are_not_welded(read):
    joints = np.zeros((6, 4))
    joints[4, 0] = 1
    weights = np.tile([1, 0, 0, 0], (6, 1))
    file = split_square(JOINTS_0=(joints, "u1", {}), WEIGHTS_0=weights)
    assert read(file)[0].n_verts == 5


def test_triangles_that_degenerate_by_welding_are_kept(read):
    file = Gltf.of_mesh([*SQUARE, SQUARE[0]], [0, 1, 2, 0, 4, 2])
    np.testing.assert_array_equal(read(file)[0].faces, [[0, 1, 2], [0, 0, 2]])


def test_uvs_that_differ_at_a_seam_are_corner_attributes_with_flipped_v(read):
    uv = np.array([[0, 0], [0.5, 0], [0.5, 0.25], [0, 0.25], [1, 1], [0.5, 0.25]])
    result, _ = read(split_square(TEXCOORD_0=uv))
    [attribute] = result.surface.attributes
    assert (attribute.name, attribute.kind, attribute.domain) == ("uv", Kind.UV, Domain.CORNER)
    assert (attribute.values.dtype, len(attribute.values)) == (np.float32, 5)
    expected = (uv * [1, -1] + [0, 1])[SPLIT_FACES]
    np.testing.assert_array_equal(attribute.per_item(), expected)


def test_uvs_that_agree_at_a_seam_are_vertex_attributes(read):
    uv = np.random.default_rng(0).random((6, 2)).astype(np.float32)
    uv[4:] = uv[[0, 2]]
    result, _ = read(split_square(TEXCOORD_0=uv))
    [attribute] = result.surface.attributes
    assert (attribute.domain, attribute.indices) == (Domain.VERTEX, None)
    np.testing.assert_array_equal(attribute.values, np.stack([uv[:4, 0], 1 - uv[:4, 1]], axis=1))


@pytest.mark.parametrize("dtype", ["u1", "u2"])
def test_normalized_uvs_are_read_as_fractions(read, dtype):
    maximum = np.iinfo(dtype).max
    uv = np.zeros((6, 2))
    uv[:] = [maximum, maximum // 5]
    result, _ = read(split_square(TEXCOORD_0=(uv, dtype, {"normalized": True})))
    np.testing.assert_array_equal(
        result.surface.attributes[0].values, np.array([[1, 0.8]] * 4, np.float32)
    )


@pytest.mark.parametrize("width", [3, 4])
def test_linear_byte_colors_become_srgb_of_16_bits(read, width):
    color = np.random.default_rng(0).integers(0, 256, (6, width))
    result, _ = read(split_square(COLOR_0=(color, "u1", {"normalized": True})))
    [attribute] = result.surface.attributes
    assert (attribute.name, attribute.kind, attribute.domain) == (
        "color", Kind.COLOR, Domain.CORNER,
    )  # fmt: skip
    assert attribute.values.dtype == np.float32
    expected = srgb(color[SPLIT_FACES] / 255)
    np.testing.assert_allclose(attribute.per_item(), expected, rtol=0, atol=0.51 / 0xFFFF)


def test_short_and_float_colors_are_read_as_srgb(read):
    shorts = (np.full((6, 3), 13107), "u2", {"normalized": True})
    result, _ = read(split_square(COLOR_0=shorts, COLOR_1=np.full((6, 4), 0.2)))
    first, second = result.surface.attributes
    assert (first.name, second.name) == ("color", "color1")
    np.testing.assert_array_equal(first.values, srgb(np.full((4, 3), 0.2)))
    np.testing.assert_array_equal(second.values, srgb(np.full((4, 4), np.float32(0.2))))


def test_attributes_are_ordered_by_kind_and_set(read):
    pair = np.zeros((6, 2))
    file = split_square(_HEAT=np.arange(6), TEXCOORD_10=pair, COLOR_0=np.ones((6, 3)),
                        TEXCOORD_2=pair, TANGENT=np.ones((6, 4)))  # fmt: skip
    result, _ = read(file)
    assert [attribute.name for attribute in result.surface.attributes] == [
        "uv2",
        "uv10",
        "color",
        "_HEAT",
    ]
    heat = result.surface.attributes[3]
    assert (heat.kind, heat.domain) == (Kind.OTHER, Domain.CORNER)
    np.testing.assert_array_equal(heat.per_item()[:, 0], SPLIT_FACES)


@pytest.mark.parametrize(
    ("dtype", "expected"), [("i1", "i4"), ("u1", "u1"), ("i2", "i4"), ("u2", "i4"), ("f4", "f4")]
)
def test_custom_attributes_of_every_type_keep_their_values(read, dtype, expected):
    info = np.finfo(dtype) if dtype == "f4" else np.iinfo(dtype)
    numbers = np.array([info.max, info.min, 1, 2, info.max, 1], dtype)
    result, _ = read(split_square(_OWN=(numbers, dtype, {})))
    [attribute] = result.surface.attributes
    assert attribute.values.dtype == np.dtype(expected)
    np.testing.assert_array_equal(attribute.values[:, 0], numbers[:4])


def two_primitives(first=None, second=None, **more):
    file = Gltf()
    mesh = file.mesh(TRIANGLE, attributes=first)
    other = {"POSITION": file.accessor(shifted(TRIANGLE, [1, 0, 0])), **(second or {})}
    file.json["meshes"][mesh]["primitives"].append({"attributes": other, **more})
    file.node(mesh=mesh)
    return file


def test_primitives_are_joined_to_one_mesh(read):
    result, notes = read(two_primitives())
    np.testing.assert_array_equal(result.faces, [[0, 1, 2], [1, 3, 4]])
    np.testing.assert_array_equal(result.vertices[0], [*TRIANGLE, [2, 0, 0], [1, 1, 0]])
    assert notes == ["welded 6 vertices, split at seams, to 5"]


def test_materials_of_primitives_become_groups(read):
    file = two_primitives(material=3)
    for name in ("skin", None, "skin", None):
        file.add("materials", **({"name": name} if name else {}))
    result, _ = read(file)
    [groups] = result.surface.groups
    assert (groups.name, groups.labels, groups.numbers.tolist()) == (
        "material", ("material_3",), [-1, 0],
    )  # fmt: skip
    file.json["meshes"][0]["primitives"][0]["material"] = 2
    [groups] = read(file)[0].surface.groups
    assert (groups.labels, groups.numbers.tolist()) == (("skin_1", "material_3"), [0, 1])


def test_primitives_with_the_same_accessors_share_vertices(read):
    file = Gltf()
    mesh = file.mesh(SQUARE, SQUARE_FACES[:3])
    [primitive] = file.json["meshes"][mesh]["primitives"]
    second = {**primitive, "indices": file.accessor(SQUARE_FACES[3:], "u4")}
    file.json["meshes"][mesh]["primitives"].append(second)
    file.node(mesh=mesh)
    result, notes = read(file)
    np.testing.assert_array_equal(result.faces, [[0, 1, 2], [0, 2, 3]])
    assert (result.n_verts, notes) == (4, [])


def test_missing_attributes_are_filled_in_and_noted(read):
    file = two_primitives()
    attributes = file.json["meshes"][0]["primitives"][1]["attributes"]
    attributes["TEXCOORD_0"] = file.accessor([[0.5, 0.5]] * 3)
    attributes["COLOR_0"] = file.accessor([[0, 0, 0, 9]] * 3, "u1", normalized=True)
    attributes["_OWN"] = file.accessor([1, 2, 3])
    result, notes = read(file)
    uv, color = result.surface.attributes
    np.testing.assert_array_equal(uv.per_item(), [[0, 1]] * 3 + [[0.5, 0.5]] * 3)
    expected = np.array([[255] * 4] * 3 + [[0, 0, 0, 9]] * 3) / 255
    np.testing.assert_array_equal(color.per_item(), expected.astype(np.float32))
    assert notes[:-1] == [
        "mesh 0: TEXCOORD_0 is 0 1 on primitives without it",
        "mesh 0: COLOR_0 is white on primitives without it",
        "mesh 0: _OWN is left out, since not all primitives have it with the same type",
    ]


def test_colors_of_different_types_are_read_as_srgb(read):
    file = two_primitives()
    first, second = (one["attributes"] for one in file.json["meshes"][0]["primitives"])
    first["COLOR_0"] = file.accessor([[51, 0, 255]] * 3, "u1", normalized=True)
    second["COLOR_0"] = file.accessor([[0, 1, 0, 0.5]] * 3)
    [color] = read(file)[0].surface.attributes
    expected = srgb([[0.2, 0, 1, 1]] * 3 + [[0, 1, 0, 0.5]] * 3)
    np.testing.assert_allclose(color.per_item(), expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("mode", "expected"),
    [
        (TRIANGLES, [[5, 6, 7]]),
        (STRIP, [[5, 6, 7], [6, 8, 7], [7, 8, 9]]),
        (FAN, [[6, 7, 5], [7, 8, 5], [8, 9, 5]]),
    ],
)
def test_triangles_are_assembled_as_in_the_standard(mode, expected):
    np.testing.assert_array_equal(assemble_triangles(np.arange(5, 10), mode), expected)
    assert assemble_triangles(np.arange(2), mode).shape == (0, 3)


def test_triangles_of_a_flat_strip_have_the_same_orientation(read):
    file = Gltf.of_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 2, 0]])
    file.json["meshes"][0]["primitives"][0]["mode"] = STRIP
    result, _ = read(file)
    a, b, c = np.moveaxis(result.vertices[0][result.faces], 1, 0)
    np.testing.assert_array_equal(np.cross(b - a, c - a), [[0, 0, 1]] * 3)


@pytest.mark.parametrize("mode", [0, 1, 2, 3])
def test_points_and_lines_are_left_out_and_noted(read, mode):
    result, notes = read(two_primitives(mode=mode))
    assert result.n_verts == 3
    assert notes == ["left out: points and lines: 1 of 2 primitives of mesh 0"]


def test_load_rejects_a_file_with_only_points(read):
    file = Gltf.of_mesh()
    file.json["meshes"][0]["primitives"][0]["mode"] = 0
    with pytest.raises(FormatError, match="contains no triangle mesh"):
        read(file)


def test_quantized_positions_are_decoded(read):
    file = Gltf()
    mesh = file.mesh(TRIANGLE)
    grid = np.array([[-127, 0, 127], [127, 0, 0], [0, 127, 0]])
    normalized = file.accessor(grid, "i1", normalized=True)
    file.json["meshes"][mesh]["primitives"][0]["attributes"]["POSITION"] = normalized
    file.node(mesh=mesh, scale=[2, 2, 2], translation=[1, 0, 0])
    file.json["extensionsRequired"] = ["KHR_mesh_quantization"]
    result, _ = read(file)
    np.testing.assert_array_equal(result.vertices[0], grid / 127 * 2 + [1, 0, 0])
    del file.json["accessors"][normalized]["normalized"]
    np.testing.assert_array_equal(read(file)[0].vertices[0], grid * 2 + [1, 0, 0])


@pytest.mark.parametrize("n_targets", [(1, 2), (2, 1), (0, 1)])
def test_load_rejects_primitives_that_differ_in_morph_targets(read, n_targets):
    file = Gltf()
    primitives = []
    for count in n_targets:
        number = file.mesh(TRIANGLE, [0, 1, 2], [shifted(TRIANGLE, 1)] * count)
        primitives += file.json["meshes"][number]["primitives"]
    file.json["meshes"] = [{"primitives": primitives}]
    file.node(mesh=0)
    with pytest.raises(FormatError, match=r"primitives have [01] or [12] morph targets; expected"):
        read(file)


integer_targets = partial(morphs.integer_targets, are_floats=False)

RNG = np.random.default_rng(5)


def fields(n_targets=6, size=900):
    return RNG.uniform(-1, 1, (n_targets, size)).astype(np.float32)


def test_integer_targets_are_int16_without_allowed_noise():
    assert integer_targets(fields(), np.ones(6), 0.0).levels.tolist() == [SHORT] * 6


def test_small_targets_are_int8_within_the_allowed_noise():
    max_weights = np.array([1.0, 1e-3, 0.5, 2e-3, 1e-3, 0.1])
    result = integer_targets(fields(), max_weights, 3.5e-4)
    steps = max_weights / np.abs(result.integers).max(axis=1)
    np.testing.assert_allclose(steps, steps[0], rtol=0.5)
    assert result.levels.tolist() == [SHORT, BYTE, SHORT, BYTE, BYTE, SHORT]


def test_rounding_error_of_targets_stays_below_the_noise():
    exact, max_weights = 0.3 * fields(), np.full(6, 0.7)
    noise = 0.7 * 0.3 * 1.5 / BYTE
    for are_floats in (False, True):
        result = morphs.integer_targets(exact.copy(), max_weights, noise, are_floats=are_floats)
        scales = np.abs(exact).max(axis=1) / np.abs(result.values).max(axis=1)
        errors = (result.values * scales[:, None] - exact) * max_weights[:, None]
        distances = np.linalg.norm(errors.sum(axis=0).reshape(-1, 3), axis=1)
        assert np.sqrt((distances**2).mean()) < 1.02 * noise


def test_integer_targets_of_a_zero_field_are_zero():
    result = integer_targets(np.zeros((2, 9), np.float32), np.ones(2), 0.1)
    assert not result.values.any()


def test_best_weights_recover_the_weights_of_frames():
    targets = integer_targets(fields(), np.ones(6), 0.0)
    weights = RNG.standard_normal((20, 6)).astype(np.float32)
    np.testing.assert_allclose(best_weights(targets, weights @ targets.values), weights, atol=1e-5)


def test_best_weights_are_finite_for_equal_targets():
    targets = integer_targets(np.ones((2, 30), np.float32), np.ones(2), 0.0)
    weights = best_weights(targets, np.full((4, 30), 3, np.float32))
    np.testing.assert_allclose(weights @ targets.values, 3, rtol=1e-5)


def test_project_multiplies_matrices_in_pieces():
    vectors, frames = RNG.random((5, 3), np.float32), RNG.random((5, 20_000), np.float32)
    np.testing.assert_allclose(project(vectors, frames), vectors.T @ frames, rtol=1e-5)


POSITIONS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1]])
FACES = np.array([[0, 1, 2], [0, 2, 3], [0, 1, 4], [1, 2, 4]])
UV = np.array([[0, 0], [0.5, 0], [0.5, 0.5], [0, 0.5], [0.25, 0.25]], np.float32)


def packed(**options):
    """Return a glTF file with one Draco-compressed mesh, and its extension for modification."""
    data = DracoPy.encode(
        POSITIONS.astype(np.float32), FACES, quantization_bits=16, generic_attributes={7: UV},
        **options,
    )  # fmt: skip
    decoded = DracoPy.decode(data)
    [position_id] = [
        attribute["unique_id"]
        for attribute in decoded.attributes
        if attribute["attribute_type"] == 0
    ]
    file, n_verts = Gltf(), len(decoded.points)
    attributes = {
        "POSITION": file.add("accessors", componentType=5126, count=n_verts, type="VEC3"),
        "TEXCOORD_0": file.add("accessors", componentType=5126, count=n_verts, type="VEC2"),
    }
    extension = {
        "bufferView": file.view(data),
        "attributes": {"POSITION": position_id, "TEXCOORD_0": 7},
    }
    primitive = {
        "attributes": attributes,
        "indices": file.add("accessors", componentType=5125, count=FACES.size, type="SCALAR"),
        "extensions": {"KHR_draco_mesh_compression": extension},
    }
    file.node(mesh=file.add("meshes", primitives=[primitive]))
    file.json["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    return file, extension


def corner_values(sequence):
    """Return positions and UVs of all corners, independent of the order of faces and corners."""
    [uv] = sequence.surface.attributes
    positions = sequence.vertices[0][sequence.faces]
    values = uv.per_item()
    of_corners = values[sequence.faces] if uv.domain == "vertex" else values.reshape(-1, 3, 2)
    rows = np.concatenate([positions, of_corners], axis=2)
    sorted_corners = [np.roll(row, -np.lexsort(row.T[::-1])[0], axis=0) for row in rows]
    return np.array(sorted(np.round(row, 3).ravel().tolist() for row in sorted_corners))


@pytest.mark.parametrize("options", [{}, {"preserve_order": True}, {"compression_level": 10}])
def test_load_reads_a_draco_mesh(tmp_path, options):
    file, _ = packed(**options)
    loaded = load(file.save(tmp_path / "a.glb"))
    plain = Gltf()
    uv = plain.accessor(UV)
    plain.node(mesh=plain.mesh(POSITIONS, FACES, attributes={"TEXCOORD_0": uv}))
    expected = load(plain.save(tmp_path / "b.glb"))
    assert (loaded.n_verts, loaded.n_faces) == (5, 4)
    np.testing.assert_allclose(corner_values(loaded), corner_values(expected), rtol=0, atol=1e-4)


def announce(key, index, count):
    def change(file, extension):
        file.json["accessors"][index][key] = count

    return change


def cut(file, extension):
    file.json["bufferViews"][0]["byteLength"] = 30


def other_id(file, extension):
    extension["attributes"]["TEXCOORD_0"] = 9


def no_mesh(file, extension):
    file.data[0] ^= 1


def ends_in_head(file, extension):
    file.json["bufferViews"][0]["byteLength"] = 12


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (announce("count", 0, 3), "the file declares 3 and 4"),
        (announce("count", 2, 9), "the file declares .* and 3"),
        (
            announce("type", 1, "VEC3"),
            r"the Draco stream has values of shape \(\d+, 2\) for accessor 1",
        ),
        (cut, "Draco cannot decode it"),
        (other_id, "the Draco stream has no values for accessor 1"),
        (no_mesh, "is not a triangle mesh of Draco"),
        (ends_in_head, "ends within the header of its Draco stream"),
    ],
)
def test_load_describes_what_is_wrong_with_a_draco_stream(tmp_path, change, message):
    file, extension = packed()
    change(file, extension)
    with pytest.raises(FormatError, match=rf"mesh 0, primitive 0, .*{message}"):
        load(file.save(tmp_path / "a.glb"))
