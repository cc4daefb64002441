"""Checks of input files before they are read, and error messages that begin with their names."""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from meshreel.errors import FormatError, InvalidInputError, MeshReelError, StoreError

LFS_POINTER = b"version https://git-lfs.github.com/spec/v1"
"""Beginning of the text that Git stores in place of a file in Git LFS (large file storage)."""

MAX_POINTER_BYTES = 1024

FOLDER_MARK = ".foam"
"""Extension of files, usually empty, whose folder is the input."""


def check_input_file(path: str | os.PathLike[str]) -> None:
    """Raise an error if an input is a pipe, a socket, a device, an empty file or a Git LFS pointer.

    Readers seek in a file and read it several times, and opening a named pipe blocks until a
    program writes to it. A path that does not exist or cannot be read is accepted here.

    Raises
    ------
    InvalidInputError
        If it is not a file or folder; the message names the path and its kind.
    FormatError
        If the file is empty, or Git LFS has not replaced its pointer by the contents.
    """
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return
    if not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)):
        kinds = {stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}
        raise InvalidInputError(
            f"{os.fspath(path)} is {kinds.get(stat.S_IFMT(status.st_mode), 'a device')}, but "
            "inputs must be files; save the data to a file first"
        )
    if stat.S_ISDIR(status.st_mode) or status.st_size > MAX_POINTER_BYTES:
        return
    if status.st_size == 0 and Path(path).suffix.lower() != FOLDER_MARK:
        raise FormatError("is empty", path=path)
    with suppress(OSError), Path(path).open("rb") as file:
        if file.read(len(LFS_POINTER)) == LFS_POINTER:
            raise FormatError("is a Git LFS pointer; run `git lfs pull`", path=path)


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
