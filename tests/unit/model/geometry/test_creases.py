import numpy as np
import pytest

from meshreel.formats.gltf.morph_mesh import creased_share
from samples.meshes import waving_grid
from samples.surfaces import CUBE, CUBE_FACES

STRIP = np.array([[0, 1, 2], [2, 1, 3]], np.int32)


def folded_strip(angle_deg):
    """Return two triangles with an angle at their common edge."""
    angle = np.radians(angle_deg)
    far = [1 + np.cos(angle), 0, np.sin(angle)]
    return np.array([[0, 0, 0], [1, -1, 0], [1, 1, 0], far])


@pytest.mark.parametrize(("angle_deg", "share"), [(0, 0), (59, 0), (61, 1), (179, 1)])
def test_edge_is_a_crease_when_faces_turn_by_more_than_60_degrees(angle_deg, share):
    assert creased_share(folded_strip(angle_deg), STRIP) == share


def test_creased_share_is_weighted_by_edge_length():
    assert creased_share(CUBE, np.array(CUBE_FACES)) == pytest.approx(12 / (12 + 6 * 2**0.5))


def test_creased_share_of_a_smooth_sheet_is_0():
    grid = waving_grid()
    assert creased_share(grid.vertices[3], grid.faces) == 0


@pytest.mark.parametrize(
    "faces", [[[0, 1, 2]], [[0, 1, 2], [0, 1, 2], [0, 1, 2]], [[0, 0, 1], [1, 0, 0]]]
)
def test_creased_share_is_1_without_edges_between_two_proper_faces(faces):
    assert creased_share(folded_strip(10), np.array(faces)) == 1
