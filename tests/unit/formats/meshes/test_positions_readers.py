"""Functions that read only the positions of further frames agree with the full parsers."""

import numpy as np
import pytest

from meshreel.errors import MeshReelError
from meshreel.formats.load import load
from meshreel.formats.registry import FRAME_FORMATS
from meshreel.formats.save import save
from meshreel.model.surface import Kind
from meshreel.model.surface_selection import differing_names
from samples.datasets import damaged_versions
from samples.surfaces import attribute, rich_cube, two_cubes

EXTENSIONS = [
    form.extension for form in FRAME_FORMATS.values() if form.positions_reader is not None
]


def files_of(folder, extension):
    """Two encoded frames of each sample: plain, colored, in two parts, and float64."""
    colors = [attribute(Kind.COLOR, "vertex", 3), attribute(Kind.UV, "corner", 2, rows=9)]
    for index, sequence in enumerate(
        (
            rich_cube(2),
            rich_cube(2, attributes=colors),
            two_cubes(2),
            rich_cube(2, dtype=np.float64),
        )
    ):
        paths = save(sequence, folder / f"{index}_%d{extension}")
        yield [path.read_bytes() for path in paths]


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_positions_reader_agrees_with_parse(tmp_path, extension):
    result = FRAME_FORMATS[extension]
    for first, second in files_of(tmp_path, extension):
        frame = result.read(first)
        positions = result.positions_reader(first, frame)(second)
        if extension == ".obj" and (frame.surface.of_kind(Kind.COLOR) or frame.surface.parts):
            assert positions is None
            continue
        np.testing.assert_array_equal(positions, result.read(second).mesh.vertices, strict=True)


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_positions_reader_never_misreads_damaged_files(tmp_path, extension):
    result = FRAME_FORMATS[extension]
    for first, second in files_of(tmp_path, extension):
        frame = result.read(first)
        read = result.positions_reader(first, frame)
        for data in damaged_versions(second, 600, n_header=len(second)):
            if (positions := read(data)) is not None:
                whole = result.read(data)
                np.testing.assert_array_equal(positions, whole.mesh.vertices, strict=True)
                assert whole.mesh.has_faces_of(frame.mesh)
                assert differing_names(whole.surface, frame.surface) == []
                assert whole.fields.keys() == frame.fields.keys()


FIRST = (
    b"# frame 1\nmtllib one.mtl\no a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 2\nv 1 0 2\nv 0 1 2\n"
    b"vt 0 0\nvn 0 0 1\nusemtl m\nf 1/1/1 2/1/1 3/1/1\nf 4 5 6\n"
)
OBJ = FRAME_FORMATS[".obj"]


@pytest.mark.parametrize(
    "change",
    [
        (b"frame 1", b"frame no. 2"),
        (b"one.mtl", b"another.mtl"),
        (b"v 0 0 2", b"v -0.123 1e-5 17.25"),
    ],
)
def test_obj_positions_reader_accepts_changes_of_positions_and_comments(change):
    second = FIRST.replace(*change)
    positions = OBJ.positions_reader(FIRST, OBJ.read(FIRST))(second)
    np.testing.assert_array_equal(positions, OBJ.read(second).mesh.vertices, strict=True)


@pytest.mark.parametrize(
    "change",
    [
        (b"vn 0 0 1", b"vn 0.5 0.5 0.5"),
        (b"usemtl m", b"usemtl no"),
        (b"v 0 0 2\n", b"o b\nv 0 0 2\n"),
        (b"o a\n", b"o b\n"),
        (b"v 0 0 2\n", b"v 0 0 2 1 1 1\n"),
        (b"f 4 5 6\n", b"f 4 5 6 1\n"),
        (b"f 4 5 6\n", b"f 4 5 6\nf 1 2 3\n"),
        (b"f 4 5 6\n", b"f 4 5 6\nf\t1 2 3\n"),
        (b"f 4 5 6\n", b""),
        (b"mtllib one.mtl\n", b" f 1 2 3\n"),
        (b"vt 0 0\n", b""),
        (b"v 0 1 2\n", b"v 0 1 2 \\\n"),
        (b"v 0 1 2\n", b"v 0 1 2\nv 0 1 3\n"),
        (b"v 0 1 2\n", b"v 0 1 x\n"),
        (b"v 0 1 2\n", b"v 0 1\n"),
    ],
)
def test_obj_positions_reader_gives_none_for_other_files(change):
    assert OBJ.positions_reader(FIRST, OBJ.read(FIRST))(FIRST.replace(*change)) is None


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_error_names_a_damaged_later_frame(tmp_path, extension):
    save(rich_cube(3), tmp_path / f"f_%d{extension}")
    path = tmp_path / f"f_1{extension}"
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(MeshReelError, match=rf"f_1\{extension}"):
        load(tmp_path)
