import numpy as np
import pytest

from meshreel.formats.gltf.node_tree import NodeTree, path_of
from meshreel.formats.gltf.placement import NOWHERE, Placement


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
def test_path_of_has_several_steps_when_the_name_is_a_path(name, path):
    assert path_of(name) == path


def test_add_makes_the_nodes_above_once_when_meshes_share_them():
    tree = NodeTree()
    numbers = [tree.add(f"/root/{name}", mesh, NOWHERE) for mesh, name in enumerate("ab")]
    assert (numbers, tree.roots) == ([1, 2], [0])
    assert tree.nodes == [
        {"name": "root", "children": [1, 2]},
        {"name": "a", "mesh": 0},
        {"name": "b", "mesh": 1},
    ]


def test_add_undoes_the_placement_above_when_a_mesh_is_under_another():
    tree = NodeTree()
    tree.add("/root", 0, box(1.0, 4.0))
    tree.add("/root/hand", 1, box(3.0, 2.0))
    assert tree.nodes == [
        {"name": "root", "mesh": 0, "translation": [1, 0, 0], "scale": [4, 4, 4], "children": [1]},
        {"name": "hand", "mesh": 1, "translation": [0.5, 0, 0], "scale": [0.5, 0.5, 0.5]},
    ]


def test_add_makes_a_node_of_each_mesh_when_they_have_one_name():
    tree = NodeTree()
    assert [tree.add("twin", mesh, NOWHERE) for mesh in (0, 1)] == tree.roots == [0, 1]
