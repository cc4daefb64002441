"""Listing remote folders."""

from dataclasses import dataclass
from typing import Any

from meshreel.errors import StoreError
from meshreel.runtime.stores.address import is_web
from meshreel.runtime.stores.filesystem import errors_in_words, filesystem_of

_VERSIONS = ("ETag", "etag", "md5Hash", "LastModified", "last_modified", "mtime", "updated",
             "created")  # fmt: skip
"""Keys of file details that change with the file."""


@dataclass(frozen=True)
class RemoteFile:
    """A file in a store.

    Attributes
    ----------
    name : str
        Path relative to the listed folder, with slashes.
    version : str
        A string that changes with the file; empty if the store provides none.
    """

    name: str
    address: str
    size_bytes: int
    version: str


def files_below(folder: str) -> list[RemoteFile]:
    """All files in a remote folder and its subfolders; none if it does not exist.

    Raises
    ------
    StoreError
        If it cannot be listed.
    """
    refuse_web(folder)
    filesystem, path = filesystem_of(folder)
    with errors_in_words(folder):
        filesystem.invalidate_cache()
        files = filesystem.find(path, detail=True) if filesystem.exists(path) else {}
    prefix = f"{path.rstrip('/')}/"
    return [
        RemoteFile(
            file.removeprefix(prefix),
            address_of(filesystem, file),
            int(details.get("size") or 0),
            next((str(details[key]) for key in _VERSIONS if details.get(key)), ""),
        )
        for file, details in files.items()
        if file.startswith(prefix)
    ]


def files_in(folder: str) -> list[str]:
    """Addresses of the files directly in a remote folder; none if it is a file.

    Raises
    ------
    StoreError
        If it cannot be listed.
    """
    refuse_web(folder)
    filesystem, path = filesystem_of(folder)
    with errors_in_words(folder):
        filesystem.invalidate_cache()
        if not filesystem.isdir(path):
            return []
        entries = filesystem.ls(path, detail=True)
        return [address_of(filesystem, file["name"]) for file in entries if file["type"] == "file"]


def matches(pattern: str) -> list[str]:
    """Addresses of the remote files that match a pattern such as ``s3://bucket/frames/*.obj``."""
    refuse_web(pattern)
    filesystem, path = filesystem_of(pattern)
    with errors_in_words(pattern):
        return [address_of(filesystem, file) for file in filesystem.glob(path)]


def refuse_web(address: str) -> None:
    """Raise `StoreError` for a folder of a web server, which cannot be listed."""
    if is_web(address):
        raise StoreError(f"{address} is on a web server, which lists no folders; name files")


def address_of(filesystem: Any, path: str) -> str:
    """The address of a path in a file system."""
    return str(filesystem.unstrip_protocol(path))
