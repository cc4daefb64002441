import numpy as np
import pytest

from meshreel.errors import FormatError
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
