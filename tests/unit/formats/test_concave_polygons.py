"""Files with concave polygons: the triangles of every output cover them once."""

import numpy as np
import pytest

import meshreel

L_SHAPE = """v 0 2 0\nv 1 2 0\nv 1 1 0\nv 3 1 0\nv 3 0 0\nv 0 0 0\nf 1 6 5 4 3 2\n"""
BOW = "v 0 0 0\nv 2 2 0\nv 2 0 0\nv 0 2 0\nf 1 2 3 4\n"


@pytest.fixture
def l_shape(tmp_path):
    path = tmp_path / "l.obj"
    path.write_text(L_SHAPE)
    return path


def area(sequence):
    a, b, c = np.moveaxis(sequence.vertices[0][sequence.faces].astype(float), 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


@pytest.mark.parametrize("name", ["copy.stl", "copy.glb", "copy.obj", "copy.ply", "copy.npz"])
def test_every_format_stores_the_area_of_a_concave_polygon(l_shape, name):
    (path,) = meshreel.save(meshreel.load(l_shape), l_shape.with_name(name))
    copy = meshreel.load(path)
    assert area(copy) == pytest.approx(4)
    if name not in ("copy.stl", "copy.glb"):
        assert copy.surface.face_sizes.tolist() == [6]


@pytest.mark.parametrize("order", ["keep", "vertices", "drop"])
def test_streams_keep_the_area_of_a_concave_polygon(l_shape, order):
    decoded = meshreel.decode(meshreel.encode(meshreel.load(l_shape), order=order, lossless=True))
    assert area(decoded) == pytest.approx(4)


def test_a_note_counts_polygons_that_cross_themselves(tmp_path, notes):
    (tmp_path / "bow.obj").write_text(BOW)
    meshreel.load(tmp_path / "bow.obj", notes=notes)
    assert notes == ["triangles overlap in 1 polygon with crossing sides"]
