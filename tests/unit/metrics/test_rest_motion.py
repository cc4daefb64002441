"""Motion of decoded vertices where the original rests."""

import numpy as np
import pytest

from meshreel.metrics.compare import REST_PERCENT, RestMotion, rest_motion

DIAGONAL = 2.0


def walking(n_frames=6, n_verts=50):
    """Return a cloud in a box of this diagonal; ten vertices move by 1 % per frame."""
    side = DIAGONAL / np.sqrt(3.0)
    places = np.random.default_rng(1).uniform(0.0, side, (n_verts, 3))
    places[10:12] = [[0, 0, 0], [side] * 3]
    result = np.repeat(places[None], n_frames, axis=0)
    result[:, :10, 0] *= 0.5
    result[:, :10, 0] += 0.01 * DIAGONAL * np.arange(n_frames)[:, None]
    return result


def test_only_resting_vertices_count():
    original = walking()
    decoded = original.copy()
    decoded[3, 10:, 1] += 0.002 * DIAGONAL
    decoded[:, :10] += np.random.default_rng(2).normal(size=(6, 10, 3))
    result = rest_motion(original, decoded)
    assert result.n_pairs == 5 * 40
    assert result.median_percent == 0.0
    assert result.p99_percent == pytest.approx(0.2)


def test_median_is_the_motion_of_most_pairs():
    original = walking()
    decoded = original + 0.0003 * DIAGONAL * np.array([0, 1, 0, 1, 0, 0])[:, None, None] * [0, 0, 1]
    assert rest_motion(original, decoded).median_percent == pytest.approx(0.03)


@pytest.mark.parametrize(("share", "n_pairs"), [(0.9, 200), (1.1, 170)])
def test_vertices_rest_below_the_threshold(share, n_pairs):
    original = walking()
    original[2:, 20:] += [share * REST_PERCENT / 100 * DIAGONAL, 0, 0]
    assert rest_motion(original, original).n_pairs == n_pairs


def test_result_is_invariant_to_travel_units_and_position():
    original = walking()
    decoded = original.copy()
    decoded[1::2, :, 1] += 0.001 * DIAGONAL
    result = rest_motion(original, decoded)
    far = rest_motion(1e6 * (original + 8.0), 1e6 * (decoded + 8.0))
    assert (far.n_pairs, far.median_percent) == (
        result.n_pairs,
        pytest.approx(result.median_percent),
    )
    jump = np.zeros((6, 1, 3))
    jump[5] = [100.0, 0.0, 0.0]
    walked = rest_motion(original + jump, decoded + jump)
    assert walked.n_pairs == result.n_pairs - 40
    assert walked.median_percent == pytest.approx(result.median_percent)


def test_nothing_is_measured_without_resting_vertices():
    moving = np.cumsum(np.ones((4, 5, 3)), axis=0) + np.arange(5)[:, None]
    assert rest_motion(moving, moving + 1.0) == RestMotion(0, 0.0, 0.0)
    assert rest_motion(moving[:1], moving[:1]) == RestMotion(0, 0.0, 0.0)
    assert rest_motion(np.ones((4, 5, 3)), np.ones((4, 5, 3))) == RestMotion(0, 0.0, 0.0)
