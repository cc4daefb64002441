import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.text.token_lines import BLOCK_WORDS, split_lines


def words(lines):
    return [
        [lines.word(token) for token in range(first, first + count)]
        for first, count in zip(lines.first, lines.counts, strict=True)
    ]


@pytest.mark.parametrize("line_end", [b"\n", b"\r\n", b"\r"])
def test_split_lines_accepts_all_line_ends(line_end):
    lines = split_lines(line_end.join([b"v 1  2", b"", b"\tf 3", b" "]))
    assert words(lines) == [["v", "1", "2"], ["f", "3"]]


def test_split_lines_skips_comments():
    assert words(split_lines(b"# all\nv 1 # rest\n#")) == [["v", "1"]]


def test_backslash_joins_lines():
    lines = split_lines(b"f 1 \\\n2 \\\r\n3\nv", continuation=True)
    assert words(lines) == [["f", "1", "2", "3"], ["v"]]


def test_joined_lines_keep_their_line_numbers():
    lines = split_lines(b"f 1 \\\n2\n# comment\n\nv", continuation=True)
    assert lines.location(1) == "line 5"


def test_split_lines_skips_the_byte_order_mark():
    assert words(split_lines(b"\xef\xbb\xbfv 1")) == [["v", "1"]]


def test_empty_text_has_no_lines():
    assert split_lines(b"").n_lines == 0


@pytest.mark.parametrize("word", [b"v", b"vertex"])
def test_beginning_with_compares_whole_words(word):
    lines = split_lines(b"v 1\nvertex 1\nvn 1\nx\nvertices\nv")
    expected = [line for line, row in enumerate(words(lines)) if row[0].encode() == word]
    assert lines.beginning_with(word).tolist() == expected


def test_floats_equal_those_of_python():
    texts = [
        "0.1",
        "1e-320",
        "123456789.123456789",
        "-0",
        "nan",
        "1e400",
        "2.2250738585072011e-308",
    ]
    lines = split_lines(" ".join(texts).encode())
    result = lines.floats(np.arange(len(texts)))
    np.testing.assert_array_equal(result, np.array([float(text) for text in texts]))
    assert np.signbit(result[texts.index("-0")])


@pytest.mark.parametrize("step", [1, 2, 7])
def test_floats_parse_any_selection_in_blocks(step):
    numbers = np.arange(BLOCK_WORDS * step + 100) / 8
    lines = split_lines(" \n".join(map(str, numbers.tolist())).encode())
    assert np.array_equal(lines.floats(np.arange(1, len(numbers), step)), numbers[1::step])


def test_integers_accept_signs_and_slashes():
    lines = split_lines(b"7 -12 +3 007 5/6/7 8//9 999999999999999999")
    result = lines.integers(np.arange(7), stop_at_slash=True)
    assert result.tolist() == [7, -12, 3, 7, 5, 8, 999999999999999999]


@pytest.mark.parametrize("word", ["1.5", "x", "-", "1/2", "1e3", "1234567890123456789", "1_0"])
def test_integer_error_names_word_and_line(word):
    lines = split_lines(f"1 2\n3 {word}\n".encode())
    with pytest.raises(FormatError, match=r"line 2: expected an integer; got"):
        lines.integers(np.arange(4))


def test_float_error_names_word_and_line():
    lines = split_lines(b"1 2\n3 1-2\n")
    with pytest.raises(FormatError, match=r"line 2: expected a number; got '1-2'"):
        lines.floats(np.arange(4))


@pytest.mark.parametrize("code", ["utf-16-le", "utf-16-be", "utf-32-le", "utf-32-be"])
def test_wide_encodings_are_rejected_by_name(code):
    with pytest.raises(FormatError, match=f"text in {code[:6].upper()}, .* save it as UTF-8"):
        split_lines("\ufeffv 1 2 3".encode(code))


def test_utf_8_byte_order_mark_is_skipped():
    lines = split_lines("\ufeffv 1 2 3".encode())
    assert lines.word(0) == "v"
