"""Whole numbers in a text to int64, digit by digit for all words together."""

import numpy as np
import numpy.typing as npt

MAX_DIGITS = 18  # any more could overflow int64; no mesh has 10^18 vertices

Codes = npt.NDArray[np.uint8]


def are_spaces(codes: Codes) -> npt.NDArray[np.bool_]:
    """Whether each character stands between words."""
    # The blank, and the five from tab to carriage return: others wrap around to above 4.
    found: npt.NDArray[np.bool_] = (codes == ord(" ")) | (codes - np.uint8(ord("\t")) < 5)
    return found


def integer_values(
    codes: Codes, starts: npt.NDArray[np.int64], stop_at_slash: bool
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
    """The words that begin at those places as int64, and which of them are whole numbers.

    Parameters
    ----------
    codes : uint8 array
        The characters of a text, the last of them a space.
    starts : int64 array of shape (N,)
    stop_at_slash : bool
        Whether a word may go on after a slash, as in ``7/3/1``; what follows is not read.
    """
    values = np.zeros(len(starts), dtype=np.int64)
    sign = codes[starts]
    begin = starts + ((sign == ord("-")) | (sign == ord("+")))
    at = begin.copy()
    for _ in range(MAX_DIGITS):
        digit = codes[at] - np.uint8(ord("0"))  # wraps to above 9 for what is not a digit
        more = digit < 10
        if not more.any():
            break
        values[more] = values[more] * 10 + digit[more]
        at += more
    ends = codes[at]
    are_good = (at > begin) & (are_spaces(ends) | (stop_at_slash & (ends == ord("/"))))
    values[sign == ord("-")] *= -1
    return values, are_good
