import struct

import numpy as np
import pytest
import trimesh

from meshreel.errors import FormatError
from meshreel.formats.load import load
from meshreel.formats.meshes.ply import read_ply, split_strips

GRID = np.array([[x, y, 0.0] for y in range(3) for x in range(4)], np.float32)
STRIPS = [0, 4, 1, 5, 2, 6, 3, 7, -1, 4, 8, 5, 9, 6, 10, 7, 11]
"""Two rows of the grid, clockwise as seen from above."""


def ply(lists, faces=(), encoding="binary_little_endian"):
    """A PLY file with one row of triangle strips for each list."""
    order = ">" if encoding.endswith("big_endian") else "<"
    lines = [
        "ply", f"format {encoding} 1.0", f"element vertex {len(GRID)}", "property float x",
        "property float y", "property float z", "property uchar red", "property uchar green",
        "property uchar blue", f"element face {len(faces)}",
        "property list uchar int vertex_indices", f"element tristrips {len(lists)}",
        "property list int int vertex_indices", "end_header", "",
    ]  # fmt: skip
    rows = b"".join(struct.pack(f"{order}3f3B", *row, 1, 2, 3) for row in GRID)
    rows += b"".join(struct.pack(f"{order}B3i", 3, *face) for face in faces)
    rows += b"".join(struct.pack(f"{order}i{len(one)}i", len(one), *one) for one in lists)
    return "\n".join(lines).encode() + rows


def cut(*lists):
    lengths = np.array([len(one) for one in lists], np.int64)
    return split_strips(lengths, np.array([vertex for one in lists for vertex in one])).tolist()


def test_strip_triangles_have_consistent_orientation():
    assert cut([5, 6, 7, 8, 9]) == [[5, 6, 7], [6, 8, 7], [7, 8, 9]]


@pytest.mark.parametrize("lists", [([0, 1, 2, 3, -1, 4, 5, 6],), ([0, 1, 2, 3], [4, 5, 6])])
def test_restart_or_new_list_begins_a_strip(lists):
    assert cut(*lists) == [[0, 1, 2], [1, 3, 2], [4, 5, 6]]


@pytest.mark.parametrize(
    "lists", [([-1, -1],), ([0, 1],), ([0, -1, 1, -1, 2],), ([],), ([0, 1], [2]), ([0, 1, -1, 2],)]
)
def test_short_strips_have_no_triangles(lists):
    assert cut(*lists) == []


@pytest.mark.parametrize("encoding", ["binary_little_endian", "binary_big_endian"])
def test_faces_of_strips_point_to_one_side(tmp_path, encoding):
    path = tmp_path / "a.ply"
    path.write_bytes(ply([STRIPS], encoding=encoding))
    notes = []
    found = load(path, notes=notes)
    corners = found.vertices[0][found.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    np.testing.assert_array_equal(normals, [[0, 0, -1]] * 12)
    assert notes == []
    [color] = found.surface.attributes
    assert color.values.tolist() == [[1, 2, 3]] * 12


def test_strip_triangles_equal_those_of_trimesh():
    rng = np.random.default_rng(5)
    strips = [rng.permutation(40)[:size] for size in rng.integers(3, 12, 30)]
    row = [vertex for one in strips for vertex in (*one, -1)]

    def canonical(faces):
        return [np.roll(face, -int(np.argmin(face))).tolist() for face in faces]

    assert canonical(cut(row)) == canonical(trimesh.util.triangle_strips_to_faces(strips))


def test_strips_beside_faces_are_left_out_with_a_note(tmp_path):
    path = tmp_path / "a.ply"
    path.write_bytes(ply([STRIPS], faces=[(0, 1, 2)]))
    notes = []
    assert load(path, notes=notes).faces.tolist() == [[0, 1, 2]]
    assert notes == ["left out: elements: tristrips"]


@pytest.mark.parametrize(("strip", "message"), [([0, 1, 99], "vertex 99"), ([0, 1, -2], "-2")])
def test_error_names_the_invalid_vertex_of_a_strip(strip, message):
    with pytest.raises(FormatError, match=message):
        read_ply(ply([strip]))
