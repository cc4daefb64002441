"""Tokenizer that finds the words and lines of a text file as arrays.

Text mesh files have millions of short numbers, too many for a Python loop over lines. numpy finds
all words at once and parses all numbers together, in any layout: plain, with slashes, with extra
columns, or of mixed length.
"""

import codecs
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.model.geometry.polygons import Integers

BLOCK_WORDS = 1 << 16  # words parsed at a time, to bound memory

WIDE_CODES = {
    "UTF-32": (codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE),
    "UTF-16": (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE),
}
"""Byte order marks of encodings with several bytes per character."""

_Values = TypeVar("_Values", npt.NDArray[np.int64], npt.NDArray[np.float64])

MAX_DIGITS = 18  # more could overflow int64; no mesh has 10^18 vertices

Codes = npt.NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class TokenLines:
    """The words of a text grouped by line; empty lines are omitted."""

    text: bytes
    """The text, extended by a line feed."""
    physical: bytes
    """Text of the same length with the line ends of the file; only for line numbers."""
    starts: npt.NDArray[np.int64]
    ends: npt.NDArray[np.int64]
    """int64 arrays of shape (number of words,). Byte range of each word."""
    first: npt.NDArray[np.int64]
    counts: npt.NDArray[np.int64]
    """int64 arrays of shape (number of lines,). First word and number of words of each line."""

    @property
    def n_lines(self) -> int:
        """Number of lines with at least one word."""
        return len(self.first)

    def word(self, token: int) -> str:
        """Return a word, shortened for messages."""
        word = self.text[self.starts[token] : self.ends[token]].decode("latin-1")
        return word if len(word) <= 40 else word[:37] + "..."

    def location(self, line: int) -> str:
        """Describe the location of a line in the file, such as "line 12"."""
        return self.word_location(int(self.first[line]))

    def word_location(self, token: int) -> str:
        """Describe the location of a word in the file, such as "line 12"."""
        lines_before = self.physical.count(b"\n", 0, int(self.starts[token]))
        return f"line {lines_before + 1}"

    def words_after_first(self, line: int) -> str:
        """Return all words of a line after the first, joined by blanks."""
        first, last = self.first[line], self.first[line] + self.counts[line] - 1
        text = b" ".join(self.text[self.ends[first] : self.ends[last]].split())
        try:
            return text.decode("utf-8")
        except UnicodeDecodeError:
            return text.decode("latin-1")

    def beginning_with(self, word: bytes) -> npt.NDArray[np.int64]:
        """Return the lines whose first word is `word`."""
        starts, codes = self.starts[self.first], self._codes()
        lines = np.flatnonzero(self.ends[self.first] - starts == len(word))
        for offset, code in enumerate(word):
            lines = lines[codes[starts[lines] + offset] == code]
        return lines

    def other_first_words(self, known: Iterable[bytes]) -> list[str]:
        """Return the first words of lines that do not begin with one of the known words."""
        is_known = np.zeros(self.n_lines, bool)
        for word in known:
            is_known[self.beginning_with(word)] = True
        tokens = self.first[~is_known]
        words = dict.fromkeys(self._words(tokens)) if len(tokens) else {}
        return [word.decode("latin-1") for word in words]

    def floats(self, tokens: Integers) -> npt.NDArray[np.float64]:
        """Parse words as correctly rounded float64, in the shape of `tokens`.

        Parameters
        ----------
        tokens : integer array
            Word indices, ascending when flattened.

        Raises
        ------
        FormatError
            If a word is not a number; the message names the first one and its line.
        """
        flat = tokens.ravel()
        values = np.empty(len(flat))
        for block, block_values in _blocks(flat, values):
            words = self._words(block)
            try:
                block_values[:] = words
            except ValueError:
                bad = (i for i, word in enumerate(words) if not _is_number(word))
                raise self._syntax_error(int(block[next(bad, 0)]), "a number") from None
        return values.reshape(tokens.shape)

    def integers(self, tokens: Integers, *, stop_at_slash: bool = False) -> npt.NDArray[np.int64]:
        """Parse words as int64, of shape (number of tokens,).

        Parameters
        ----------
        tokens : integer array of shape (number of tokens,)
            Word indices.
        stop_at_slash : bool, default False
            Whether to ignore a slash and the rest of a word, as in ``7/3/1``.

        Raises
        ------
        FormatError
            If a word is not an integer; the message names the first one and its line.
        """
        values = np.empty(len(tokens), dtype=np.int64)
        for block, block_values in _blocks(tokens, values):
            block_values[:], valid = integer_values(
                self._codes(), self.starts[block], stop_at_slash
            )
            if not valid.all():
                raise self._syntax_error(int(block[np.argmin(valid)]), "an integer")
        return values

    def integers_after_slash(
        self, tokens: Integers, n_slashes: int = 1
    ) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
        """Parse the integer after a slash of each word, as 7 in ``3/7/1``, and whether it exists.

        Parameters
        ----------
        tokens : integer array of shape (number of tokens,)
            Word indices.
        n_slashes : int, default 1
            Slashes before the integer: 2 selects 1 in ``3/7/1``.

        Raises
        ------
        FormatError
            If an integer is invalid; the message names the first such word and its line.
        """
        codes = self._codes()
        slashes = np.append(np.flatnonzero(codes == ord("/")), [len(codes) - 1] * n_slashes)
        starts = slashes[np.searchsorted(slashes, self.starts[tokens]) + n_slashes - 1] + 1
        ends = self.ends[tokens]
        has_value = starts < ends
        has_value[has_value] = codes[starts[has_value]] != ord("/")
        suffixes = replace(self, starts=starts[has_value], ends=ends[has_value])
        values = np.zeros(len(tokens), dtype=np.int64)
        values[has_value] = suffixes.integers(np.arange(len(suffixes.starts)), stop_at_slash=True)
        return values, has_value

    def have_points(self, tokens: Integers) -> bool:
        """Whether any of the words has a decimal point."""
        points = np.flatnonzero(self._codes() == ord("."))
        starts, ends = self.starts[tokens.ravel()], self.ends[tokens.ravel()]
        return bool((np.searchsorted(points, starts) < np.searchsorted(points, ends)).any())

    def positions(self, rows: Integers, n_before: int = 0) -> npt.NDArray[np.float64]:
        """Return the x, y and z of vertices on the given lines, of shape (V, 3).

        Parameters
        ----------
        n_before : int, default 0
            Number of words before x.

        Raises
        ------
        FormatError
            If a line has fewer than three words after these, or as `floats`.
        """
        n_numbers = self.counts[rows] - n_before
        if (is_short := n_numbers < len("xyz")).any():
            row = int(np.argmax(is_short))
            raise FormatError(
                f"{self.location(rows[row])}: a vertex needs x, y and z; "
                f"got {n_numbers[row]} numbers"
            )
        return self.floats(self.first[rows][:, None] + n_before + np.arange(3))

    def _words(self, tokens: Integers) -> list[bytes]:
        """Return words, given their ascending numbers."""
        first, last = tokens[0], tokens[-1]
        # Splitting is three times as fast as slicing, but creates the words between these too.
        if last - first < 2 * len(tokens):
            words = self.text[self.starts[first] : self.ends[last]].split()
            if len(words) == len(tokens):
                return words
            return [words[index] for index in (tokens - first).tolist()]
        ranges = zip(self.starts[tokens].tolist(), self.ends[tokens].tolist(), strict=True)
        return [self.text[start:end] for start, end in ranges]

    def _codes(self) -> npt.NDArray[np.uint8]:
        return np.frombuffer(self.text, dtype=np.uint8)

    def _syntax_error(self, token: int, expected: str) -> FormatError:
        location, word = self.word_location(token), self.word(token)
        return FormatError(f"{location}: expected {expected}; got {word!r}")


