"""What there is in a store."""

from dataclasses import dataclass
from typing import Any

from meshreel.errors import StoreError
from meshreel.runtime.stores.address import is_web
from meshreel.runtime.stores.filesystem import errors_in_words, filesystem_of

_VERSIONS = ("ETag", "etag", "md5Hash", "LastModified", "last_modified", "mtime", "updated",
             "created")  # fmt: skip
"""What stores tell of a file that changes with it."""


@dataclass(frozen=True)
class RemoteFile:
    """A file in a store.

    Attributes
    ----------
    name : str
        Its path within the folder that was listed, with slashes.
    version : str
        Something that is another when the file has changed, as far as the store tells.
    """

    name: str
    address: str
    size_bytes: int
    version: str


def files_below(folder: str) -> list[RemoteFile]:
    """The files in a remote folder and in all below it; none if it is not there.

    Raises
    ------
    StoreError
        If it cannot be listed.
    """
    refuse_web(folder)
    filesystem, path = filesystem_of(folder)
    with errors_in_words(folder):
        filesystem.invalidate_cache()
        found = filesystem.find(path, detail=True) if filesystem.exists(path) else {}
    top = f"{path.rstrip('/')}/"
    return [
        RemoteFile(name[len(top) :], address_of(filesystem, name), _size(facts), _version(facts))
        for name, facts in found.items()
        if name.startswith(top)
    ]


def files_in(folder: str) -> list[str]:
    """Addresses of the files in a remote folder, but not of those below; none if it is a file.

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
        found = filesystem.ls(path, detail=True)
        return [address_of(filesystem, one["name"]) for one in found if one["type"] == "file"]


def matches(pattern: str) -> list[str]:
    """Addresses of the remote files that a pattern such as ``s3://bucket/frames/*.obj`` means."""
    refuse_web(pattern)
    filesystem, path = filesystem_of(pattern)
    with errors_in_words(pattern):
        return [address_of(filesystem, one) for one in filesystem.glob(path)]


def refuse_web(address: str) -> None:
    """Refuse to list a folder of a web server.

    Raises
    ------
    StoreError
        If it is one.
    """
    if is_web(address):
        raise StoreError(f"{address} is on a web server, which lists no folders; name files")


def address_of(filesystem: Any, path: str) -> str:
    """The address of a path in a file system."""
    return str(filesystem.unstrip_protocol(path))


def _size(facts: dict[str, Any]) -> int:
    return int(facts.get("size") or 0)


def _version(facts: dict[str, Any]) -> str:
    return next((str(facts[one]) for one in _VERSIONS if facts.get(one)), "")
