import numpy as np
import pytest

from meshreel.entropy.adaptive import (
    CERTAIN,
    INCREMENT,
    AdaptiveBits,
    BitReader,
    BitWriter,
)
from meshreel.errors import CorruptStreamError


def coded(bits, contexts, n_contexts, guess=CERTAIN // 2):
    writer = BitWriter()
    model = AdaptiveBits(np.full(n_contexts, guess))
    for some, where in zip(np.split(bits, 20), np.split(contexts, 20), strict=True):
        model.code(writer, some, where)
    return writer.words()


def test_bits_come_back_when_reader_and_writer_learn_alike():
    rng = np.random.default_rng(1)
    contexts = rng.integers(0, 5, 4000)
    bits = rng.random(4000) < contexts / 5
    reader = BitReader(coded(bits, contexts, 5))
    model = AdaptiveBits(np.full(5, CERTAIN // 2))
    back = [model.code(reader, None, where) for where in np.split(contexts, 20)]
    reader.finish()
    np.testing.assert_array_equal(np.concatenate(back), bits)


def test_size_is_near_the_entropy_when_contexts_are_informative():
    rng = np.random.default_rng(2)
    contexts = rng.integers(0, 2, 100_000)
    bits = rng.random(100_000) < np.array([0.02, 0.6])[contexts]
    entropy = 50_000 * (0.1414 + 0.9710)
    unknown = 5000  # the first of the passes, coded before anything is learnt
    assert 8 * len(coded(bits, contexts, 2)) < 1.01 * entropy + unknown


def test_size_is_small_when_the_first_guess_is_right():
    bits = np.ones(2000, np.bool_)
    contexts = np.repeat(np.arange(20), 100)  # each pass is the first to use its context
    assert len(coded(bits, contexts, 20, CERTAIN)) < 0.1 * len(coded(bits, contexts, 20))


def test_counts_stay_bounded_when_very_many_bits_are_coded():
    model = AdaptiveBits(np.array([CERTAIN // 2]))
    for _ in range(10):
        model.code(BitWriter(), np.ones(5000, np.bool_), np.zeros(5000, np.int64))
    assert model._total[0] <= 5000 * INCREMENT
    assert 0 < model._ones[0] <= model._total[0]


def test_bits_cost_one_each_when_nothing_is_known_of_them():
    bits = np.random.default_rng(3).random(100) < 0.5
    writer, even = BitWriter(), np.full(100, 0.5)
    writer.code(bits, even)
    assert len(writer.words()) <= 20
    np.testing.assert_array_equal(BitReader(writer.words()).code(None, even), bits)


def test_finishing_raises_when_words_are_left_over():
    with pytest.raises(CorruptStreamError, match="left over"):
        BitReader(b"\1\0\0\0" * 3).finish()


def test_reading_raises_when_no_coder_ends_with_the_words():
    with pytest.raises(CorruptStreamError, match="damaged"):
        BitReader(b"\0\0\0\0")
