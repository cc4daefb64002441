import numpy as np

from meshreel.entropy.adaptive import BitReader, BitWriter
from meshreel.entropy.contexts import N_EXPECTED, N_NEAR, N_PAST, UNIT, Contexts, mean_of_class
from meshreel.entropy.tokens import MAX_MAGNITUDE
from meshreel.entropy.value_model import ValueModel, coarse, detail_widths

VALUES = np.array([0, 1, -1, 2, 3, -4, 5, 6, 7, 11, 12, -1000, MAX_MAGNITUDE, -MAX_MAGNITUDE])


def random_contexts(n):
    rng = np.random.default_rng(0)
    return Contexts(
        rng.integers(0, N_EXPECTED, n),
        rng.integers(0, N_PAST, n),
        rng.integers(0, N_NEAR, n),
        rng.integers(-100, 101, n),
    )


def test_only_two_bits_are_left_when_integers_are_made_coarse():
    assert coarse(VALUES[:-2]).tolist() == [0, 1, -1, 2, 3, -4, 4, 6, 6, 8, 12, -768]
    assert detail_widths(VALUES).tolist() == [0, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 8, 29, 29]


def test_coarse_integers_come_back_when_contexts_are_arbitrary():
    values = np.tile(coarse(VALUES), 50)
    contexts = random_contexts(len(values))
    writer = BitWriter()
    ValueModel().code(writer, values, contexts)
    back = ValueModel().code(BitReader(writer.words()), None, contexts)
    np.testing.assert_array_equal(back, values)


def cost_bits(values, expected):
    n = len(values)
    flat = [np.full(n, one, np.int64) for one in (expected, 0, 0, 0)]
    writer = BitWriter()
    ValueModel().code(writer, values, Contexts(*flat))
    return 8 * len(writer.words())


def test_first_guesses_are_good_when_magnitudes_are_as_expected():
    rng = np.random.default_rng(1)
    for expected in (32, 40, 46):
        mean = mean_of_class(np.array(expected)) / UNIT
        magnitudes = rng.geometric(1 / (1 + mean), 3000) - 1
        values = coarse(magnitudes * rng.choice([-1, 1], 3000))
        # The whole is one pass, so that nothing can be learnt.
        share = np.bincount(np.unique(values, return_inverse=True)[1]) / 3000
        assert cost_bits(values, expected) < 1.06 * -3000 * np.sum(share * np.log2(share)) + 64


def test_probabilities_stay_in_range_when_classes_are_extreme():
    for expected in (0, N_EXPECTED - 1):
        for model in ValueModel()._longer:
            assert 0 < model._ones[expected] < model._total[expected]
