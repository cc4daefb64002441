import math

import numpy as np
import pytest

from meshreel.metrics.nmsve import nmsve_per_frame

RIGHT = np.array([[[0.0, 0, 0], [3, 0, 0], [0, 4, 0]]])  # diagonal 5
AWAY = np.array([0, 0, 5.0])
TRIANGLE = np.array([[0, 1, 2]], np.int32)
ONE_EDGE = np.array([[0, 1, 1]], np.int32)


def slow_nmsve(original, decoded, faces):
    """The definition in loops, for meshes without coincident neighbors."""

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


@pytest.mark.slow
@pytest.mark.parametrize("mesh", ["soup", "tube"])
def test_nmsve_equals_the_definition_in_loops(mesh, request):
    original, decoded, faces = request.getfixturevalue(mesh)
    result = nmsve_per_frame(original, decoded, faces)
    np.testing.assert_allclose(result, slow_nmsve(original, decoded, faces), rtol=1e-10)


def test_isolated_vertex_has_no_smoothness_part():
    # Vertex 2 has no face and moves by 1 = diagonal of the box of 0, 1 and 2; GL(2) = 0 in both.
    original = np.array([[[0.0, 0, 0], [1, 0, 0], [0.5, 0, 0]]])
    decoded = original.copy()
    decoded[0, 2, 2] = 1
    assert nmsve_per_frame(original, decoded, ONE_EDGE) == pytest.approx([1 / 6], rel=1e-14)


COINCIDENT = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 0, 0]]])


def test_coincident_neighbors_have_no_smoothness_part():
    # 0 and 3 coincide and are neighbors: GL(0) = GL(3) = 0 wherever 1 and 2 go, and
    # GL(1) is the only one left: 1 has neighbors 0 and 3 at (0, 0, 0), so GL(1) = v_1.
    decoded = COINCIDENT.copy()
    decoded[0, 1, 0] = 2  # ||V - V^|| = 1, ||GL - GL^|| = 1, n = 3
    assert nmsve_per_frame(COINCIDENT, decoded, TRIANGLE) == pytest.approx([2 / 6], rel=1e-14)


def test_rounding_of_coincident_neighbors_hardly_changes_nmsve():
    decoded = COINCIDENT.copy()
    decoded[0, 2, 1] = 1e-12
    assert nmsve_per_frame(COINCIDENT, decoded, TRIANGLE)[0] < 1e-11


def test_nmsve_uses_the_whole_diagonal_if_frame_0_is_a_point():
    original = np.concatenate([np.zeros_like(RIGHT), RIGHT])
    result = nmsve_per_frame(original, original + AWAY, TRIANGLE)
    assert result == pytest.approx([math.sqrt(3) / 6] * 2, rel=1e-12)


def test_nmsve_of_a_single_point_is_zero_or_infinite():
    decoded = np.zeros((2, 3, 3))
    decoded[1, 1, 0] = 1
    result = nmsve_per_frame(np.zeros((2, 3, 3)), decoded, TRIANGLE)
    assert result.tolist() == [0, math.inf]


def test_nmsve_of_a_frame_beyond_float64_is_infinite(tube):
    decoded = tube[0].copy()
    decoded[3, 4] = 1e300
    infinite = np.isinf(nmsve_per_frame(tube[0], decoded, tube[2]))
    assert np.flatnonzero(infinite).tolist() == [3]
