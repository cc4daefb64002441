"""Output that appears whole or not at all, and never over something unasked."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from meshreel.errors import InvalidInputError


def check_output_path(path: Path, *, overwrite: bool) -> None:
    """Refuse a path that cannot or must not be written, before any work is done.

    Raises
    ------
    InvalidInputError
        If the folder does not exist, the path is a folder, or a file is there already and
        `overwrite` is false.
    """
    if not path.parent.is_dir():
        raise InvalidInputError(f"the output folder {path.parent} does not exist; create it first")
    if path.is_dir():
        raise InvalidInputError(f"{path} is a folder; name a file")
    if path.exists() and not overwrite:
        raise InvalidInputError(f"{path} exists and is kept; use --force (overwrite=True)")


@contextmanager
def replace_when_done(path: Path, *, overwrite: bool = False) -> Iterator[Path]:
    """A temporary path in the same folder, renamed to `path` when the block succeeds.

    On an error the temporary file is removed and `path` stays as it was.

    Raises
    ------
    InvalidInputError
        As `check_output_path`.
    """
    check_output_path(path, overwrite=overwrite)
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=path.suffix, dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
