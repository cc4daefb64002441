"""Alembic files written by Maya and Houdini."""

import numpy as np
import pytest

from meshreel.formats.load import load

pytestmark = pytest.mark.real

LAST_PLACE = 2.0**-24
"""Of coordinates up to 2."""


@pytest.mark.parametrize("name", ["bone", "balloons"])
def test_faces_and_positions_match_blenders(data, name):
    result, blender = load(data / "native" / f"{name}.abc"), load(data / f"{name}.npz")
    np.testing.assert_array_equal(result.faces, blender.faces)
    rotated = blender.vertices[..., [0, 2, 1]] * np.float32([1, 1, -1])  # to y up
    # Blender adds the translation of "bone" in float32, we in float64; "balloons" has none.
    assert np.abs(result.vertices - rotated).max() <= (LAST_PLACE if name == "bone" else 0)
    assert (result.fps, result.start_s) == (24.0, 1 / 24)
    first, second, third = np.moveaxis(result.vertices[0][result.faces].astype(float), 1, 0)
    assert np.einsum("ij,ij->", first, np.cross(second, third)) > 0  # faces look outward
