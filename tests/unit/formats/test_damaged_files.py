"""Reading damaged files gives a sequence or a meshreel error, never another exception."""

import DracoPy
import numpy as np
import pytest

from meshreel.formats.load import load
from meshreel.operations.save import save
from samples.costs import slow_but
from samples.datasets import positions_of, read_damaged, surfaced_sequence
from samples.meshes import waving_grid
from samples.opening import open_source

pytestmark = pytest.mark.damaged

MIXED_FACES = "4 0 1 2 3\n3 3 1 2\n"
SQUARE = "0 0 0\n1 0 0\n1 1 0\n0 1 0.5\n"
TEXTS = {
    "groups.obj": (
        "# a\no b\nv 0 0 0 1\nv 1 0 0\nvn 0 0 1\nv 1 1 0\nv 0 1 .5\ng c\n"
        "f 1//1 2//1 \\\n3//1 4//1\nf -4/1/1 -2 -1\n"
    ),
    "colours.off": "COFF\n4 2 0\n" + SQUARE + "4 0 1 2 3 0.5 1 0\n3 3 1 2\n",
    "text.ply": (
        "ply\nformat ascii 1.0\ncomment x\nelement vertex 4\nproperty float x\nproperty float y\n"
        "property double z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
        + SQUARE
        + MIXED_FACES
    ),
    "text.stl": (
        "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
        "endloop\nendfacet\nendsolid x\n"
    ),
}


def binary_ply(encoding):
    """Return the square of the text file with binary numbers."""
    order = "<" if encoding == "binary_little_endian" else ">"
    header = TEXTS["text.ply"].split("end_header")[0].replace("ascii", encoding)
    header = header.replace("double z", "float z") + "end_header\n"
    vertices = np.array(SQUARE.split(), dtype=order + "f4").tobytes()
    faces = b"".join(
        np.uint8(len(face)).tobytes() + np.array(face, dtype=order + "i4").tobytes()
        for face in [[0, 1, 2, 3], [3, 1, 2]]
    )
    return header.encode() + vertices + faces


def draco():
    grid = waving_grid(1)
    faces, uv = grid.faces.astype(np.uint32), grid.vertices[0, :, :2].astype(np.float64)
    return DracoPy.encode(grid.vertices[0], faces, tex_coord=uv)


FILES = {
    **{name: text.encode() for name, text in TEXTS.items()},
    **{f"{name}.ply": binary_ply(name) for name in ("binary_little_endian", "binary_big_endian")},
    "grid.drc": draco(),
}
READERS = (load, lambda path: positions_of(open_source(path)))
SAVED = ["a.obj", "a.ply", "a.off", "a.stl", "a.npz", "a.pc2", "a.mdd"]


@pytest.mark.parametrize("name", [*FILES, *SAVED])
def test_damaged_files_raise_only_meshreel_errors(tmp_path, make_sequence, name):
    path = tmp_path / name
    if name in FILES:
        path.write_bytes(FILES[name])
    else:
        save(make_sequence(1), path)
    load(path)  # the undamaged file must be readable, or the test is meaningless
    read_damaged(path, 300, readers=READERS)


@pytest.mark.parametrize(
    ("name", "n_header"),
    slow_but([("a.npz", 1 << 20)], [("a.npz", 1 << 20), ("a.h5", 3000), ("a.vtkhdf", 20_000)]),
)
def test_damaged_surfaces_raise_only_meshreel_errors(tmp_path, name, n_header):
    if name != "a.npz":
        pytest.importorskip("h5py")
    [path] = save(surfaced_sequence(), tmp_path / name)
    read_damaged(path, 150, n_header=n_header, readers=READERS)
