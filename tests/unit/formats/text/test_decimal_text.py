"""Detection of positions that need float64."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from meshreel.formats.text.decimal_text import MAX_EXACT, Narrowing, decimal_values


def test_narrowing_accepts_an_empty_frame():
    narrowing = Narrowing()
    narrowing.add(np.zeros((0, 3)))
    assert narrowing.is_harmless


def test_narrowing_is_harmful_far_from_the_origin():
    narrowing = Narrowing()
    narrowing.add(np.array([[1e8 + 0.25, 0, 0], [1e8 + 1, 0, 0]]))
    assert not narrowing.is_harmless


def read(words):
    """Parse words joined into one text; return values and whether each was parsed."""
    text = b" ".join(words) + b"\n"
    lengths = np.array([len(word) for word in words])
    starts = np.cumsum(lengths + 1) - lengths - 1
    return decimal_values(text, starts, starts + lengths)


def number_of(word):
    """Parse with Python, without the underscores that only Python allows; None if no number."""
    try:
        return None if b"_" in word else np.float64(word.decode("latin-1"))
    except ValueError:
        return None


PLAIN = st.from_regex(rb"[+-]?[0-9]{0,9}\.?[0-9]{0,10}", fullmatch=True).filter(len)
ANY = st.binary(min_size=1, max_size=20).filter(lambda word: len(word.split()) == 1)


@given(st.lists(PLAIN | ANY, min_size=1, max_size=40))
@example([b".", b"-", b"+.", b"5.", b".5", b"-.5", b"1.2.3", b"1..2", b"12345678.12345678"])
@example([b"1.23456789012345", b"0.00000000000001", b"1234567890123456", b"9999999999999999"])
@example([b"1-2", b"--1", b"1e5", b"nan", b"inf", b"0x10", b"1_0", b"/1", b":1", b"1.\xff"])
def test_decimal_values_equal_those_of_python(words):
    values, is_read = read(words)
    for word, value, was_read in zip(words, values, is_read, strict=True):
        if was_read:
            assert (word, value.tobytes()) == (word, number_of(word).tobytes())


@given(st.lists(st.floats(width=32, allow_nan=False, allow_infinity=False), min_size=1))
def test_nine_digit_numbers_are_parsed(numbers):
    words = [b"%.9g" % number for number in numbers]
    _, is_read = read(words)
    assert is_read.tolist() == [b"e" not in word for word in words]


@pytest.mark.parametrize(
    ("word", "expected"),
    [
        (b"-0", True),
        (str(MAX_EXACT).encode(), True),
        (str(MAX_EXACT + 1).encode(), False),
        (b"-0.12345678901234", True),
        (b"0.123456789012345", False),
        (b"1e5", False),
        (b".", False),
        (b"-", False),
    ],
)
def test_decimal_values_tells_which_words_were_parsed(word, expected):
    assert read([word, b"1"])[1].tolist() == [expected, True]


def test_decimal_values_keeps_the_sign_of_zero():
    assert np.signbit(read([b"-0.0", b"0.0", b"-0"])[0]).tolist() == [True, False, True]


def test_decimal_values_parses_several_blocks():
    words = [b"%d.%d" % (n % 97, n) for n in range(10000)]
    values, is_read = read(words)
    assert is_read.all()
    assert values.tolist() == [float(word) for word in words]
