"""Downloads and uploads of whole files."""

import uuid
from contextlib import suppress
from pathlib import Path

from meshreel.errors import InvalidInputError, Keyword, StoreError
from meshreel.runtime.stores.address import folder_of, is_web, scheme_of, without_query
from meshreel.runtime.stores.filesystem import errors_in_words, filesystem_of

ATOMIC_SCHEMES = frozenset({"s3", "s3a", "gs", "gcs", "abfs", "abfss", "az", "memory"})
"""Schemes of stores whose files appear only when complete; elsewhere uploads are renamed."""


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


def check_remote_folder(address: str) -> None:
    """Refuse a remote folder that cannot be written, before any work is done.

    Raises
    ------
    StoreError
        If it is on a web server, its bucket does not exist, or the store fails.
    """
    if is_web(address):
        raise StoreError(
            f"{address} is on a web server, which takes no files; write to s3://, gs:// or a "
            "local folder"
        )
    root = "/".join(without_query(address).split("/")[:3])
    if scheme_of(address) in ("s3", "s3a", "gs", "gcs") and not exists(root):
        raise StoreError(f"there is no bucket {root}; create it first")


def upload(file: Path, address: str, *, overwrite: bool) -> None:
    """Copy a local file to an address in a folder that `check_remote_folder` has accepted.

    The file appears only when complete: if the store itself does not ensure that, it is uploaded
    under a hidden name and then renamed.

    Raises
    ------
    InvalidInputError
        If the address exists and `overwrite` is false.
    StoreError
        If the store fails.
    """
    if not overwrite and exists(address):
        raise InvalidInputError(
            f"{address} already exists; use ", Keyword("overwrite", True), " to replace it"
        )
    filesystem, path = filesystem_of(address)
    with errors_in_words(address):
        if scheme_of(address) in ATOMIC_SCHEMES:
            filesystem.put_file(str(file), path)
            return
        folder, _, name = path.rpartition("/")
        filesystem.makedirs(folder, exist_ok=True)
        hidden = f"{folder}/.meshreel-{uuid.uuid4().hex[:12]}-{name}"
        try:
            filesystem.put_file(str(file), hidden)
            filesystem.mv(hidden, path)
        except BaseException:
            with suppress(Exception):
                filesystem.rm_file(hidden)
            raise


def sibling(address: str, name: str) -> str:
    """The address of a file in the same folder, or in a subfolder, by its relative path."""
    return f"{folder_of(address)}/{name}"
