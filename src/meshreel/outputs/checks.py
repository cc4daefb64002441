"""Whether a path may be written, known before any work."""

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
