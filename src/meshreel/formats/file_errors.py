"""Error messages that begin with the name of a file."""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from meshreel.errors import InvalidInputError, MeshReelError, StoreError


def refuse_pipe(path: str | os.PathLike[str]) -> None:
    """Raise an error if an input is a pipe, a socket or a device.

    Readers seek in a file and read it several times, and opening a named pipe blocks until a
    program writes to it. A path that does not exist is accepted here.

    Raises
    ------
    InvalidInputError
        If it is not a file or folder; the message names the path and its kind.
    """
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):
        return
    if stat.S_ISREG(mode) or stat.S_ISDIR(mode):
        return
    kinds = {stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}
    raise InvalidInputError(
        f"{os.fspath(path)} is {kinds.get(stat.S_IFMT(mode), 'a device')}, but inputs must be "
        "files; save the data to a file first"
    )


@contextmanager
def errors_naming(path: str | os.PathLike[str]) -> Iterator[None]:
    """Context manager that adds the path of a file to errors about its contents."""
    try:
        yield
    except StoreError:  # its message already has the address
        raise
    except MeshReelError as error:
        raise type(error)(*error.message.parts, path=path) from None


def read_bytes(path: Path) -> bytes:
    """Return the contents of a file; raises an `InvalidInputError` that names it."""
    with os_errors_naming(path):
        return path.read_bytes()


@contextmanager
def os_errors_naming(path: Path) -> Iterator[None]:
    """Context manager that turns an OSError into an `InvalidInputError` that names the file."""
    try:
        yield
    except OSError as error:
        raise InvalidInputError(f"{path} cannot be read: {error.strerror}") from error
