import numpy as np

from meshreel.formats.surfaces.welding import weld_corners, weld_rows


def corner_frames(rng, n_frames=4, n_verts=9, n_faces=20, split=()):
    """Corner positions of random triangles, and the vertex of each corner."""
    faces = rng.integers(0, n_verts, (n_faces, 3))
    positions = rng.standard_normal((n_frames, n_verts, 3)).astype(np.float32)
    for frame, vertex, twin in split:
        positions[: frame + 1, twin] = positions[: frame + 1, vertex]
    return positions[:, faces.ravel()], faces


def partition(faces):
    """The faces with vertices renumbered by first appearance: equal for equal weldings."""
    _, first, inverse = np.unique(faces, return_index=True, return_inverse=True)
    ranks = np.argsort(np.argsort(first))
    return ranks[inverse].reshape(-1, 3)


def test_weld_corners_finds_the_vertices_when_positions_differ():
    frames, faces = corner_frames(np.random.default_rng(0))
    np.testing.assert_array_equal(weld_corners(frames).faces, partition(faces))


def test_weld_corners_keeps_vertices_apart_when_they_part_in_a_later_frame():
    frames, faces = corner_frames(np.random.default_rng(1), split=[(0, 0, 1), (1, 2, 3), (2, 4, 5)])
    np.testing.assert_array_equal(weld_corners(frames).faces, partition(faces))


def test_weld_corners_joins_vertices_when_they_coincide_in_every_frame():
    frames, faces = corner_frames(np.random.default_rng(2), split=[(3, 0, 1)])
    faces = np.where(faces == 1, 0, faces)
    np.testing.assert_array_equal(weld_corners(frames).faces, partition(faces))


def test_weld_corners_gives_back_all_corners_when_representatives_are_looked_up():
    frames, _ = corner_frames(np.random.default_rng(3), split=[(1, 2, 3)])
    weld = weld_corners(frames)
    np.testing.assert_array_equal(frames[:, weld.representatives][:, weld.faces.ravel()], frames)


def test_weld_corners_keeps_doubles_apart_when_they_differ_in_the_last_bit():
    corners = np.array([[1, 0, 0], [np.nextafter(1, 2), 0, 0], [1, 0, 0]])
    assert weld_corners([corners]).faces.tolist() == [[0, 1, 0]]


def test_weld_description_counts_corners_and_vertices_when_some_are_joined():
    corners = np.array([[1, 0, 0], [2, 0, 0], [1, 0, 0]], np.float32)
    assert weld_corners([corners]).description == "welded 3 STL corners to 2 vertices"


def test_weld_rows_numbers_rows_by_their_first_when_arrays_differ_in_width():
    wide = np.array([[1, 2, 3, 4], [1, 2, 3, 5], [1, 2, 3, 4], [1, 2, 3, 4]], np.uint8)
    narrow = np.array([[0.5], [0.5], [0.5], [0.25]])
    labels, representatives = weld_rows([narrow, wide])
    assert (labels.tolist(), representatives.tolist()) == ([0, 1, 0, 2], [0, 1, 3])
