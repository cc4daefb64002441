"""Reading damaged files gives a sequence or a meshreel error, never another exception."""

import contextlib

import DracoPy
import numpy as np
import pytest

from meshreel.errors import MeshReelError
from meshreel.formats.load import load
from meshreel.formats.save import save
from samples.costs import draws
from samples.meshes import waving_grid
from samples.opening import open_source

N_DAMAGED = draws(300)

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


def damaged_versions(data, rng):
    """Random truncations, changed bytes, removed and duplicated ranges."""
    for index in range(N_DAMAGED):
        damaged = bytearray(data)
        begin, end = sorted(rng.integers(0, len(data) + 1, 2))
        match index % 4:
            case 0:
                del damaged[begin:]
            case 1:
                for place in rng.integers(0, len(data), rng.integers(1, 4)):
                    damaged[place] = rng.integers(256)
            case 2:
                damaged[begin:end] = damaged[begin:end] * 2
            case 3:
                # Header bytes matter most: change one to another plausible byte.
                damaged[rng.integers(min(len(data), 200))] = rng.choice(
                    list(b"0123456789-. \n#eln")
                )
        yield bytes(damaged)


def only_our_errors_come(path, data):
    path.write_bytes(data)
    load(path)  # the undamaged file must be readable, or the test is meaningless
    for damaged in damaged_versions(data, np.random.default_rng(len(data))):
        path.write_bytes(damaged)
        with contextlib.suppress(MeshReelError):
            load(path)
        with contextlib.suppress(MeshReelError):
            opened = open_source(path)
            opened.read(0, opened.n_frames)
    return True


@pytest.mark.parametrize("name", ["a.obj", "a.ply", "a.off", "a.stl", "a.npz"])
def test_damaged_files_of_meshreel_raise_only_meshreel_errors(tmp_path, make_sequence, name):
    [path] = save(make_sequence(1), tmp_path / name)
    assert only_our_errors_come(path, path.read_bytes())


@pytest.mark.parametrize("name", TEXTS)
def test_damaged_text_files_raise_only_meshreel_errors(tmp_path, name):
    assert only_our_errors_come(tmp_path / name, TEXTS[name].encode())


def test_damaged_draco_files_raise_only_meshreel_errors(tmp_path):
    grid = waving_grid(1)
    faces, uv = grid.faces.astype(np.uint32), grid.vertices[0, :, :2].astype(np.float64)
    data = DracoPy.encode(grid.vertices[0], faces, tex_coord=uv)
    assert only_our_errors_come(tmp_path / "a.drc", data)


@pytest.mark.parametrize("encoding", ["binary_little_endian", "binary_big_endian"])
def test_damaged_binary_files_raise_only_meshreel_errors(tmp_path, encoding):
    order = "<" if encoding.startswith("binary_l") else ">"
    header = TEXTS["text.ply"].split("end_header")[0].replace("ascii", encoding)
    header = header.replace("double z", "float z") + "end_header\n"
    vertices = np.array(SQUARE.split(), dtype=order + "f4").tobytes()
    faces = b"".join(
        np.uint8(len(face)).tobytes() + np.array(face, dtype=order + "i4").tobytes()
        for face in [[0, 1, 2, 3], [3, 1, 2]]
    )
    assert only_our_errors_come(tmp_path / "a.ply", header.encode() + vertices + faces)