def split_lines(data: bytes, *, continuation: bool = False) -> TokenLines:
    r"""Split a text into lines and words, without comments from ``#`` to the end of the line.

    Parameters
    ----------
    data : bytes
        Text in ASCII or a superset such as UTF-8; lines end with LF, CRLF or CR.
    continuation : bool, default False
        Whether a backslash at the end of a line joins the next line to it.

    Raises
    ------
    FormatError
        If the text is in UTF-16 or UTF-32.
    """
    for code, mark in WIDE_CODES.items():
        if data.startswith(mark):
            raise FormatError(f"is text in {code}, which is not supported; save it as UTF-8")
    text = data.removeprefix(b"\xef\xbb\xbf") + b"\n"
    if b"\r" in text and text.count(b"\n") == 1:
        text = text.replace(b"\r", b"\n")
    if b"#" in text:
        text = re.sub(rb"#[^\n]*", lambda comment: b" " * len(comment[0]), text)
    physical = text
    if continuation and b"\\" in text:
        # Blanks of the same length keep byte offsets valid for line numbers.
        text = text.replace(b"\\\r\n", b"   ").replace(b"\\\n", b"  ")
        text = text[:-1] + b"\n"

    codes = np.frombuffer(text, dtype=np.uint8)
    space = np.concatenate([[True], are_spaces(codes)])
    edges = np.flatnonzero(space[1:] != space[:-1])
    starts, ends = edges[0::2], edges[1::2]
    words_so_far = np.searchsorted(starts, np.flatnonzero(codes == ord("\n")))
    counts = np.diff(words_so_far, prepend=0)
    lines = np.flatnonzero(counts)
    return TokenLines(text, physical, starts, ends, (words_so_far - counts)[lines], counts[lines])


def _blocks(tokens: Integers, values: _Values) -> Iterator[tuple[Integers, _Values]]:
    """Yield blocks of words with the matching part of `values`."""
    for begin in range(0, len(tokens), BLOCK_WORDS):
        end = begin + BLOCK_WORDS
        yield tokens[begin:end], values[begin:end]


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def are_spaces(codes: Codes) -> npt.NDArray[np.bool_]:
    """Return a mask of the whitespace characters."""
    # The blank, and the five codes from tab to carriage return; others wrap around to above 4.
    mask: npt.NDArray[np.bool_] = (codes == ord(" ")) | (codes - np.uint8(ord("\t")) < 5)
    return mask


def integer_values(
    codes: Codes, starts: npt.NDArray[np.int64], stop_at_slash: bool
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
    """Parse words at the given offsets as int64, and return which are integers.

    Parameters
    ----------
    codes : uint8 array
        Characters of a text that ends with whitespace.
    starts : int64 array of shape (N,)
    stop_at_slash : bool
        Whether to ignore a slash and the rest of a word, as in ``7/3/1``.
    """
    values = np.zeros(len(starts), dtype=np.int64)
    sign = codes[starts]
    begin = starts + ((sign == ord("-")) | (sign == ord("+")))
    offsets = begin.copy()
    for _ in range(MAX_DIGITS):
        digit = codes[offsets] - np.uint8(ord("0"))  # other characters wrap around to above 9
        is_digit = digit < 10
        if not is_digit.any():
            break
        values[is_digit] = values[is_digit] * 10 + digit[is_digit]
        offsets += is_digit
    ends = codes[offsets]
    are_integers = (offsets > begin) & (are_spaces(ends) | (stop_at_slash & (ends == ord("/"))))
    values[sign == ord("-")] *= -1
    return values, are_integers
