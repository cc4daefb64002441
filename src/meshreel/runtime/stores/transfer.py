"""Downloads of whole files."""

from pathlib import Path

from meshreel.runtime.stores.address import folder_of
from meshreel.runtime.stores.filesystem import errors_in_words, filesystem_of


def read_whole(address: str) -> bytes:
    """Return the bytes of a remote file.

    Raises
    ------
    StoreError
        If it does not exist, cannot be reached, or the answer is cut short.
    """
    filesystem, path = filesystem_of(address)
    with errors_in_words(address):
        return bytes(filesystem.cat_file(path))


def download(address: str, file: Path) -> None:
    """Copy a remote file to a local path; raises as `read_whole`."""
    filesystem, path = filesystem_of(address)
    with errors_in_words(address):
        filesystem.get_file(path, str(file))


def exists(address: str) -> bool:
    """Whether a file or folder exists; raises `StoreError` if the store fails."""
    filesystem, path = filesystem_of(address)
    with errors_in_words(address):
        filesystem.invalidate_cache()
        return bool(filesystem.exists(path))


def sibling(address: str, name: str) -> str:
    """The address of a file in the same folder, or in a subfolder, by its relative path."""
    return f"{folder_of(address)}/{name}"
