"""Alembic files written by Maya and Houdini."""

import os
from pathlib import Path

import numpy as np
import pytest

from meshreel.formats.load import load
from meshreel.formats.save import save

pytestmark = pytest.mark.real

LAST_PLACE = 2.0**-24
"""Of coordinates up to 2."""


@pytest.fixture(params=["bone", "balloons"])
def pair(request):
    """Our reading of a file, Blender's, and Blender's positions rotated to y up."""
    folder = os.environ.get("MESHREEL_DATA")
    if not folder:
        pytest.skip("MESHREEL_DATA is not set")
    blender = load(Path(folder) / f"{request.param}.npz")
    rotated = blender.vertices[..., [0, 2, 1]] * np.float32([1, 1, -1])
    return load(Path(folder) / "native" / f"{request.param}.abc"), blender, rotated


def test_faces_match_blenders(pair):
    found, blender, _ = pair
    np.testing.assert_array_equal(found.faces, blender.faces)


def test_positions_match_blenders(pair):
    # Blender adds the translation of "bone" in float32, we in float64; "balloons" has none.
    found, _, rotated = pair
    assert np.abs(found.vertices - rotated).max() <= (
        LAST_PLACE if found.name == "BoneShape" else 0
    )
    assert (found.fps, found.start_s) == (24.0, 1 / 24)


def test_clockwise_faces_are_reversed_to_face_outward(pair):
    found, _, _ = pair
    first, second, third = np.moveaxis(found.vertices[0][found.faces].astype(float), 1, 0)
    assert np.einsum("ij,ij->", first, np.cross(second, third)) > 0


def test_alembic_round_trips_exactly(tmp_path, pair):
    found, _, _ = pair
    save(found, tmp_path / "a.abc")
    back = load(tmp_path / "a.abc")
    np.testing.assert_array_equal(back.vertices, found.vertices)
    np.testing.assert_array_equal(back.faces, found.faces)
    np.testing.assert_array_equal(back.surface.face_sizes, found.surface.face_sizes)
    for own, again in zip(found.surface.attributes, back.surface.attributes, strict=True):
        assert (own.name, own.domain) == (again.name, again.domain)
        np.testing.assert_array_equal(own.per_item(), again.per_item())
