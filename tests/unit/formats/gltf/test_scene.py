import tracemalloc

import numpy as np
import pytest

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.gltf.morphs import (
    IDENTITY,
    Placement,
    check_range,
    place_frames,
    place_static,
)
from meshreel.formats.gltf.write import NodeTree, path_of
from meshreel.formats.load import load
from samples.gltf import SQUARE, SQUARE_FACES, TRIANGLE, Gltf, moving_triangle, shifted


def family():
    """Return a square below a node "hand" at x = 5, below a node that moves along x."""
    file = Gltf()
    square = file.node(is_root=False, mesh=file.mesh(SQUARE, SQUARE_FACES), name="square")
    hand = file.node(is_root=False, children=[square], translation=[5, 0, 0], name="hand")
    arm = file.node(children=[hand])
    file.animate(arm, "translation", [0, 1], [[0, 0, 0], [1, 0, 0]])
    return file


def test_load_reads_the_default_scene(read):
    file = family()
    file.node(mesh=file.mesh(), translation=[0, 0, 9])
    file.json["scenes"] = [{"nodes": [2]}, {"nodes": [3]}]
    file.json["scene"] = 1
    assert read(file)[0].vertices[0, 0].tolist() == [0, 0, 9]


def test_load_reads_every_node_of_a_file_without_scenes(read):
    file = moving_triangle()
    del file.json["scenes"], file.json["scene"]
    assert read(file)[0].n_frames == 3


def test_scene_nodes_that_are_not_roots_keep_the_transforms_of_ancestors(read):
    file = family()
    file.json["scenes"][0]["nodes"] = [1]
    result, [note] = read(file)
    assert note == (
        "scene 0 lists nodes that are not roots: hand; each is read once, with the transforms of "
        "all its ancestors"
    )
    np.testing.assert_array_equal(result.vertices[:, 0], [[5, 0, 0], [6, 0, 0]])


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 0, 0, 2), (1, 2)])
def test_mesh_below_several_scene_nodes_is_read_once(read, order):
    file = family()
    file.json["scenes"][0]["nodes"] = list(order)
    assert read(file)[0].n_faces == 2


def test_scene_with_only_roots_has_no_note(read):
    assert read(family())[1] == []


@pytest.mark.slow
def test_scene_that_lists_every_node_of_a_deep_hierarchy_is_read_fast(read):
    file, depth = Gltf(), 20_000
    file.json["nodes"] = [{"children": [number + 1]} for number in range(depth - 1)] + [{}]
    file.json["nodes"][10]["mesh"] = file.mesh()
    file.json["scenes"] = [{"nodes": list(range(depth))[::-1]}]
    result, [note] = read(file)
    assert result.n_faces == 1
    assert note.endswith(
        "node 19992 and 19991 more; each is read once, with the transforms of all its ancestors"
    )


def test_load_names_meshes_outside_of_the_default_scene(read):
    file = family()
    file.json["scenes"] = [{"nodes": []}, {"nodes": [2]}]
    with pytest.raises(
        FormatError, match=r"a\.glb: scene 0, .* nodes outside of it have: square; "
    ):
        read(file)


def test_load_explains_that_no_node_uses_a_mesh(read):
    file = moving_triangle()
    del file.json["nodes"][0]["mesh"]
    with pytest.raises(FormatError, match="contains 1 triangle mesh, but no node uses one"):
        read(file)


def test_load_explains_that_meshes_have_no_triangles(read):
    file = moving_triangle()
    file.json["meshes"][0]["primitives"][0]["mode"] = 1
    with pytest.raises(FormatError, match="contains no triangle mesh; points and lines are not"):
        read(file)


def box(x, scale):
    return Placement(np.array([x, 0.0, 0.0]), scale)


@pytest.mark.parametrize(
    ("name", "path"),
    [
        ("body", ("body",)),
        ("a/b", ("a/b",)),
        ("/root/body", ("root", "body")),
        ("//root//", ("root",)),
        ("", ("mesh",)),
        ("/", ("/",)),
    ],
)
def test_path_of_splits_names_that_start_with_a_slash(name, path):
    assert path_of(name) == path


def test_add_creates_shared_parents_once():
    tree = NodeTree()
    numbers = [tree.add(f"/root/{name}", mesh, IDENTITY) for mesh, name in enumerate("ab")]
    assert (numbers, tree.roots) == ([1, 2], [0])
    assert tree.nodes == [
        {"name": "root", "children": [1, 2]},
        {"name": "a", "mesh": 0},
        {"name": "b", "mesh": 1},
    ]


def test_add_compensates_the_placement_of_the_parent():
    tree = NodeTree()
    tree.add("/root", 0, box(1.0, 4.0))
    tree.add("/root/hand", 1, box(3.0, 2.0))
    assert tree.nodes == [
        {"name": "root", "mesh": 0, "translation": [1, 0, 0], "scale": [4, 4, 4], "children": [1]},
        {"name": "hand", "mesh": 1, "translation": [0.5, 0, 0], "scale": [0.5, 0.5, 0.5]},
    ]


def test_add_creates_a_node_per_mesh_for_equal_names():
    tree = NodeTree()
    assert [tree.add("twin", mesh, IDENTITY) for mesh in (0, 1)] == tree.roots == [0, 1]


RNG = np.random.default_rng(11)


def test_base_and_displacements_of_placed_frames_add_up_to_the_positions():
    frames = 5e3 + RNG.standard_normal((7, 40, 3)) * [1, 20, 3]
    placement, base, displacements = place_frames(frames, frames.mean(axis=0, dtype=np.float64))
    placed = base / 32767 + displacements.reshape(7, 3, 40).transpose(0, 2, 1)
    world = placed * placement.scale + placement.offset
    np.testing.assert_allclose(world, frames, atol=3e-7 * placement.scale)
    assert np.abs(base).max() <= 32767


def test_placement_is_exact_in_float32():
    frames = 0.1 + RNG.standard_normal((3, 9, 3))
    placement, _, _ = place_frames(frames, frames.mean(axis=0, dtype=np.float64))
    for number in (*placement.offset, placement.scale):
        assert np.float32(number) == number


def test_place_static_keeps_float32_positions_exact():
    base = RNG.standard_normal((9, 3)).astype(np.float32)
    placement, rest = place_static(base)
    assert (placement.scale, placement.offset.any()) == (1.0, False)
    np.testing.assert_array_equal(rest, base)


def test_place_static_keeps_float64_detail_far_from_the_origin():
    base = 1e7 + RNG.standard_normal((9, 3))
    placement, rest = place_static(base)
    np.testing.assert_allclose(rest + placement.offset, base, rtol=0, atol=1e-6)


def test_check_range_names_the_largest_coordinate():
    with pytest.raises(InvalidInputError, match=r"stores float32.*got 1e\+39; scale"):
        check_range(np.array([-1e39, 0, 0]), np.zeros(3))


HALF = np.sqrt(0.5)
QUARTER_Z = [0, 0, HALF, HALF]
BAKED = "baked 2 instances, one mesh per node"


def instanced(file, *, more=None, **attributes):
    """Return the extensions of a node with instances; attributes are rows or accessor indices."""
    numbers = {
        name: attribute if isinstance(attribute, int) else file.accessor(attribute)
        for name, attribute in attributes.items()
    }
    return {"EXT_mesh_gpu_instancing": {"attributes": {**numbers, **(more or {})}}}


