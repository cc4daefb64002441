"""Atomic output files, which replace existing files only on request."""

import errno
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from meshreel.errors import OutputError
from meshreel.runtime.outputs.checks import check_output_paths, check_replaceable
from meshreel.runtime.outputs.hidden_folders import hidden_folder, remove_abandoned


@contextmanager
def replace_when_done(path: Path, *, overwrite: bool = False) -> Iterator[Path]:
    """A temporary path of the same name, renamed to `path` when the block succeeds.

    On an error the temporary file is removed and `path` is unchanged. Files that a killed process
    leaves are removed by the next one that writes into the folder.

    Raises
    ------
    InvalidInputError
        As `meshreel.runtime.outputs.checks.check_output_path`.
    OSError
        If writing fails; names `path`.
    """
    with replace_all_when_done([path], overwrite=overwrite) as temporaries:
        yield temporaries[0]


@contextmanager
def replace_all_when_done(
    paths: Sequence[Path], *, overwrite: bool = False, makes_folder: bool = False
) -> Iterator[list[Path]]:
    """A temporary path for each path, all renamed together when the block succeeds.

    Parameters
    ----------
    overwrite : bool, default False
        Whether existing files may be replaced.
    makes_folder : bool, default False
        Whether missing folders are created; on an error they are removed again.

    Raises
    ------
    InvalidInputError, OSError
        As `replace_when_done`.
    """
    check_output_paths(paths, overwrite=overwrite, makes_folder=makes_folder)
    with ExitStack() as folders:
        hidden: dict[Path, Path] = {}
        for folder in dict.fromkeys(path.parent for path in paths):
            folders.enter_context(_created(folder))
            remove_abandoned(folder)
            hidden[folder] = folders.enter_context(hidden_folder(folder))
        outputs = {hidden[path.parent] / path.name: path for path in paths}
        with _errors_naming(outputs):
            yield list(outputs)
            for path in paths:
                check_replaceable(path, overwrite=overwrite)
            for temporary, path in outputs.items():
                temporary.replace(path)


_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Numbers of errors of a full disk, an exhausted quota and a file of the maximum size."""


@contextmanager
def os_errors_naming_output(path: Path) -> Iterator[None]:
    """A context in which an OSError without a file name names `path`."""
    with _errors_naming({path: path}):
        yield


@contextmanager
def _created(folder: Path) -> Iterator[None]:
    """A context in which the folder exists; folders created for it are removed on an error."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        for path in missing:
            with suppress(OSError):
                path.rmdir()
        raise


@contextmanager
def _errors_naming(outputs: Mapping[Path, Path]) -> Iterator[None]:
    """A context in which an OSError about a temporary file names its output instead."""
    try:
        yield
    except OSError as error:
        if error.errno is None or (output := _output_of(error, outputs)) is None:
            raise
        if error.errno in _FULL:
            reason = error.strerror or os.strerror(error.errno)
            full = OutputError(f"{output} cannot be written ({reason}); free some space")
            full.errno, full.filename = error.errno, str(output)
            raise full from error
        raise OSError(error.errno, error.strerror or os.strerror(error.errno), str(output)) from (
            error
        )


def _output_of(error: OSError, outputs: Mapping[Path, Path]) -> Path | None:
    """The output that an error concerns; None if it concerns another file."""
    if error.filename is None:
        # Files are written sequentially: the error concerns the last that was started.
        started = [path for temporary, path in outputs.items() if temporary.exists()]
        return started[-1] if started else next(iter(outputs.values()))
    file = Path(os.fsdecode(error.filename)) if not isinstance(error.filename, int) else Path()
    if file in outputs:
        return outputs[file]
    same_folder = [path for temporary, path in outputs.items() if temporary.parent in file.parents]
    return same_folder[0] if same_folder else None
