"""Loads the core and calls its functions; other threads run while one does."""

import ctypes
import os
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import CorruptStreamError, InvalidInputError, TruncatedStreamError

ABI = 12
"""REEL_ABI of the `core/reel.h` that the modules of this room are written for."""

PLACE = "MESHREEL_CORE"
"""Environment variable: a library to load instead of that of the package, to test other builds."""

NAME = {"win32": "reel.dll", "darwin": "libreel.dylib"}.get(sys.platform, "libreel.so")
ALIGNMENT = 64
NO_MEMORY, TRUNCATED, CORRUPT, INVALID = range(1, 5)

Argument = Any
"""Integers, bytes, contiguous arrays, None; references of structures of ctypes."""


@cache
def library() -> ctypes.CDLL:
    """The core: that of the package, or the one that the environment variable `PLACE` names.

    Raises
    ------
    ImportError
        If it was not built, or from other sources than this package.
    """
    path = Path(os.environ.get(PLACE) or Path(__file__).with_name(NAME))
    remedy = "install meshreel again, or run `python core/compile.py` in a checkout"
    try:
        loaded = ctypes.CDLL(str(path))
    except OSError as error:
        raise ImportError(f"the core cannot be loaded from {path}: {error}; {remedy}") from error
    loaded.reel_abi.restype = ctypes.c_int64
    found = loaded.reel_abi()
    if found != ABI:
        raise ImportError(f"{path} has interface {found}; this meshreel needs {ABI}; {remedy}")
    return loaded


def size_of(function: str, *arguments: int) -> int:
    """What a function of the core that states a size returns."""
    found = _function(function)(*(ctypes.c_int64(argument) for argument in arguments))
    return int(found)


def call(
    function: str,
    *arguments: Argument,
    what: str,
    memory_of: tuple[Any, ...] | None = None,
) -> int:
    """Return the result of a function of the core.

    The caller has checked number types and shapes.

    Parameters
    ----------
    *arguments
        As in `core/reel.h`.
    what : str
        Contents of the bytes, in the plural, for error messages.
    memory_of : tuple, optional
        The function that states the size of the working memory, and its arguments. The memory and
        its size are passed before `arguments`.

    Raises
    ------
    TruncatedStreamError, CorruptStreamError
        If bytes that came in are damaged.
    InvalidInputError
        If an array that is to be coded breaks a limit of the format.
    """
    if memory_of is not None:
        work = memory(size_of(*memory_of))
        arguments = work, len(work), *arguments
    result = int(_function(function)(*map(_passed, arguments)))
    if result >= 0:
        return result
    code, place = -result & 0xFF, -result >> 8
    if code == TRUNCATED:
        raise TruncatedStreamError(f"the {what} are cut off at {place}")
    if code == CORRUPT:
        raise CorruptStreamError(f"the {what} are damaged: what stands at {place} cannot be")
    if code == INVALID:
        raise InvalidInputError(f"the {what} cannot be coded: number {place} is beyond the limits")
    raise MemoryError(f"{function} was given less memory than it states ({place})")


def memory(size_bytes: int) -> npt.NDArray[np.uint8]:
    """Memory for a function of the core, aligned as it asks for; not filled."""
    block = np.empty(size_bytes + ALIGNMENT, np.uint8)
    start = -block.ctypes.data % ALIGNMENT
    return block[start : start + size_bytes]


@cache
def _function(name: str) -> Any:
    function = library()[name]
    function.restype = ctypes.c_int64
    return function


def _passed(argument: Argument) -> Any:
    if argument is None or isinstance(argument, bytes):
        return ctypes.c_char_p(argument)
    if isinstance(argument, np.ndarray):
        assert argument.flags.c_contiguous  # else what is passed is not what it shows
        return ctypes.c_void_p(argument.ctypes.data)
    return ctypes.c_int64(argument) if isinstance(argument, int) else argument
