"""Whole files from and to stores."""

import uuid
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from meshreel.errors import InvalidInputError, StoreError
from meshreel.runtime.stores.address import folder_of, is_web, plain, scheme_of
from meshreel.runtime.stores.filesystem import errors_in_words, filesystem_of

WHOLE_AT_ONCE = frozenset({"s3", "s3a", "gs", "gcs", "abfs", "abfss", "az", "memory"})
"""Schemes of stores whose files appear when they are complete; elsewhere they are renamed."""


def read_whole(address: str) -> bytes:
    """The bytes of a remote file.

    Raises
    ------
    StoreError
        If it is not there, cannot be reached or comes cut short.
    """
    filesystem, path = filesystem_of(address)
    with errors_in_words(address):
        return bytes(filesystem.cat_file(path))


def download(address: str, place: Path) -> None:
    """Copy a remote file to a place on this machine; raises as `read_whole`."""
    filesystem, path = filesystem_of(address)
    with errors_in_words(address):
        filesystem.get_file(path, str(place))


def exists(address: str) -> bool:
    """Whether there is a file or a folder; raises `StoreError` if that cannot be known."""
    filesystem, path = filesystem_of(address)
    with errors_in_words(address):
        filesystem.invalidate_cache()
        return bool(filesystem.exists(path))


def check_outputs(addresses: Iterable[str], *, overwrite: bool) -> None:
    """Refuse remote files that cannot be or must not be written, before any work is done.

    Raises
    ------
    InvalidInputError
        If a file is there already and `overwrite` is false.
    StoreError
        If nothing can be written there, or that cannot be known.
    """
    for address in addresses:
        if is_web(address):
            raise StoreError(
                f"{address} is on a web server, which takes no files; write to s3://, gs:// or a "
                "file of this machine"
            )
        root = "/".join(plain(address).split("/")[:3])
        if scheme_of(address) in ("s3", "s3a", "gs", "gcs") and not exists(root):
            raise StoreError(f"there is no bucket {root}; create it first")
        if not overwrite and exists(address):
            raise InvalidInputError(f"{address} exists and is kept; use --force (overwrite=True)")


def upload_all(files: dict[Path, str], *, overwrite: bool) -> None:
    """Copy files to their addresses; if one fails, those before it that are new go again.

    Each appears whole: in stores that show files when they are complete as it is, elsewhere under
    a hidden name that is changed at the end.

    Raises
    ------
    InvalidInputError, StoreError
        As `check_outputs`, which is asked once more.
    """
    check_outputs(files.values(), overwrite=overwrite)
    fresh = [address for address in files.values() if not (overwrite and exists(address))]
    done: list[str] = []
    try:
        for place, address in files.items():
            _upload(place, address)
            done.append(address)
    except BaseException:
        for address in (one for one in done if one in fresh):
            with suppress(Exception):
                filesystem, path = filesystem_of(address)
                filesystem.rm_file(path)
        raise


def _upload(place: Path, address: str) -> None:
    filesystem, path = filesystem_of(address)
    with errors_in_words(address):
        if scheme_of(address) in WHOLE_AT_ONCE:
            filesystem.put_file(str(place), path)
            return
        folder, _, name = path.rpartition("/")
        filesystem.makedirs(folder, exist_ok=True)
        hidden = f"{folder}/.meshreel-{uuid.uuid4().hex[:12]}-{name}"
        try:
            filesystem.put_file(str(place), hidden)
            filesystem.mv(hidden, path)
        except BaseException:
            with suppress(Exception):
                filesystem.rm_file(hidden)
            raise


def beside(address: str, name: str) -> str:
    """The address of a file in the same folder, or below it."""
    return f"{folder_of(address)}/{name}"
