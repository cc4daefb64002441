"""The words of a family of d3plot files, addressed as if they were one file."""

import os
import re
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.errors import FormatError
from meshreel.formats.file_errors import os_errors_naming

END = -999999.0
"""Value of the word after the last state of a file."""

FILE_TYPE = 11
"""Word with the type of the file."""

FILE_TYPES = {1: "d3plot", 2: "d3drlf", 5: "d3part"}
"""Supported types, whose layout is the same."""

CHUNK = 1 << 16


class Words:
    """The words of a root file and its numbered members, in order.

    Parameters
    ----------
    root : Path
        The first file; members have its name followed by digits, as in ``d3plot01``.

    Attributes
    ----------
    float_type : dtype
        float32 or float64.
    n_words : int
        Total of all files.
    starts : tuple of int
        First word of each file, and `n_words`.

    Raises
    ------
    FormatError
        If the root is not a d3plot file of a supported type.
    InvalidInputError
        If a file cannot be read.
    """

    def __init__(self, root: Path) -> None:
        self._paths = [root, *members(root)]
        with os_errors_naming(root), root.open("rb") as file:
            self._integer = _word_type(file.read(8 * (FILE_TYPE + 1)))
        self._float = np.dtype(f"{self._integer.byteorder}f{self._integer.itemsize}")
        self.float_type: np.dtype[Any] = self._float.newbyteorder("=")
        sizes = [path.stat().st_size // self._integer.itemsize for path in self._paths]
        self.starts: tuple[int, ...] = (0, *accumulate(sizes))
        self.n_words: int = self.starts[-1]

    def integers(self, start: int, count: int) -> Integers:
        """Read consecutive words as integers; raises as `floats`."""
        return self._read(start, count, self._integer).astype(np.int64, copy=False)

    def floats(self, start: int, count: int) -> npt.NDArray[np.floating]:
        """Read consecutive words as floats, of the precision of the file.

        Raises
        ------
        FormatError
            If the files end before.
        """
        return self._read(start, count, self._float).astype(self.float_type, copy=False)

    def text(self, start: int, n_bytes: int) -> str:
        """Read text from a word on, without its padding."""
        n_words = -(-n_bytes // self._integer.itemsize)
        words = self._read(start, n_words, self._integer)
        data = words.astype(self._integer).tobytes()[:n_bytes]  # concatenation swaps bytes
        return data.decode("latin-1").replace("\0", " ").strip()

    def words_of(self, n_bytes: int) -> int:
        """Return the number of words that a number of bytes takes."""
        return n_bytes // self._integer.itemsize

    def end_of_file(self, position: int) -> int:
        """Return the first word of the file after the one with a position."""
        return next(start for start in self.starts if start > position)

    def is_padding(self, start: int) -> bool:
        """Whether all words from here to the end of the file are 0."""
        stop = self.end_of_file(start)
        return not any(
            self._read(first, min(CHUNK, stop - first), self._integer).any()
            for first in range(start, stop, CHUNK)
        )

    def _read(self, start: int, count: int, dtype: np.dtype[Any]) -> npt.NDArray[Any]:
        if count < 0 or start < 0 or start + count > self.n_words:
            raise FormatError(
                f"needs {start + count} words; its files have {self.n_words}: one is missing, "
                "truncated, or compressed by FEMZIP, which is not supported"
            )
        found = []
        for path, first, stop in zip(self._paths, self.starts, self.starts[1:], strict=False):
            begin, end = max(start, first), min(start + count, stop)
            if begin < end:
                with os_errors_naming(path):
                    offset = (begin - first) * dtype.itemsize
                    found.append(np.fromfile(path, dtype, end - begin, offset=offset))
        words = np.concatenate(found) if found else np.empty(0, dtype)
        if len(words) != count:
            raise FormatError("became shorter while it was read; start again")
        return words


def members(root: Path) -> list[Path]:
    """Return the numbered files that continue a root file, in order: d3plot01, d3plot02."""
    pattern = re.compile(re.escape(root.name) + r"(\d{2,})")
    with os_errors_naming(root.parent):
        names = os.listdir(root.parent)
    found = [(int(match[1]), name) for name in names if (match := pattern.fullmatch(name))]
    return [root.with_name(name) for _, name in sorted(found)]


def adapted_roots(root: Path) -> list[Path]:
    """Return the root files of adapted meshes, in order: d3plotaa, d3plotab."""
    pattern = re.compile(re.escape(root.name) + r"[a-z]{2}")
    with os_errors_naming(root.parent):
        names = os.listdir(root.parent)
    return [root.with_name(name) for name in sorted(names) if pattern.fullmatch(name)]


def other_files(root: Path) -> list[Path]:
    """Return all files that continue a root file: its members, and adapted meshes with theirs."""
    adapted = adapted_roots(root)
    return [*members(root), *adapted, *(one for found in adapted for one in members(found))]


def _word_type(data: bytes) -> np.dtype[Any]:
    """Return the integer type of a file from the word with its file type."""
    found = []
    for code in ("<i4", ">i4", "<i8", ">i8"):
        dtype = np.dtype(code)
        words = np.frombuffer(data, dtype, len(data) // dtype.itemsize)
        if len(words) > FILE_TYPE:
            value = int(words[FILE_TYPE])
            if value in FILE_TYPES or value - 1000 in FILE_TYPES:
                return dtype
            found.append(value)
    if found and -12 < found[0] < 0:
        raise FormatError(
            "was written with *DATABASE_EXTENT_BINARY_COMP, which is not supported; run LS-DYNA "
            "without it"
        )
    raise FormatError(
        f"is not a d3plot file: its file type is {found[0] if found else '(none)'}; "
        f"{', '.join(f'{number} ({name})' for number, name in FILE_TYPES.items())} are supported"
    )
