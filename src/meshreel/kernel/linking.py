"""Compiler and linker flags for C and C++ programs that use the library of this package."""

import shlex
import sys
from pathlib import Path

from meshreel.errors import InvalidInputError
from meshreel.kernel.library import NAME

HEADER = "meshreel.h"
_HERE = Path(__file__).parent
_IN_CHECKOUT = _HERE.parents[2] / "core" / "include"


def compiler_flags() -> list[str]:
    """Shell-quoted compiler flags to find `meshreel.h`.

    Raises
    ------
    InvalidInputError
        If the header is missing.
    """
    for folder in (_HERE, _IN_CHECKOUT):
        if (folder / HEADER).exists():
            return [shlex.quote(f"-I{folder}")]
    raise InvalidInputError(f"{HEADER} is not in {_HERE}; install meshreel again")


def linker_flags() -> list[str]:
    """Shell-quoted linker flags to find the library, also at run time."""
    if sys.platform == "win32":
        return [shlex.quote(str(_HERE / NAME))]
    name = NAME.removeprefix("lib").split(".")[0]
    return [shlex.quote(f"-L{_HERE}"), f"-l{name}", shlex.quote(f"-Wl,-rpath,{_HERE}")]
