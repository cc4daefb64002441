import struct

import numpy as np
import pytest
import trimesh

from meshreel.errors import FormatError
from meshreel.formats.load import load
from meshreel.formats.meshes.ply import cut_strips, parse_ply

GRID = np.array([[x, y, 0.0] for y in range(3) for x in range(4)], np.float32)
STRIPS = [0, 4, 1, 5, 2, 6, 3, 7, -1, 4, 8, 5, 9, 6, 10, 7, 11]
"""Two rows of the grid, seen from below."""


def ply(lists, faces=(), encoding="binary_little_endian"):
    """A file of triangle strips, each list in a row of its own."""
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
    return cut_strips(lengths, np.array([vertex for one in lists for vertex in one])).tolist()


def test_strips_alternate_when_they_are_cut():
    assert cut([5, 6, 7, 8, 9]) == [[5, 6, 7], [6, 8, 7], [7, 8, 9]]


@pytest.mark.parametrize("lists", [([0, 1, 2, 3, -1, 4, 5, 6],), ([0, 1, 2, 3], [4, 5, 6])])
def test_strips_begin_anew_when_there_is_a_restart_or_another_list(lists):
    assert cut(*lists) == [[0, 1, 2], [1, 3, 2], [4, 5, 6]]


@pytest.mark.parametrize(
    "lists", [([-1, -1],), ([0, 1],), ([0, -1, 1, -1, 2],), ([],), ([0, 1], [2]), ([0, 1, -1, 2],)]
)
def test_strips_have_no_triangles_when_they_are_short(lists):
    assert cut(*lists) == []


@pytest.mark.parametrize("encoding", ["binary_little_endian", "binary_big_endian"])
def test_load_gives_faces_of_one_side_when_a_file_has_strips(tmp_path, encoding):
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


def test_strips_are_cut_as_trimesh_cuts_them_when_there_are_many():
    rng = np.random.default_rng(5)
    strips = [rng.permutation(40)[:size] for size in rng.integers(3, 12, 30)]
    row = [vertex for one in strips for vertex in (*one, -1)]

    def turned(faces):
        return [np.roll(face, -int(np.argmin(face))).tolist() for face in faces]

    assert turned(cut(row)) == turned(trimesh.util.triangle_strips_to_faces(strips))


def test_load_leaves_out_strips_when_there_are_faces_too(tmp_path):
    path = tmp_path / "a.ply"
    path.write_bytes(ply([STRIPS], faces=[(0, 1, 2)]))
    notes = []
    assert load(path, notes=notes).faces.tolist() == [[0, 1, 2]]
    assert notes == ["left out: elements: tristrips"]


@pytest.mark.parametrize(("strip", "message"), [([0, 1, 99], "vertex 99"), ([0, 1, -2], "-2")])
def test_parse_ply_names_the_vertex_when_a_strip_has_one_that_is_not_there(strip, message):
    with pytest.raises(FormatError, match=message):
        parse_ply(ply([strip]))
