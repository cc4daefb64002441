"""Addresses of remote files: ``s3://bucket/walk.reel``, ``https://...``."""

import os
import re
from typing import TypeGuard

from meshreel.errors import StoreError

_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+(?:://|::)")
"""Two letters at least: one is a drive of Windows."""


def is_remote(given: object) -> TypeGuard[str]:
    """Whether it is an address such as ``s3://bucket/walk.reel``, and not the path of a file."""
    return isinstance(given, str) and "://" in given and _SCHEME.match(given) is not None


def refuse_address(given: object, what: str) -> None:
    """Refuse an address where a file of this machine is needed.

    Raises
    ------
    StoreError
        Naming what it is.
    """
    if is_remote(given):
        raise StoreError(f"{given}: {what} must be on this machine; copy it, and name the copy")


def is_web(given: str) -> bool:
    """Whether it is the address of a file on a web server."""
    return given.lower().startswith(("http://", "https://"))


def plain(given: str | os.PathLike[str]) -> str:
    """The address without a query or a fragment, so that it ends as its file does."""
    text = os.fspath(given)
    return re.split(r"[?#]", text)[0] if is_web(text) else text


def name_of(address: str) -> str:
    """The name of the file, such as ``walk.reel``."""
    return plain(address).rstrip("/").rpartition("/")[2]


def folder_of(address: str) -> str:
    """The address of the folder that holds the file, without a slash at its end."""
    return plain(address).rstrip("/").rpartition("/")[0]


def scheme_of(address: str) -> str:
    """The scheme in small letters, such as ``s3``."""
    return re.split(r"://|::", address, maxsplit=1)[0].lower()
