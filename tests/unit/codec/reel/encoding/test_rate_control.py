"""The search for a step, on measures that are known."""

import numpy as np
import pytest

from meshreel.codec.reel.encoding.rate_control import MAX_SPAN, MAX_TRIALS, least_cost, meet_limit

MAX_RATIO = float(np.exp(MAX_SPAN))
EXPONENTS = (0.5, 0.8, 1.0, 1.3, 2.0)


def power_law(exponent, factor=3.0):
    return lambda step: factor * step**exponent


def counted(measure):
    """The measure, and the list of steps that it was asked for."""
    asked = []

    def measured(step):
        asked.append(step)
        return measure(step)

    return measured, asked


@pytest.mark.parametrize("exponent", EXPONENTS)
@pytest.mark.parametrize("factor", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("distance", [1e-5, 1e-3, 0.4, 1.0, 3.0, 1e3, 1e5])
def test_error_is_met_from_below_when_it_is_a_power_of_the_step(exponent, factor, distance):
    measure = power_law(exponent, factor)
    measured, asked = counted(measure)
    limit = measure(0.01 * distance)
    step = meet_limit(measured, limit, 0.01, rises=True)
    assert 0.99 * limit <= measure(step) <= limit
    assert len(asked) == len(set(asked)) <= MAX_TRIALS


@pytest.mark.parametrize("exponent", EXPONENTS)
@pytest.mark.parametrize("distance", [1e-5, 1e-3, 0.4, 1.0, 3.0, 1e3, 1e5])
def test_size_is_met_from_below_when_it_falls_with_the_step(exponent, distance):
    measure = power_law(-exponent)
    limit = measure(0.01 * distance)
    step = meet_limit(measure, limit, 0.01, rises=False)
    assert 0.99 * limit <= measure(step) <= limit


def test_size_is_met_when_a_part_of_it_is_always_there():
    """Connectivity and headers: no power of the step."""

    def measure(step):
        return 5000 + 3 * step**-0.9

    step = meet_limit(measure, 6000.0, 1e-3, rises=False)
    assert 0.99 * 6000 <= measure(step) <= 6000


@pytest.mark.parametrize("rises", [True, False])
@pytest.mark.parametrize("seed", range(20))
def test_limit_is_nearly_met_from_below_when_the_measure_is_noisy(rises, seed):
    """The same step measures the same, but neighbours differ by some percent."""
    noises = {}
    rng = np.random.default_rng(seed)

    def measure(step):
        noise = noises.setdefault(step, np.exp(rng.normal(scale=0.02)))
        return step ** (0.9 if rises else -0.9) * noise

    step = meet_limit(measure, 7.0, 0.02, rises=rises)
    assert step in noises
    assert 0.9 * 7.0 <= measure(step) <= 7.0


@pytest.mark.parametrize("rises", [True, False])
def test_whole_numbers_are_met_when_the_measure_goes_in_steps(rises):
    """Sizes are whole bytes, and few steps of rounding give different streams."""

    def measure(step):
        return float(np.floor(100 * step ** (1 if rises else -1) / 7) * 7)

    step = meet_limit(measure, 1000.0, 1.0, rises=rises)
    assert measure(step) == 994


@pytest.mark.parametrize("rises", [True, False])
@pytest.mark.parametrize("above", [1.001, 2.0, 1e6])
def test_nothing_is_found_when_the_measure_has_a_floor_above_the_limit(rises, above):
    def measure(step):
        return max(above, step if rises else 1 / step)

    measured, asked = counted(measure)
    assert meet_limit(measured, 1.0, 5.0, rises=rises) is None
    assert len(asked) <= MAX_TRIALS


@pytest.mark.parametrize("rises", [True, False])
def test_limit_is_met_when_the_floor_is_just_below_it(rises):
    def measure(step):
        return max(0.999, step if rises else 1 / step)

    step = meet_limit(measure, 1.0, 5.0, rises=rises)
    assert measure(step) <= 1.0


@pytest.mark.parametrize("rises", [True, False])
def test_a_step_far_away_is_given_when_the_measure_never_reaches_the_limit(rises):
    """A budget that all streams stay below: the best one found is given."""
    measure = (lambda step: min(step, 0.5)) if rises else (lambda step: min(1 / step, 0.5))
    step = meet_limit(measure, 1.0, 1.0, rises=rises)
    assert step is not None
    assert measure(step) == 0.5
    assert max(step, 1 / step) <= MAX_RATIO


@pytest.mark.parametrize("rises", [True, False])
@pytest.mark.parametrize(("value", "is_met"), [(0.0, True), (1e-9, True), (2.0, False)])
def test_search_stays_within_reach_when_nothing_changes_the_measure(rises, value, is_met):
    measured, asked = counted(lambda step: value)
    step = meet_limit(measured, 1.0, 1.0, rises=rises)
    assert step in asked if is_met else step is None
    assert all(1 / MAX_RATIO <= one <= MAX_RATIO for one in asked)


def test_first_step_is_taken_when_it_meets_the_limit_already():
    measured, asked = counted(power_law(1.0, 1.0))
    assert meet_limit(measured, 1.0, 0.995, rises=True) == pytest.approx(0.995)
    assert len(asked) == 1


@pytest.mark.parametrize("tolerance", [0.2, 0.01, 1e-4])
def test_less_is_left_over_when_the_tolerance_is_finer(tolerance):
    measure = power_law(0.7)
    step = meet_limit(measure, 1.0, 1e-3, rises=True, tolerance=tolerance)
    assert 1 - tolerance <= measure(step) <= 1.0


@pytest.mark.parametrize("lowest", [0.3, 0.5, 0.9, 1.0, 1.4, 2.5])
def test_least_cost_is_nearly_found_when_the_cost_has_one_valley(lowest):
    def cost(step):
        return 1000 + 300 * np.log(step / lowest) ** 2

    step = least_cost(cost, 1.0, n_trials=12)
    assert abs(np.log(step / lowest)) < 0.25


@pytest.mark.parametrize("lowest", [0.01, 0.7, 1.0, 1.3, 50.0])
@pytest.mark.parametrize("n_trials", [1, 2, 6, 9])
def test_least_cost_is_that_of_the_cheapest_step_tried(lowest, n_trials):
    measured, asked = counted(lambda step: abs(np.log(step / lowest)))
    step = least_cost(measured, 1.0, n_trials=n_trials)
    assert step in asked
    assert len(asked) == len(set(asked)) == n_trials
    assert abs(np.log(step / lowest)) == min(abs(np.log(one / lowest)) for one in asked)


def test_least_cost_is_the_start_when_all_cost_the_same():
    assert least_cost(lambda step: 5.0, 0.25) == 0.25
