"""Files that other files name: only those in the same folder or below."""

from pathlib import Path

from meshreel.errors import FormatError


def path_beside(named_in: Path, given: str) -> Path:
    """The path of a file that another names, relative to the folder of that.

    Raises
    ------
    FormatError
        If it is outside of that folder, or not there.
    """
    folder = named_in.resolve().parent
    try:
        found = (folder / given.strip()).resolve()
        is_file = found.is_file()
    except (OSError, ValueError) as error:
        raise FormatError(f"names the file {given[:80]!r}, which is no path ({error})") from error
    if not found.is_relative_to(folder):
        raise FormatError(f"names the file {given!r} outside of its folder, which is not read")
    if not is_file:
        raise FormatError(f"names the file {given!r}, which is not there")
    return found
