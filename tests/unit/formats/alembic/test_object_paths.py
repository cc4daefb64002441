import pytest

from meshreel.formats.alembic.write import object_paths


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["/root/body"], ["root/body"]),
        (["body"], ["body/body"]),
        (["", "//"], ["mesh/mesh", "mesh/mesh_2"]),
        (["/a/b", "/a/c"], ["a/b", "a/c"]),
        (["/a/b", "/a/b"], ["a/b", "a/b_2"]),
        (["/a/b", "/a/b/c"], ["a/b/b", "a/b/c"]),
        (["/a/b/b", "/a/b"], ["a/b/b", "a/b/b_2"]),
        (["a", "/a/a"], ["a/a", "a/a_2"]),
    ],
)
def test_object_paths_are_unique_and_have_a_transform(names, expected):
    assert ["/".join(path) for path in object_paths(names)] == expected
