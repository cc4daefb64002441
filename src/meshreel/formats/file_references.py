"""Resolution of references from one file to another, restricted to its folder by default."""

from pathlib import Path

from meshreel.errors import FormatError, Keyword
from meshreel.formats.file_errors import check_input_file
from meshreel.formats.options import Reading
from meshreel.runtime.stores.transfer import download, exists, sibling

DOWNLOADS: dict[Path, tuple[str, float]] = {}
"""The downloaded file in each temporary folder that exists: its address, and the limit in bytes of
files without an announced size.
"""


MAX_REFERENCE = 4096
"""Maximum number of characters of a path, as in Linux."""


def resolve_reference(source: Path, reference: str, reading: Reading) -> Path:
    """Return the path of a file that `source` refers to, relative to its folder.

    Parameters
    ----------
    reading : Reading
        Whether the file may be outside the folder of `source`; receives the path.

    Raises
    ------
    FormatError
        If the file is outside without permission, does not exist, is empty or a Git LFS pointer.
    """
    folder = source.resolve().parent
    if len(reference) > MAX_REFERENCE:  # before it is resolved, a system call per component
        raise FormatError(
            f"refers to {reference[:80]!r}..., which has {len(reference)} characters; a path has "
            f"at most {MAX_REFERENCE}"
        )
    try:
        path = (folder / reference.strip()).resolve()
        is_file = path.is_file()
    except (OSError, ValueError) as error:
        raise FormatError(f"refers to {reference[:80]!r}, which is not a path ({error})") from error
    if not (reading.allow_outside or is_within(path, folder)):
        raise outside_error(reference)
    if not is_file and not download_sibling(path):
        raise FormatError(f"refers to the file {reference!r}, which does not exist")
    check_input_file(path)
    reading.referenced.add(path)
    return path


def is_within(path: Path, folder: Path) -> bool:
    """Whether a file is in a folder or below it, after resolving links."""
    return path.resolve().is_relative_to(folder.resolve())


def outside_error(reference: str) -> FormatError:
    """Error for a reference to a file outside the folder."""
    return FormatError(
        f"refers to the file {reference[:200]!r} outside its folder; move it into the folder, or "
        "allow it with ",
        Keyword("allow_outside"),
    )


def download_sibling(path: Path) -> bool:
    """Download a file next to a downloaded one that refers to it; return whether it now exists."""
    for folder, (address, limit_bytes) in DOWNLOADS.items():
        if path.is_relative_to(folder):
            sibling_address = sibling(address, path.relative_to(folder).as_posix())
            if not exists(sibling_address):
                return False
            path.parent.mkdir(parents=True, exist_ok=True)
            download(sibling_address, path, limit_bytes)
            return True
    return False
