import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.load import load
from samples.gltf import SQUARE, SQUARE_FACES, Gltf, moving_triangle


@pytest.fixture
def read(tmp_path):
    """Load a file; gives the sequence and the notes."""

    def loaded(file, **options):
        notes = []
        return load(file.save(tmp_path / "a.glb"), notes=notes, **options), notes

    return loaded


def family():
    """A square below node 1, "hand", which is 5 to the right of an arm that goes 1 to the right."""
    file = Gltf()
    square = file.node(is_root=False, mesh=file.mesh(SQUARE, SQUARE_FACES), name="square")
    hand = file.node(is_root=False, children=[square], translation=[5, 0, 0], name="hand")
    arm = file.node(children=[hand])
    file.animate(arm, "translation", [0, 1], [[0, 0, 0], [1, 0, 0]])
    return file


def test_load_takes_the_scene_that_the_file_shows_when_there_are_several(read):
    file = family()
    file.node(mesh=file.mesh(), translation=[0, 0, 9])
    file.json["scenes"] = [{"nodes": [2]}, {"nodes": [3]}]
    file.json["scene"] = 1
    assert read(file)[0].vertices[0, 0].tolist() == [0, 0, 9]


def test_load_takes_every_node_when_the_file_has_no_scene(read):
    file = moving_triangle()
    del file.json["scenes"], file.json["scene"]
    assert read(file)[0].n_frames == 3


def test_load_keeps_the_transforms_above_when_the_scene_lists_a_node_below_others(read):
    file = family()
    file.json["scenes"][0]["nodes"] = [1]
    found, [note] = read(file)
    assert note == (
        "scene 0 lists nodes that are below others: hand; each is shown once, under the "
        "transforms of all nodes above it"
    )
    np.testing.assert_array_equal(found.vertices[:, 0], [[5, 0, 0], [6, 0, 0]])


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 0, 0, 2), (1, 2)])
def test_load_shows_a_mesh_once_when_the_scene_lists_nodes_above_it_too(read, order):
    file = family()
    file.json["scenes"][0]["nodes"] = list(order)
    assert read(file)[0].n_faces == 2


def test_load_says_nothing_when_the_scene_lists_roots_only(read):
    assert read(family())[1] == []


def test_load_is_quick_when_the_scene_lists_every_node_of_a_deep_tree(read):
    file, depth = Gltf(), 20_000
    file.json["nodes"] = [{"children": [number + 1]} for number in range(depth - 1)] + [{}]
    file.json["nodes"][10]["mesh"] = file.mesh()
    file.json["scenes"] = [{"nodes": list(range(depth))[::-1]}]
    found, [note] = read(file)
    assert found.n_faces == 1
    assert note.endswith("node 19992 and 19991 more; each is shown once, under the transforms of "
                         "all nodes above it")  # fmt: skip


def test_load_says_that_the_scene_shows_none_when_meshes_are_outside_it(read):
    file = family()
    file.json["scenes"] = [{"nodes": []}, {"nodes": [2]}]
    with pytest.raises(FormatError, match=r"a\.glb: scene 0, .* nodes outside it have: square; "):
        read(file)


def test_load_says_that_no_node_shows_a_mesh_when_none_does(read):
    file = moving_triangle()
    del file.json["nodes"][0]["mesh"]
    with pytest.raises(FormatError, match="holds 1 mesh of triangles, but no node shows one"):
        read(file)


def test_load_says_that_there_are_no_triangles_when_meshes_are_lines(read):
    file = moving_triangle()
    file.json["meshes"][0]["primitives"][0]["mode"] = 1
    with pytest.raises(FormatError, match="holds no mesh of triangles; points and lines are not"):
        read(file)
