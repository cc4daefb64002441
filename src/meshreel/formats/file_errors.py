"""Errors about the contents of a file, with its name."""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from meshreel.errors import InvalidInputError, MeshReelError, StoreError


def refuse_pipe(path: str | os.PathLike[str]) -> None:
    """Refuse a pipe, a socket or a device where an input file is needed.

    Readers seek in a file and read it several times, and opening a named pipe waits until some
    program writes into it. A path that does not exist is not refused here.

    Raises
    ------
    InvalidInputError
        Naming the path and what it is.
    """
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):
        return
    if stat.S_ISREG(mode) or stat.S_ISDIR(mode):
        return
    kinds = {stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}
    raise InvalidInputError(
        f"{os.fspath(path)} is {kinds.get(stat.S_IFMT(mode), 'a device')}, and inputs must be "
        "files; save its data to a file first, and name that file"
    )


@contextmanager
def errors_naming(path: str | os.PathLike[str]) -> Iterator[None]:
    """Within it, errors about the contents of a file begin with its path."""
    try:
        yield
    except StoreError:  # which names its address
        raise
    except MeshReelError as error:
        raise type(error)(f"{path}: {error}") from None


@contextmanager
def os_errors_naming(path: Path) -> Iterator[None]:
    """Within it, a file that cannot be read is an `InvalidInputError` that names it."""
    try:
        yield
    except OSError as error:
        raise InvalidInputError(f"{path} cannot be read: {error.strerror}") from error
