"""Addresses of remote files: ``s3://bucket/walk.reel``, ``https://...``."""

import os
import re
from typing import TypeGuard

from meshreel.errors import StoreError

_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+(?:://|::)")
"""A scheme and its separator; at least two letters, because one is a drive of Windows."""

STANDARD_INPUT = "-"
"""On the command line, a .reel that another program writes to standard input."""


def is_remote(source: object) -> TypeGuard[str]:
    """Whether it is an address such as ``s3://bucket/walk.reel``, not a local path."""
    return isinstance(source, str) and "://" in source and _SCHEME.match(source) is not None


def refuse_address(source: object, noun: str) -> None:
    """Refuse an address if a local file is needed.

    Raises
    ------
    StoreError
        If it is an address; `noun` names the file, such as "the output".
    """
    if is_remote(source):
        raise StoreError(f"{source}: {noun} must be on this machine; copy it, and name the copy")


def is_web(address: str) -> bool:
    """Whether it is the address of a file on a web server."""
    return address.lower().startswith(("http://", "https://"))


def without_query(address: str | os.PathLike[str]) -> str:
    """The address without query and fragment, so that it ends with the file extension."""
    text = os.fspath(address)
    return re.split(r"[?#]", text)[0] if is_web(text) else text


def name_of(address: str) -> str:
    """The name of the file, such as ``walk.reel``."""
    return without_query(address).rstrip("/").rpartition("/")[2]


def folder_of(address: str) -> str:
    """The address of the parent folder, without a trailing slash."""
    return without_query(address).rstrip("/").rpartition("/")[0]


def scheme_of(address: str) -> str:
    """The scheme in lower case, such as ``s3``."""
    return re.split(r"://|::", address, maxsplit=1)[0].lower()
