"""Alembic files as Maya and Houdini wrote them."""

import os
from pathlib import Path

import numpy as np
import pytest

from meshreel.formats.load import load
from meshreel.formats.save import save

pytestmark = pytest.mark.real

LAST_PLACE = 2.0**-24
"""Of the coordinates of these models, which go up to 2."""


@pytest.fixture(params=["bone", "balloons"])
def pair(request):
    """What we read of a file, what Blender made of it, and its positions turned from z to y up."""
    folder = os.environ.get("MESHREEL_DATA")
    if not folder:
        pytest.skip("MESHREEL_DATA names no folder of real sequences")
    known = load(Path(folder) / f"{request.param}.npz")
    turned = known.vertices[..., [0, 2, 1]] * np.float32([1, 1, -1])
    return load(Path(folder) / "native" / f"{request.param}.abc"), known, turned


def test_load_gives_the_faces_of_blender_when_a_program_wrote_quads(pair):
    found, known, _ = pair
    np.testing.assert_array_equal(found.faces, known.faces)


def test_load_gives_the_positions_of_blender_when_a_program_wrote_them(pair):
    # Blender adds the translation of "bone" in float32, we in float64; "balloons" has none.
    found, _, turned = pair
    assert np.abs(found.vertices - turned).max() <= (LAST_PLACE if found.name == "BoneShape" else 0)
    assert (found.fps, found.start_s) == (24.0, 1 / 24)


def test_load_gives_faces_that_look_outward_when_a_program_wrote_them_clockwise(pair):
    found, _, _ = pair
    first, second, third = np.moveaxis(found.vertices[0][found.faces].astype(float), 1, 0)
    assert np.einsum("ij,ij->", first, np.cross(second, third)) > 0


def test_load_gives_back_all_exactly_when_save_wrote_what_it_read(tmp_path, pair):
    found, _, _ = pair
    save(found, tmp_path / "a.abc")
    back = load(tmp_path / "a.abc")
    np.testing.assert_array_equal(back.vertices, found.vertices)
    np.testing.assert_array_equal(back.faces, found.faces)
    np.testing.assert_array_equal(back.surface.face_sizes, found.surface.face_sizes)
    for own, again in zip(found.surface.attributes, back.surface.attributes, strict=True):
        assert (own.name, own.domain) == (again.name, again.domain)
        np.testing.assert_array_equal(own.per_item(), again.per_item())
