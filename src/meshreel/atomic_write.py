"""Output that appears whole or not at all, and never over something unasked."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from meshreel.outputs.checks import check_output_path


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
