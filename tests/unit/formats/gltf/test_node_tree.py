import numpy as np
import pytest

from meshreel.formats.gltf.morphs import IDENTITY, Placement
from meshreel.formats.gltf.write import NodeTree, path_of


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
