"""Whether outputs may be written, known before any work."""

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

from meshreel.errors import InvalidInputError
from meshreel.runtime.outputs.hidden_folders import hidden_folder


def check_output_path(path: Path, *, overwrite: bool, inputs: Iterable[Path] = ()) -> None:
    """Refuse a path that cannot or must not be written, before any work is done.

    Parameters
    ----------
    overwrite : bool
        Whether a file that is there already may be replaced.
    inputs : iterable of Path
        Files that the output is made from: they are never replaced.

    Raises
    ------
    InvalidInputError
        If the folder does not exist or takes no file, the path is a folder or an input, under
        whatever name, or a file is there already and `overwrite` is false.
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
    paths : sequence of Path
    overwrite, inputs
        As in `check_output_path`.
    makes_folder : bool, default False
        Whether a folder that does not exist will be made.

    Raises
    ------
    InvalidInputError
        As `check_output_path`.
    """
    for folder in dict.fromkeys(path.parent for path in paths):
        check_output_folder(folder, makes_folder=makes_folder)
    given = {found: file for file in inputs if (found := _identity(file))}
    for path in paths:
        if given and (identity := _identity(path)) in given:
            raise InvalidInputError(_is_input(path, given[identity]))
        check_replaceable(path, overwrite=overwrite)


def check_replaceable(path: Path, *, overwrite: bool) -> None:
    """Refuse a path that holds something that must not be replaced.

    Raises
    ------
    InvalidInputError
        If it is a folder or no plain file, or a file is there already and `overwrite` is false.
    """
    if path.is_dir():
        raise InvalidInputError(f"{path} is a folder; name a file")
    if not os.path.lexists(path):
        return
    if not overwrite:
        raise InvalidInputError(f"{path} exists and is kept; use --force (overwrite=True)")
    if path.exists() and not path.is_file():
        raise InvalidInputError(f"{path} is a device or a pipe, not a file; name a file")


def check_output_folder(
    folder: Path, *, makes_folder: bool = True, inputs: Iterable[Path] = ()
) -> None:
    """Refuse a folder that takes no files: a file is written there, and removed.

    Parameters
    ----------
    makes_folder : bool, default True
        Whether a folder that does not exist will be made.
    inputs : iterable of Path
        None of them may lie in the folder, whose files will be replaced.

    Raises
    ------
    InvalidInputError
        If it is a file, does not exist and will not be made, an input lies in it, or nothing can
        be written into it.
    """
    place = folder
    while makes_folder and not place.exists() and place != place.parent:
        place = place.parent
    if not place.is_dir():
        if place.exists():
            raise InvalidInputError(f"{place} is a file; name a folder for the output")
        raise InvalidInputError(f"the output folder {folder} does not exist; create it first")
    for file in inputs:
        if file.resolve().is_relative_to(folder.resolve()):
            raise InvalidInputError(
                f"the input {file} lies in {folder}, the folder of the output; name another folder"
            )
    try:
        with hidden_folder(place):
            pass
    except OSError as error:
        raise InvalidInputError(
            f"nothing can be written into the folder {place} ({error.strerror}); name another"
        ) from None


def check_ending(path: Path, endings: Sequence[str], advice: str = "") -> str:
    """The ending of an output in small letters, which is known to be one of those allowed.

    Parameters
    ----------
    endings : sequence of str
        In small letters, with the dot.
    advice : str, optional
        For other endings: a sentence for the error.

    Raises
    ------
    InvalidInputError
        If it is another.
    """
    ending = path.suffix.lower()
    if ending not in endings:
        raise InvalidInputError(
            f"{path} must end in {', '.join(endings)}; got {path.suffix or 'no ending'}"
            + (f"; {advice}" if advice else "")
        )
    return ending


def _identity(path: Path) -> tuple[int, int] | None:
    """Device and inode of the file behind a path, through links; None if there is none."""
    try:
        facts = path.stat()
    except OSError:
        return None
    return facts.st_dev, facts.st_ino


def _is_input(path: Path, file: Path) -> str:
    other = "" if path == file else f" {file}, under another name"
    return f"{path} is the input{other}, which is never replaced; name another output"
