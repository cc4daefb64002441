"""Downloads and uploads of whole files."""

import uuid
from collections.abc import Iterable
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


def check_outputs(addresses: Iterable[str], *, overwrite: bool) -> None:
    """Refuse remote files that cannot or must not be written, before any work is done.

    Raises
    ------
    InvalidInputError
        If a file exists and `overwrite` is false.
    StoreError
        If the location is not writable, or the store fails.
    """
    for address in addresses:
        if is_web(address):
            raise StoreError(
                f"{address} is on a web server, which takes no files; write to s3://, gs:// or a "
                "local file"
            )
        root = "/".join(without_query(address).split("/")[:3])
        if scheme_of(address) in ("s3", "s3a", "gs", "gcs") and not exists(root):
            raise StoreError(f"there is no bucket {root}; create it first")
        if not overwrite:
            _refuse_existing(address)


def _refuse_existing(address: str) -> None:
    if exists(address):
        raise InvalidInputError(
            f"{address} already exists; use ", Keyword("overwrite", True), " to replace it"
        )


def upload(file: Path, address: str, *, overwrite: bool) -> None:
    """Copy a local file to an address in a folder that `check_outputs` has accepted.

    Raises
    ------
    InvalidInputError
        If the address exists and `overwrite` is false.
    StoreError
        If the store fails.
    """
    if not overwrite:
        _refuse_existing(address)
    _upload(file, address)


def upload_all(files: dict[Path, str], *, overwrite: bool) -> None:
    """Copy local files to their addresses; if one fails, remove the new files before it.

    Each file appears only when complete: if the store itself does not ensure that, it is uploaded
    under a hidden name and then renamed.

    Raises
    ------
    InvalidInputError, StoreError
        As `check_outputs`, which is called again.
    """
    check_outputs(files.values(), overwrite=overwrite)
    new = [address for address in files.values() if not (overwrite and exists(address))]
    uploaded: list[str] = []
    try:
        for file, address in files.items():
            _upload(file, address)
            uploaded.append(address)
    except BaseException:
        for address in uploaded:
            if address in new:
                with suppress(Exception):
                    filesystem, path = filesystem_of(address)
                    filesystem.rm_file(path)
        raise


def _upload(file: Path, address: str) -> None:
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