def test_instances_are_scaled_then_rotated_then_translated(read):
    file = Gltf()
    extensions = instanced(
        file,
        TRANSLATION=[[0, 0, 0], [5, 0, 0]],
        ROTATION=[[0, 0, 0, 1], QUARTER_Z],
        SCALE=[[1, 1, 1], [2, 3, 1]],
    )
    file.node(mesh=file.mesh(), extensions=extensions)
    result, notes = read(file)
    expected = [*TRIANGLE, [5, 0, 0], [5, 2, 0], [2, 0, 0]]
    np.testing.assert_allclose(result.vertices[0], expected, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(result.faces, [[0, 1, 2], [3, 4, 5]])
    assert notes == [BAKED]


@pytest.mark.parametrize("dtype", ["i1", "i2"])
def test_rotations_of_instances_may_be_normalized_integers(read, dtype):
    file, maximum = Gltf(), np.iinfo(dtype).max
    quaternions = [[0, 0, 0, maximum], [0, 0, maximum, 0]]
    rotations = file.accessor(quaternions, dtype, normalized=True)
    file.node(mesh=file.mesh(), extensions=instanced(file, ROTATION=rotations))
    expected = [*TRIANGLE, [0, 0, 0], [-1, 0, 0], [0, -1, 0]]
    np.testing.assert_array_equal(read(file)[0].vertices[0], expected)


def test_instances_move_with_their_node(read):
    file = Gltf()
    extensions = instanced(file, TRANSLATION=[[0, 0, 0], [1, 0, 0]])
    node = file.node(mesh=file.mesh(), extensions=extensions)
    file.animate(node, "scale", [0, 1], [[1, 1, 1], [3, 1, 1]], "STEP")
    file.animate(node, "translation", [0, 1], [[0, 0, 0], [0, 7, 0]])
    result, _ = read(file)
    both = np.concatenate([TRIANGLE, shifted(TRIANGLE, [1, 0, 0])])
    np.testing.assert_array_equal(result.vertices, [both, both * [3, 1, 1] + [0, 7, 0]])


def test_morph_targets_are_transformed_with_each_instance(read):
    file = Gltf()
    mesh = file.mesh(targets=[[[0, 0, 1], [0, 0, 0], [0, 0, 0]]])
    extensions = instanced(file, SCALE=[[1, 1, 1], [1, 1, -2]])
    node = file.node(mesh=mesh, extensions=extensions)
    file.animate(node, "weights", [0, 1], [0, 1])
    result, _ = read(file)
    np.testing.assert_array_equal(result.vertices[1][[0, 3]], [[0, 0, 1], [0, 0, -2]])


@pytest.mark.parametrize("node_scale", [[1, 1, 1], [1, -1, 1]])
def test_faces_of_mirroring_instances_are_reversed(read, node_scale):
    file = Gltf()
    uv = file.accessor([[0, 0], [0.5, 0], [0, 0.25], [1, 1]])
    mesh = file.mesh([*TRIANGLE, TRIANGLE[0]], [0, 1, 2, 3, 2, 1], attributes={"TEXCOORD_0": uv})
    extensions = instanced(file, SCALE=[[1, 1, 1], [-1, 1, 1]])
    file.node(mesh=mesh, extensions=extensions, scale=node_scale)
    result, _ = read(file)
    kept, mirrored = [[0, 1, 2], [0, 2, 1]], [[0, 2, 1], [0, 1, 2]]
    if node_scale[1] < 0:
        kept, mirrored = mirrored, kept
    np.testing.assert_array_equal(result.faces, [*kept, *np.add(mirrored, 3)])
    rows = {0: [0, 1], 1: [0.5, 1], 2: [0, 0.75], 3: [1, 0]}
    split = [[0, 1, 2], [3, 2, 1]], [[0, 2, 1], [3, 1, 2]]
    order = split if node_scale[1] > 0 else split[::-1]
    expected = [rows[one] for faces in order for face in faces for one in face]
    [attribute] = result.surface.attributes
    np.testing.assert_array_equal(attribute.per_item(), expected)


def test_instances_have_the_colors_and_materials_of_the_mesh(read):
    file = Gltf()
    colors = np.arange(9).reshape(3, 3) / 8
    mesh = file.mesh(attributes={"COLOR_0": file.accessor(colors)})
    file.json["meshes"][mesh]["primitives"][0]["material"] = file.add("materials", name="leaf")
    extensions = instanced(file, TRANSLATION=[[0, 0, 0], [5, 0, 0]])
    file.node(mesh=mesh, extensions=extensions)
    result, _ = read(file)
    [attribute], [groups] = result.surface.attributes, result.surface.groups
    np.testing.assert_array_equal(attribute.per_item(), np.tile(colors, (2, 1)))
    assert (groups.labels, groups.numbers.tolist()) == (("leaf",), [0, 0])


def test_load_reads_a_file_that_requires_instancing(read):
    file = Gltf()
    file.json["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]
    extensions = instanced(file, TRANSLATION=[[0, 0, 0], [5, 0, 0]])
    file.node(mesh=file.mesh(), extensions=extensions)
    assert read(file)[0].n_faces == 2


def test_load_notes_attributes_of_instances_that_are_left_out(read):
    file = Gltf()
    number = file.accessor([1, 2])
    extensions = instanced(file, TRANSLATION=[[0, 0, 0], [5, 0, 0]], more={"_ID": number})
    file.node(mesh=file.mesh(), extensions=extensions)
    assert read(file)[1] == [BAKED, "left out: attributes of instances: _ID"]


def test_load_counts_the_instances_of_all_nodes(read):
    file = Gltf()
    extensions = instanced(file, TRANSLATION=[[0, 0, 0], [5, 0, 0]])
    mesh = file.mesh()
    file.node(mesh=mesh, extensions=extensions)
    file.node(mesh=mesh, extensions=extensions, translation=[0, 9, 0])
    result, notes = read(file, merge=True)
    assert notes[0] == "baked 4 instances of 2 nodes, one mesh per node"
    assert [part.n_faces for part in result.surface.parts] == [2, 2]


def test_load_leaves_out_instances_of_skinned_meshes(read):
    file = Gltf()
    joints = file.accessor([[0, 0, 0, 0]] * 3, "u1")
    weights = file.accessor([[1, 0, 0, 0]] * 3)
    mesh = file.mesh(attributes={"JOINTS_0": joints, "WEIGHTS_0": weights})
    skin = file.add("skins", joints=[1])
    extensions = instanced(file, TRANSLATION=[[0, 0, 0], [5, 0, 0]])
    file.node(mesh=mesh, skin=skin, extensions=extensions, name="tail")
    file.node()
    result, notes = read(file)
    assert (result.n_faces, notes) == (1, ["left out: instances of skinned meshes: tail"])


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ({"TRANSLATION": [[0, 0, 0]], "SCALE": [[1, 1, 1]] * 2}, "'count' must be 1, as"),
        ({"TRANSLATION": [[0, 0, 0, 0]]}, "'type' must be VEC3; got 'VEC4'"),
        ({"SCALE": [[1, 1, np.inf]]}, "node 0, .*: the numbers of 'SCALE' must be finite"),
        ({"TRANSLATION": 99}, "'TRANSLATION' must be below"),
    ],
)
def test_load_describes_what_is_wrong_with_instances(read, attributes, message):
    file = Gltf()
    file.node(mesh=file.mesh(), extensions=instanced(file, **attributes))
    with pytest.raises(FormatError, match=message):
        read(file)


@pytest.mark.slow
@pytest.mark.parametrize(("n_instances", "n_verts"), [(1 << 30, 3), (1 << 18, 3000), (1 << 20, 99)])
def test_load_uses_little_memory_for_a_small_file_with_many_instances(
    tmp_path, n_instances, n_verts
):
    file = Gltf()
    zeros = file.add("accessors", componentType=5126, count=n_instances, type="VEC3")
    rng = np.random.default_rng(1)
    mesh = file.mesh(rng.random((n_verts, 3)))
    file.node(mesh=mesh, extensions=instanced(file, TRANSLATION=zeros))
    path = file.save(tmp_path / "a.glb")
    tracemalloc.start()
    try:
        with pytest.raises(FormatError, match=rf"node 0, with {n_instances} instances: .* 1 GiB"):
            load(path)
        assert tracemalloc.get_traced_memory()[1] < 1 << 30
    finally:
        tracemalloc.stop()
