"""Searches for a step, with known measures."""

import numpy as np
import pytest

from meshreel.codec.reel.encoding.rate_control import (
    MAX_SPAN,
    MAX_TRIALS,
    estimated_bytes,
    least_cost,
    meet_limit,
    sampled,
)

MAX_RATIO = float(np.exp(MAX_SPAN))
EXPONENTS = (0.5, 0.8, 1.0, 1.3, 2.0)


def power_law(exponent, factor=3.0):
    return lambda step: factor * step**exponent


def counted(measure):
    """The measure, and the list of its arguments."""
    steps = []

    def measured(step):
        steps.append(step)
        return measure(step)

    return measured, steps


@pytest.mark.every_case
@pytest.mark.parametrize("rises", [True, False])
@pytest.mark.parametrize("exponent", EXPONENTS)
@pytest.mark.parametrize("factor", [1e-3, 3.0, 1e3])
@pytest.mark.parametrize("distance", [1e-5, 1e-3, 0.4, 1.0, 3.0, 1e3, 1e5])
def test_target_is_met_closely_for_a_power_law(rises, exponent, factor, distance):
    measure = power_law(exponent if rises else -exponent, factor)
    measured, steps = counted(measure)
    limit = measure(0.01 * distance)
    step = meet_limit(measured, limit, 0.01, rises=rises)
    assert 0.99 * limit <= measure(step) <= limit
    assert len(steps) == len(set(steps)) <= MAX_TRIALS


def test_size_target_is_met_with_a_constant_part():
    """Connectivity and headers do not depend on the step."""

    def measure(step):
        return 5000 + 3 * step**-0.9

    step = meet_limit(measure, 6000.0, 1e-3, rises=False)
    assert 0.99 * 6000 <= measure(step) <= 6000


@pytest.mark.parametrize("rises", [True, False])
@pytest.mark.parametrize("seed", range(20))
def test_limit_is_met_closely_for_a_noisy_measure(rises, seed):
    """The measure is deterministic, but varies by some percent between close steps."""
    noises = {}
    rng = np.random.default_rng(seed)

    def measure(step):
        noise = noises.setdefault(step, np.exp(rng.normal(scale=0.02)))
        return step ** (0.9 if rises else -0.9) * noise

    step = meet_limit(measure, 7.0, 0.02, rises=rises)
    assert step in noises
    assert 0.9 * 7.0 <= measure(step) <= 7.0


@pytest.mark.parametrize("rises", [True, False])
def test_limit_is_met_for_a_measure_with_steps(rises):
    """Sizes are whole bytes, and few steps give different streams."""

    def measure(step):
        return float(np.floor(100 * step ** (1 if rises else -1) / 7) * 7)

    step = meet_limit(measure, 1000.0, 1.0, rises=rises)
    assert measure(step) == 994


@pytest.mark.every_case
@pytest.mark.parametrize("rises", [True, False])
@pytest.mark.parametrize("floor", [0.999, 1.001, 2.0, 1e6])
def test_limit_is_met_just_above_the_floor_and_refused_below(rises, floor):
    measure = (lambda step: max(floor, step)) if rises else (lambda step: max(floor, 1 / step))
    measured, steps = counted(measure)
    step = meet_limit(measured, 1.0, 5.0, rises=rises)
    assert measure(step) <= 1.0 if floor < 1 else step is None
    assert len(steps) <= MAX_TRIALS


@pytest.mark.parametrize("rises", [True, False])
def test_search_returns_a_distant_step_for_an_unreachable_limit(rises):
    """All streams are below the size: the search returns the best."""
    measure = (lambda step: min(step, 0.5)) if rises else (lambda step: min(1 / step, 0.5))
    step = meet_limit(measure, 1.0, 1.0, rises=rises)
    assert step is not None
    assert measure(step) == 0.5
    assert max(step, 1 / step) <= MAX_RATIO


@pytest.mark.parametrize("rises", [True, False])
@pytest.mark.parametrize(("value", "is_met"), [(0.0, True), (1e-9, True), (2.0, False)])
def test_search_of_a_constant_measure_terminates(rises, value, is_met):
    measured, steps = counted(lambda step: value)
    step = meet_limit(measured, 1.0, 1.0, rises=rises)
    assert step in steps if is_met else step is None
    assert all(1 / MAX_RATIO <= one <= MAX_RATIO for one in steps)


def test_first_step_that_meets_the_limit_is_returned():
    measured, steps = counted(power_law(1.0, 1.0))
    assert meet_limit(measured, 1.0, 0.995, rises=True) == pytest.approx(0.995)
    assert len(steps) == 1


def test_measure_is_within_the_tolerance_of_the_limit():
    measure = power_law(0.7)
    step = meet_limit(measure, 1.0, 1e-3, rises=True)
    assert 0.99 <= measure(step) <= 1.0


@pytest.mark.parametrize("lowest", [0.3, 0.5, 0.9, 1.0, 1.4, 2.5])
def test_minimum_of_a_unimodal_cost_is_found_closely(lowest):
    def cost(step):
        return 1000 + 300 * np.log(step / lowest) ** 2

    step = least_cost(cost, 1.0, n_trials=12)
    assert abs(np.log(step / lowest)) < 0.25


@pytest.mark.parametrize("lowest", [0.01, 0.7, 1.0, 1.3, 50.0])
@pytest.mark.parametrize("n_trials", [1, 2, 6, 9])
def test_minimum_is_the_cheapest_tried_step(lowest, n_trials):
    measured, steps = counted(lambda step: abs(np.log(step / lowest)))
    step = least_cost(measured, 1.0, n_trials=n_trials)
    assert step in steps
    assert len(steps) == len(set(steps))
    assert len(steps) == 1 or n_trials > 1
    assert abs(np.log(step / lowest)) == min(abs(np.log(one / lowest)) for one in steps)


@pytest.mark.parametrize("lowest", [0.02, 0.1, 10.0, 40.0])
def test_minimum_far_from_the_start_is_found_with_few_more_trials(lowest):
    measured, steps = counted(lambda step: abs(np.log(step / lowest)))
    assert abs(np.log(least_cost(measured, 1.0) / lowest)) < 0.5
    assert len(steps) <= 11


@pytest.mark.parametrize("n_blocks", [1, 2, 6, 7, 100])
def test_few_blocks_are_all_sampled_and_many_in_the_middle(n_blocks):
    chosen = list(sampled(range(n_blocks)))
    assert chosen == list(range(chosen[0], chosen[0] + len(chosen)))
    assert len(chosen) == (n_blocks if n_blocks <= 6 else 3)
    assert abs(chosen[0] - (n_blocks - 1 - chosen[-1])) <= 1


@pytest.mark.parametrize("n_blocks", [1, 3, 100])
def test_bytes_of_a_key_block_and_equal_others_are_estimated_exactly(n_blocks):
    sizes = [50, *[10] * min(2, n_blocks - 1)]
    assert estimated_bytes(sizes, n_blocks) == 50 + 10 * (n_blocks - 1)


def test_minimum_of_a_constant_cost_is_the_start():
    assert least_cost(lambda step: 5.0, 0.25) == 0.25
