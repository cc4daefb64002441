import numpy as np

from meshreel.formats.surfaces.welding import CornerWelder, weld_rows


def weld_corners(frames):
    welder = CornerWelder()
    for corners in frames:
        welder.add(corners)
    return welder


def corner_frames(rng, n_frames=4, n_verts=9, n_faces=20, split=()):
    """Random corner positions, and the expected vertex of each corner."""
    faces = rng.integers(0, n_verts, (n_faces, 3))
    positions = rng.standard_normal((n_frames, n_verts, 3)).astype(np.float32)
    for frame, vertex, twin in split:
        positions[: frame + 1, twin] = positions[: frame + 1, vertex]
    return positions[:, faces.ravel()], faces


def partition(faces):
    """Renumber vertices by first appearance, to compare weldings."""
    _, first, inverse = np.unique(faces, return_index=True, return_inverse=True)
    ranks = np.argsort(np.argsort(first))
    return ranks[inverse].reshape(-1, 3)


def test_weld_corners_finds_distinct_positions():
    frames, faces = corner_frames(np.random.default_rng(0))
    np.testing.assert_array_equal(weld_corners(frames).faces, partition(faces))


def test_corners_that_separate_later_are_not_welded():
    frames, faces = corner_frames(np.random.default_rng(1), split=[(0, 0, 1), (1, 2, 3), (2, 4, 5)])
    np.testing.assert_array_equal(weld_corners(frames).faces, partition(faces))


def test_corners_that_always_coincide_are_welded():
    frames, faces = corner_frames(np.random.default_rng(2), split=[(3, 0, 1)])
    faces = np.where(faces == 1, 0, faces)
    np.testing.assert_array_equal(weld_corners(frames).faces, partition(faces))


def test_representatives_reproduce_all_corners():
    frames, _ = corner_frames(np.random.default_rng(3), split=[(1, 2, 3)])
    weld = weld_corners(frames)
    np.testing.assert_array_equal(frames[:, weld.representatives][:, weld.faces.ravel()], frames)


def test_positions_that_differ_in_the_last_bit_are_not_welded():
    corners = np.array([[1, 0, 0], [np.nextafter(1, 2), 0, 0], [1, 0, 0]])
    assert weld_corners([corners]).faces.tolist() == [[0, 1, 0]]


def test_weld_description_counts_corners_and_vertices():
    corners = np.array([[1, 0, 0], [2, 0, 0], [1, 0, 0]], np.float32)
    assert weld_corners([corners]).description == "welded 3 STL corners to 2 vertices"


def test_weld_rows_accepts_arrays_of_different_width():
    wide = np.array([[1, 2, 3, 4], [1, 2, 3, 5], [1, 2, 3, 4], [1, 2, 3, 4]], np.uint8)
    narrow = np.array([[0.5], [0.5], [0.5], [0.25]])
    labels, representatives = weld_rows([narrow, wide])
    assert (labels.tolist(), representatives.tolist()) == ([0, 1, 0, 2], [0, 1, 3])
