"""Loading of the core, and calls of its functions, which release the interpreter's lock."""

import ctypes
import os
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import CorruptStreamError, InvalidInputError, TruncatedStreamError

ABI = 25
"""REEL_ABI of the `core/reel.h` that this package expects."""

PATH_VARIABLE = "MESHREEL_CORE"
"""Environment variable with the path of another build of the library, for tests."""

FOLDER = Path(__file__).parent
NAME = {"win32": "reel.dll", "darwin": "libreel.dylib"}.get(sys.platform, "libreel.so")
ALIGNMENT = 64
NO_MEMORY, TRUNCATED, CORRUPT, INVALID = range(1, 5)

Argument = Any
"""A number, bytes with their size, a contiguous array, None, or a ctypes reference."""


@cache
def library() -> ctypes.CDLL:
    """Load the core, from the package or from the path in the variable MESHREEL_CORE.

    Raises
    ------
    ImportError
        If it is missing, or was built from other sources than this package.
    """
    path = Path(os.environ.get(PATH_VARIABLE) or FOLDER / NAME)
    remedy = "install meshreel again, or run `python core/compile.py` in a checkout"
    try:
        core = ctypes.CDLL(str(path))
    except OSError as error:
        raise ImportError(f"the core cannot be loaded from {path}: {error}; {remedy}") from error
    core.reel_abi.restype = ctypes.c_int64
    abi = core.reel_abi()
    if abi != ABI:
        raise ImportError(f"{path} has interface {abi}; this meshreel needs {ABI}; {remedy}")
    return core


def call(
    function: str,
    *arguments: Argument,
    noun: str,
    memory_of: tuple[Any, ...] | None = None,
) -> int:
    """Call a function of the core, and return its result.

    The caller must check number types and shapes.

    Parameters
    ----------
    *arguments
        As in `core/reel.h`.
    noun : str
        Contents of the bytes, in the plural, for error messages.
    memory_of : tuple, optional
        The function that returns the size of the working memory, and its arguments. The memory and
        its size are passed before `arguments`.

    Raises
    ------
    TruncatedStreamError, CorruptStreamError
        If input bytes are damaged.
    InvalidInputError
        If an input array exceeds a limit of the format.
    """
    if memory_of is not None:
        work = memory(*memory_of)
        arguments = work, len(work), *arguments
    result = _run(function, *arguments)
    if result >= 0:
        return result
    code, position = -result & 0xFF, -result >> 8
    if code == TRUNCATED:
        raise TruncatedStreamError(f"the {noun} are truncated at position {position}")
    if code == CORRUPT:
        raise CorruptStreamError(f"the {noun} are damaged: invalid value at position {position}")
    if code == INVALID:
        raise InvalidInputError(
            f"the {noun} cannot be encoded: number {position} exceeds the limits of the format"
        )
    raise MemoryError(f"{function} got less memory than it requires ({position})")


def encoded(
    function: str,
    *arguments: Argument,
    noun: str,
    capacity: int,
    memory_of: tuple[Any, ...] | None = None,
) -> bytes:
    """Return the bytes that a function of the core writes, at most `capacity`; raises as `call`.

    They and their capacity are passed after `arguments`.
    """
    out = np.empty(capacity, np.uint8)
    size = call(function, *arguments, out, capacity, noun=noun, memory_of=memory_of)
    return out[:size].tobytes()


def int32s(values: npt.NDArray[np.integer]) -> npt.NDArray[np.int32]:
    """Return values as a contiguous int32 array; copied only if necessary."""
    return np.ascontiguousarray(values, np.int32)


def memory(size_function: str, *arguments: int) -> npt.NDArray[np.uint8]:
    """Uninitialized memory for a function of the core, aligned as required.

    Parameters
    ----------
    size_function : str
        The function of the core that returns its size, given the arguments.
    """
    size_bytes = _run(size_function, *arguments)
    block = np.empty(size_bytes + ALIGNMENT, np.uint8)
    start = -block.ctypes.data % ALIGNMENT
    return block[start : start + size_bytes]


def _run(name: str, *arguments: Argument) -> int:
    function = _function(name)
    if function.argtypes is None:  # set once: every call passes the same types
        function.argtypes = [kind for argument in arguments for kind in _types_of(argument)]
    c_arguments: list[Any] = []
    for argument in arguments:
        if isinstance(argument, np.ndarray):
            assert argument.flags.c_contiguous  # the core receives only its address
            c_arguments.append(argument.ctypes.data)
        elif isinstance(argument, bytes):
            c_arguments += argument, len(argument)
        else:
            c_arguments.append(argument)
    return int(function(*c_arguments))


@cache
def _function(name: str) -> Any:
    function = library()[name]
    function.restype = ctypes.c_int64
    return function


def _types_of(argument: Argument) -> tuple[Any, ...]:
    if isinstance(argument, bytes):
        return ctypes.c_void_p, ctypes.c_int64
    if isinstance(argument, int):
        return (ctypes.c_int64,)
    return (ctypes.c_double if isinstance(argument, float) else ctypes.c_void_p,)
