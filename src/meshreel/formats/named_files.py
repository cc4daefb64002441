"""Files that other files name: only those in their folder or below, unless others are allowed."""

from pathlib import Path

from meshreel.errors import FormatError
from meshreel.formats.remote import fetch_beside


def path_beside(named_in: Path, given: str, *, allow_outside: bool) -> Path:
    """The path of a file that another names, relative to the folder of that.

    Parameters
    ----------
    allow_outside : bool
        Whether it may be outside of that folder.

    Raises
    ------
    FormatError
        If it is where it may not be, or not there.
    """
    folder = named_in.resolve().parent
    try:
        found = (folder / given.strip()).resolve()
        is_file = found.is_file()
    except (OSError, ValueError) as error:
        raise FormatError(f"names the file {given[:80]!r}, which is no path ({error})") from error
    if not (allow_outside or is_within(found, folder)):
        raise outside_error(given)
    if not is_file and not fetch_beside(found):
        raise FormatError(f"names the file {given!r}, which is not there")
    return found


def is_within(path: Path, folder: Path) -> bool:
    """Whether a file is in a folder or below it, wherever links lead."""
    return path.resolve().is_relative_to(folder.resolve())


def outside_error(given: str) -> FormatError:
    """The error for a file that is named but may not be read."""
    return FormatError(
        f"names the file {given[:200]!r} outside of its folder, which is not read; put it there, "
        "or allow it with --allow-outside (allow_outside=)"
    )
