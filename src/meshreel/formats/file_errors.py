"""Errors about the contents of a file, with its name."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from meshreel.errors import InvalidInputError, MeshReelError, StoreError


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
