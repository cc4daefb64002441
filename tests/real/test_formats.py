"""A real sequence round-trips through every frame format."""

import os
from pathlib import Path

import numpy as np
import pytest

from meshreel.formats.load import load
from meshreel.formats.save import save
from meshreel.model.sequence import MeshSequence

pytestmark = pytest.mark.real


@pytest.fixture(scope="module")
def samba():
    folder = os.environ.get("MESHREEL_DATA")
    if not folder:
        pytest.skip("MESHREEL_DATA is not set")
    whole = load(Path(folder) / "samba.npz")
    return MeshSequence(whole.vertices[:5], whole.faces, whole.fps, whole.name)


@pytest.mark.parametrize("extension", ["obj", "ply", "off"])
def test_text_and_ply_frames_round_trip_exactly(tmp_path, samba, extension):
    save(samba, tmp_path / f"samba_%04d.{extension}")
    found = load(tmp_path)
    assert found.vertices.dtype == samba.vertices.dtype
    np.testing.assert_array_equal(found.vertices, samba.vertices)
    np.testing.assert_array_equal(found.faces, samba.faces)


def test_stl_frames_round_trip_the_geometry(tmp_path, samba):
    save(samba, tmp_path / "samba_%04d.stl")
    found = load(tmp_path)
    assert found.n_verts <= samba.n_verts
    np.testing.assert_array_equal(found.vertices[:, found.faces], samba.vertices[:, samba.faces])
