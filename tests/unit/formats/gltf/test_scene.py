import numpy as np
import pytest

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.gltf.container import IDENTITY, NodeTree, Placement, path_of
from meshreel.formats.gltf.morphs import check_range, place_frames, place_static
from samples.gltf import SQUARE, SQUARE_FACES, Gltf, moving_triangle


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
    result, notes = read(file)
    assert result.n_faces == 1
    assert notes[0].endswith(
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
    mean = frames.mean(axis=0, dtype=np.float64)
    for are_floats, one in ((True, 1), (False, 32767)):
        placement, base, displacements = place_frames(frames, mean, are_floats=are_floats)
        placed = base / one + displacements.reshape(7, 3, 40).transpose(0, 2, 1)
        world = placed * placement.scale + placement.offset
        np.testing.assert_allclose(world, frames, atol=3e-7 * placement.scale)
        assert np.abs(base).max() <= one


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
    check_range(np.array([-8.5e37, 0, 0]), np.array([8.5e37, 0, 0]))
    for low, high in ((-8.6e37, 1), (-1, 8.6e37)):
        with pytest.raises(InvalidInputError, match=r"up to 8.5e\+37; got 8.6e\+37; scale"):
            check_range(np.array([0, low, 0]), np.array([1, high, 0]))


INSTANCES = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0}}}


def test_a_mesh_with_instances_is_read_once_with_a_note(read):
    file = Gltf()
    file.node(mesh=file.mesh(), extensions=INSTANCES, name="tree")
    result, notes = read(file)
    assert result.n_faces == 1
    note = "left out: copies of a mesh (EXT_mesh_gpu_instancing), which is read once: tree"
    assert notes == [note]


def test_load_refuses_a_file_that_requires_instances(read):
    file = Gltf()
    file.json["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]
    file.node(mesh=file.mesh(), extensions=INSTANCES)
    with pytest.raises(FormatError, match="unsupported extension EXT_mesh_gpu_instancing"):
        read(file)
