import numpy as np
import pytest
from scipy.sparse import csr_array

from meshreel.reel.agreed.closed_loop import ClosedLoop, Predictor

LEVELS = [[4, 1], [], [0, 5, 6], [2, 3, 7]]


def predictors():
    """Weights of what earlier levels hold, far from any that predict well."""
    rng = np.random.default_rng(1)
    known: list[int] = []
    result = []
    for level in LEVELS:
        weights = np.zeros((len(level), 8))
        weights[:, known] = rng.normal(size=(len(level), len(known)))
        result.append(Predictor(np.array(level, np.int64), csr_array(weights)))
        known += level
    return result


def truth():
    return 50 * np.random.default_rng(2).normal(size=(8, 3))


def rounded(wanted, step):
    """Values, predictions and residuals of a loop that rounds to the nearest."""
    loop = ClosedLoop(predictors(), *wanted.shape, step=step)
    predictions, residuals = [], []
    for level, rows in enumerate(LEVELS):
        predictions.append(loop.predict(level))
        residuals.append(np.rint((wanted[rows] - predictions[-1]) / step).astype(np.int64))
        loop.add(level, predictions[-1], residuals[-1])
    return loop.values, predictions, residuals


@pytest.mark.parametrize("step", [0.01, 1.0, 30.0])
def test_every_value_lies_within_half_a_step_when_levels_build_on_rounded_ones(step):
    values, *_ = rounded(truth(), step)
    assert np.abs(values - truth()).max() <= 0.5 * step * (1 + 1e-9)


def test_values_are_the_same_when_residuals_are_decoded():
    values, _, residuals = rounded(truth(), 0.7)
    decoded = ClosedLoop(predictors(), 8, 3, 0.7).decode(residuals)
    np.testing.assert_array_equal(decoded, values)


def test_predictions_come_from_decoded_values_when_these_differ_from_the_truth():
    values, predictions, _ = rounded(truth(), 5.0)
    for prediction, predictor in zip(predictions, predictors(), strict=True):
        np.testing.assert_allclose(prediction, predictor.weights @ values, atol=1e-12)
    assert np.abs(predictions[3] - predictors()[3].weights @ truth()).max() > 1.0


def test_first_level_is_predicted_to_be_zero_when_nothing_is_known():
    _, predictions, _ = rounded(truth(), 1.0)
    assert not predictions[0].any()


def test_columns_do_not_touch_each_other_when_decoded_together():
    together, *_ = rounded(truth(), 0.7)
    for column in range(3):
        values, *_ = rounded(truth()[:, [column]], 0.7)
        np.testing.assert_allclose(values[:, 0], together[:, column], atol=1e-12)
