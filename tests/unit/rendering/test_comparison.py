import numpy as np

from meshreel.rendering.comparison import comparison_picture
from meshreel.sequence import MeshSequence
from sample_meshes import waving_grid


def pictures(error):
    original = waving_grid(6)
    shifted = original.vertices.copy()
    shifted[:, ::2, 2] += error
    decoded = MeshSequence(shifted, original.faces)
    return comparison_picture(original, decoded, n_poses=2, size_px=(120, 100))


def test_heat_map_changes_when_vertices_are_moved():
    same, moved = (np.asarray(pictures(error)).astype(int) for error in (0.0, 0.05))
    changed = np.abs(moved - same).max(axis=2) > 20
    left, right = np.array_split(changed, 2, axis=1)
    assert right.sum() > 3 * left.sum() > 0


def test_sheet_has_a_row_for_each_pose_when_drawn():
    image = pictures(0.05)
    assert image.height > 2 * 100
    assert image.width > 3 * 120


def test_picture_is_drawn_when_there_is_one_frame():
    sequence = waving_grid(1)
    assert comparison_picture(sequence, sequence, n_poses=1, size_px=(120, 100)).width > 3 * 120
