"""Valid USD names and paths for parts and groups."""

import pytest

from meshreel.formats.scenes.parts import unique_name
from meshreel.formats.usd.material_writing import prim_name
from meshreel.formats.usd.writing import mesh_paths


@pytest.mark.parametrize(
    ("name", "expected"),
    [("body", "body"), ("arm.L", "arm_L"), ("3d", "_3d"), ("", "mesh"), ("a b:c", "a_b_c")],
)
def test_prim_name_replaces_forbidden_characters(name, expected):
    assert prim_name(name) == expected


def test_unique_name_appends_numbers():
    used = set()
    assert [unique_name(name, used) for name in ("a", "a", "a_2", "a")] == [
        "a",
        "a_2",
        "a_2_2",
        "a_3",
    ]


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["grid"], ["/scene/grid"]),
        (["/root/a", "/root/b/c"], ["/root/a", "/root/b/c"]),
        (["/a/x", "/b/x"], ["/scene/a/x", "/scene/b/x"]),
        (["a", "a"], ["/scene/a", "/scene/a_2"]),
        (["/r/a", "/r/a/b", "/r/a"], ["/r/a/a", "/r/a/b", "/r/a/a_2"]),
        (["/r/a/a", "/r/a"], ["/r/a/a", "/r/a/a_2"]),
        (["/r/a b", "/r/a_b"], ["/r/a_b", "/r/a_b_2"]),
        (["", "/"], ["/scene/mesh", "/scene/mesh_2"]),
    ],
)
def test_mesh_paths_are_unique_and_below_one_root(names, expected):
    assert mesh_paths(names, "scene") == expected
