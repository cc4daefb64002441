import math

import numpy as np
import pytest

from meshreel.metrics.nmsve import nmsve_per_frame

RIGHT = np.array([[[0.0, 0, 0], [3, 0, 0], [0, 4, 0]]])  # diagonal 5
AWAY = np.array([0, 0, 5.0])
TRIANGLE = np.array([[0, 1, 2]], np.int32)
ONE_EDGE = np.array([[0, 1, 1]], np.int32)


def slow_nmsve(original, decoded, faces):
    """The definition in loops, for meshes without coincident neighbours."""

    def smooth_residual(frame):
        out = np.zeros_like(frame)
        for i in range(len(frame)):
            ring = {int(j) for f in faces for j in f if i in f} - {i}
            if ring:
                inverse = {j: 1 / math.dist(frame[i], frame[j]) for j in ring}
                mean = sum(inverse[j] * frame[j] for j in ring) / sum(inverse.values())
                out[i] = frame[i] - mean
        return out

    diagonal = math.dist(original[0].min(axis=0), original[0].max(axis=0))
    return [
        (
            np.linalg.norm(frame / diagonal - frame_hat / diagonal)
            + np.linalg.norm(
                smooth_residual(frame / diagonal) - smooth_residual(frame_hat / diagonal)
            )
        )
        / (2 * len(frame))
        for frame, frame_hat in zip(original, decoded, strict=True)
    ]


@pytest.mark.parametrize("mesh", ["soup", "tube"])
def test_nmsve_equals_the_definition_in_loops_when_the_mesh_is(mesh, request):
    original, decoded, faces = request.getfixturevalue(mesh)
    found = nmsve_per_frame(original, decoded, faces)
    np.testing.assert_allclose(found, slow_nmsve(original, decoded, faces), rtol=1e-10)


def test_nmsve_has_no_smoothness_part_when_decoded_is_moved():
    # Diagonal 5, every vertex moved by 5: ||V - V^|| = sqrt(3) in diagonals, GL the same.
    found = nmsve_per_frame(RIGHT, RIGHT + AWAY, TRIANGLE)
    assert found == pytest.approx([math.sqrt(3) / 6], rel=1e-12)


def test_nmsve_adds_the_smoothness_part_when_an_edge_grows():
    # One edge from 0 to 1, diagonal 1: GL = -1 and 1. Decoded to 2: GL = -2 and 2.
    # ||V - V^|| = 1, ||GL - GL^|| = sqrt(2), n = 2.
    original = np.array([[[0.0, 0, 0], [1, 0, 0]]])
    found = nmsve_per_frame(original, original * 2, ONE_EDGE)
    assert found == pytest.approx([(1 + math.sqrt(2)) / 4], rel=1e-14)


def test_nmsve_divides_by_frame_0_when_frames_differ_in_size():
    original = np.concatenate([RIGHT, 10 * RIGHT])
    found = nmsve_per_frame(original, original + AWAY, TRIANGLE)
    assert found == pytest.approx([math.sqrt(3) / 6] * 2, rel=1e-12)


def test_nmsve_is_exactly_zero_when_decoded_equals_original(soup):
    assert not nmsve_per_frame(soup[0], soup[0].copy(), soup[2]).any()


@pytest.mark.parametrize("scale", [1e-6, 2.0**-900, 2.0**900])
def test_nmsve_is_unchanged_when_both_are_scaled(tube, scale):
    original, decoded, faces = tube
    found = nmsve_per_frame(original * scale, decoded * scale, faces)
    np.testing.assert_allclose(found, nmsve_per_frame(*tube), rtol=1e-9)


def test_nmsve_has_no_smoothness_part_when_a_vertex_is_isolated():
    # Vertex 2 has no face and moves by 1 = diagonal of the box of 0, 1 and 2; GL(2) = 0 in both.
    original = np.array([[[0.0, 0, 0], [1, 0, 0], [0.5, 0, 0]]])
    decoded = original.copy()
    decoded[0, 2, 2] = 1
    assert nmsve_per_frame(original, decoded, ONE_EDGE) == pytest.approx([1 / 6], rel=1e-14)


def test_nmsve_has_no_smoothness_part_when_neighbours_coincide_in_both():
    # 0 and 3 coincide and neighbour each other: GL(0) = GL(3) = 0 wherever 1 and 2 go, and
    # GL(1) is the only one left: 1 has neighbours 0 and 3 at (0, 0, 0), so GL(1) = v_1.
    original = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 0, 0]]])
    decoded = original.copy()
    decoded[0, 1, 0] = 2  # ||V - V^|| = 1, ||GL - GL^|| = 1, n = 3
    assert nmsve_per_frame(original, decoded, TRIANGLE) == pytest.approx([2 / 6], rel=1e-14)


def test_nmsve_does_not_jump_when_coincident_neighbours_part_by_rounding():
    original = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 0, 0]]])
    decoded = original.copy()
    decoded[0, 2, 1] = 1e-12
    assert nmsve_per_frame(original, decoded, TRIANGLE)[0] < 1e-11


def test_nmsve_uses_the_whole_diagonal_when_frame_0_is_a_point():
    original = np.concatenate([np.zeros_like(RIGHT), RIGHT])
    found = nmsve_per_frame(original, original + AWAY, TRIANGLE)
    assert found == pytest.approx([math.sqrt(3) / 6] * 2, rel=1e-12)


def test_nmsve_is_zero_or_infinite_when_the_original_is_one_point():
    decoded = np.zeros((2, 3, 3))
    decoded[1, 1, 0] = 1
    found = nmsve_per_frame(np.zeros((2, 3, 3)), decoded, TRIANGLE)
    assert found.tolist() == [0, math.inf]


def test_nmsve_is_infinite_in_that_frame_when_decoded_is_out_of_range_of_float64(tube):
    decoded = tube[0].copy()
    decoded[3, 4] = 1e300
    infinite = np.isinf(nmsve_per_frame(tube[0], decoded, tube[2]))
    assert np.flatnonzero(infinite).tolist() == [3]
