import numpy as np
import pytest
from scipy.sparse import csr_array

from meshreel.reel.agreed.closed_loop import Predictor, reconstruct_levels

LEVELS = [[4, 1], [], [0, 5, 6], [2, 3, 7]]


def predictors():
    """Weights of what earlier levels hold, far from any that foretell well."""
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


def recording(wanted, step):
    """What rounds to the nearest, and keeps what it was given and what it gave."""
    predictions, integers = {}, {}

    def steps_of(level, prediction):
        predictions[level] = prediction
        integers[level] = np.rint((wanted[LEVELS[level]] - prediction) / step).astype(np.int64)
        return integers[level]

    return steps_of, predictions, integers


@pytest.mark.parametrize("step", [0.01, 1.0, 30.0])
def test_every_value_lies_within_half_a_step_when_levels_build_on_rounded_ones(step):
    steps_of, *_ = recording(truth(), step)
    values = reconstruct_levels(predictors(), 8, 3, step, steps_of)
    assert np.abs(values - truth()).max() <= 0.5 * step * (1 + 1e-9)


def test_values_are_the_same_when_the_steps_are_read_again():
    steps_of, _, integers = recording(truth(), 0.7)
    written = reconstruct_levels(predictors(), 8, 3, 0.7, steps_of)
    read = reconstruct_levels(predictors(), 8, 3, 0.7, lambda level, _: integers[level])
    np.testing.assert_array_equal(read, written)


def test_predictions_come_from_decoded_values_when_these_differ_from_the_truth():
    steps_of, predictions, _ = recording(truth(), 5.0)
    values = reconstruct_levels(predictors(), 8, 3, 5.0, steps_of)
    for level, predictor in enumerate(predictors()):
        if LEVELS[level]:
            np.testing.assert_allclose(predictions[level], predictor.weights @ values, atol=1e-12)
    assert np.abs(predictions[3] - predictors()[3].weights @ truth()).max() > 1.0


def test_first_level_is_predicted_to_be_zero_when_nothing_is_known():
    steps_of, predictions, _ = recording(truth(), 1.0)
    reconstruct_levels(predictors(), 8, 3, 1.0, steps_of)
    assert not predictions[0].any()


def test_levels_are_asked_for_in_order_and_empty_ones_not_at_all_when_reconstructed():
    steps_of, predictions, _ = recording(truth(), 1.0)
    reconstruct_levels(predictors(), 8, 3, 1.0, steps_of)
    assert list(predictions) == [0, 2, 3]


def test_columns_do_not_touch_each_other_when_reconstructed_together():
    together = reconstruct_levels(predictors(), 8, 3, 0.7, recording(truth(), 0.7)[0])
    for column in range(3):
        alone = truth()[:, [column]]
        values = reconstruct_levels(predictors(), 8, 1, 0.7, recording(alone, 0.7)[0])
        np.testing.assert_allclose(values[:, 0], together[:, column], atol=1e-12)
