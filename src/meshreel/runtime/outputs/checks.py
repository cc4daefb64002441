"""Checks of output paths before any work is done."""

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

from meshreel.errors import InvalidInputError, Keyword
from meshreel.runtime.outputs.hidden_folders import hidden_folder


def check_output_path(path: Path, *, overwrite: bool, inputs: Iterable[Path] = ()) -> None:
    """Refuse a path that cannot or must not be written.

    Parameters
    ----------
    overwrite : bool
        Whether an existing file may be replaced.
    inputs : iterable of Path
        Input files, which are never replaced.

    Raises
    ------
    InvalidInputError
        If the folder does not exist or is not writable, the path is a folder or an input (also
        through a link), or the file exists and `overwrite` is false.
    """
    check_output_paths([path], overwrite=overwrite, inputs=inputs)


def check_output_paths(
    paths: Sequence[Path],
    *,
    overwrite: bool,
    inputs: Iterable[Path] = (),
    makes_folder: bool = False,
) -> None:
    """Refuse paths as `check_output_path` does.

    Parameters
    ----------
    overwrite, inputs
        As in `check_output_path`.
    makes_folder : bool, default False
        Whether a missing folder will be created.

    Raises
    ------
    InvalidInputError
        As `check_output_path`.
    """
    for folder in dict.fromkeys(path.parent for path in paths):
        check_output_folder(folder, makes_folder=makes_folder)
    input_files = {identity: file for file in inputs if (identity := _identity(file))}
    for path in paths:
        if input_files and (identity := _identity(path)) in input_files:
            same = input_files[identity]
            alias = "" if path == same else f" {same}, under another name"
            raise InvalidInputError(
                f"{path} is the input{alias}, which is never replaced; name another output"
            )
        check_replaceable(path, overwrite=overwrite)


def check_replaceable(path: Path, *, overwrite: bool) -> None:
    """Refuse a path whose file must not be replaced.

    Raises
    ------
    InvalidInputError
        If it is a folder, a device or a pipe, or it exists and `overwrite` is false.
    """
    if path.is_dir():
        raise InvalidInputError(f"{path} is a folder; name a file")
    if not os.path.lexists(path):
        return
    if not overwrite:
        raise InvalidInputError(
            f"{path} already exists; use ", Keyword("overwrite", True), " to replace it"
        )
    if path.exists() and not path.is_file():
        raise InvalidInputError(f"{path} is a device or a pipe, not a file; name a file")


def check_output_folder(
    folder: Path, *, makes_folder: bool = True, inputs: Iterable[Path] = ()
) -> None:
    """Refuse a folder that is not writable; tested with a temporary folder in it.

    Parameters
    ----------
    makes_folder : bool, default True
        Whether a missing folder will be created.
    inputs : iterable of Path
        Input files, which must not be in the folder, whose files will be replaced.

    Raises
    ------
    InvalidInputError
        If it is a file, is missing and will not be created, contains an input, or is not writable.
    """
    existing = folder
    while makes_folder and not existing.exists() and existing != existing.parent:
        existing = existing.parent
    if not existing.is_dir():
        if existing.exists():
            raise InvalidInputError(f"{existing} is a file; name a folder for the output")
        raise InvalidInputError(f"the output folder {folder} does not exist; create it first")
    for file in inputs:
        if file.resolve().is_relative_to(folder.resolve()):
            raise InvalidInputError(
                f"the input {file} is in the output folder {folder}; name another folder"
            )
    try:
        with hidden_folder(existing):
            pass
    except OSError as error:
        raise InvalidInputError(
            f"the folder {existing} is not writable ({error.strerror}); name another folder"
        ) from None


def check_extension(path: Path, extensions: Sequence[str], advice: str = "") -> str:
    """Return the file extension of an output in lower case, if it is allowed.

    Parameters
    ----------
    extensions : sequence of str
        Allowed extensions in lower case, with the dot.
    advice : str, optional
        A sentence to add to the error.

    Raises
    ------
    InvalidInputError
        If it is not allowed.
    """
    extension = path.suffix.lower()
    if extension not in extensions:
        raise InvalidInputError(
            f"{path} must end in {', '.join(extensions)}; got {path.suffix or 'no extension'}"
            + (f"; {advice}" if advice else "")
        )
    return extension


def _identity(path: Path) -> tuple[int, int] | None:
    """Device and inode of a file, through links; None if it does not exist."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino
