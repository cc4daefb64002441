import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.load import load
from meshreel.formats.meshes.ply import read_ply

LINES = (
    "ply", "format binary_little_endian 1.0", "element vertex 3", "property float x",
    "property float y", "property float z", "element face 1",
    "property list uchar int vertex_indices", "end_header",
)  # fmt: skip
VERTICES = np.array([[0.5, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")
FACE = b"\x03" + np.arange(3, dtype="<i4").tobytes()


def ply(line_end, last=None, lines=LINES, vertices=VERTICES):
    last = line_end if last is None else last
    return line_end.join(lines).encode() + last.encode() + vertices.tobytes() + FACE


@pytest.mark.parametrize(
    ("line_end", "last"), [("\n", "\r\n"), ("\r\n", "\n"), ("\n", "\n"), ("\r", "\r")]
)
def test_last_header_line_may_end_differently(line_end, last):
    mesh = read_ply(ply(line_end, last)).mesh
    assert (mesh.vertices.tobytes(), mesh.corners.tolist()) == (VERTICES.tobytes(), [0, 1, 2])


def test_line_feed_after_a_cr_header_is_data():
    vertices = VERTICES.copy()
    vertices.view(np.uint8)[0, 0] = ord("\n")
    mesh = read_ply(ply("\r", vertices=vertices)).mesh
    assert mesh.vertices.tobytes() == vertices.tobytes()


def test_unknown_header_lines_are_skipped_with_a_note(tmp_path, notes):
    path = tmp_path / "a.ply"
    path.write_bytes(ply("\n", lines=(*LINES[:2], "made by hand", *LINES[2:6], "#", *LINES[6:])))
    loaded = load(path, notes=notes)
    assert loaded.vertices.tobytes() == VERTICES.tobytes()
    assert notes == ["left out: lines of the header: line 3 'made by hand', line 8 '#'"]


@pytest.mark.parametrize("line", ["propetry float w", "element vertex x", "property float"])
def test_misspelled_properties_are_rejected(line):
    with pytest.raises(FormatError, match="line 7: "):
        read_ply(ply("\n", lines=(*LINES[:6], line, *LINES[6:])))


def test_skipped_lines_are_noted_once_for_several_segments(tmp_path, notes):
    lines = (*LINES[:2], "made by hand", *LINES[2:])
    (tmp_path / "0.ply").write_bytes(ply("\n", lines=lines))
    flipped = ply("\n", lines=lines)[: -len(FACE)] + FACE[:1] + np.array([0, 2, 1], "<i4").tobytes()
    (tmp_path / "1.ply").write_bytes(flipped)
    assert load(tmp_path, notes=notes).starts == (0, 1, 2)
    assert notes[0] == "left out: lines of the header: line 3 'made by hand'"
    assert sum("lines of the header" in note for note in notes) == 1
