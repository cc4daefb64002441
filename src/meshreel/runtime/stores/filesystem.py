"""The file system of an address: listing of folders, and readable errors of its library."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from meshreel.errors import MeshReelError, StoreError
from meshreel.runtime.stores.address import is_web, scheme_of

_EXTRAS = {"s3": "s3", "s3a": "s3", "gs": "gcs", "gcs": "gcs", "http": "remote", "https": "remote"}
"""The extra with the library of each scheme."""

_CREDENTIALS = {
    "s3": "set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or AWS_PROFILE; for a public bucket, "
    "FSSPEC_S3_ANON=true",
    "gs": "set GOOGLE_APPLICATION_CREDENTIALS; for a public bucket, FSSPEC_GS_TOKEN=anon",
}
"""How to set the credentials of a store."""

_FORBIDDEN, _NOT_FOUND = (401, 403), 404

_VERSIONS = ("ETag", "etag", "md5Hash", "LastModified", "last_modified", "mtime", "updated",
             "created")  # fmt: skip
"""Keys of file details that change with the file."""


def filesystem_of(address: str) -> tuple[Any, str]:
    """The fsspec file system of an address, and the path in it.

    Settings such as endpoints come from fsspec's configuration files or from variables such as
    ``FSSPEC_S3_ENDPOINT_URL``.

    Raises
    ------
    StoreError
        If fsspec or the library of the scheme is not installed, or the scheme is unknown.
    """
    try:
        from fsspec.core import url_to_fs
    except ImportError:
        extra = _EXTRAS.get(scheme_of(address), "remote")
        needed = f"{address} needs fsspec, which is not installed"
        raise StoreError(f"{needed}: pip install 'meshreel[{extra}]'") from None
    try:
        filesystem, path = url_to_fs(address)
    except ImportError as error:
        known = _EXTRAS.get(scheme_of(address))
        advice = f"; pip install 'meshreel[{known}]'" if known else ""
        raise StoreError(f"{address} cannot be reached: {error}{advice}") from None
    except ValueError as error:
        raise StoreError(f"{address} cannot be reached: {error}") from None
    except Exception as error:  # libraries raise many classes for wrong settings
        raise StoreError(_message(address, error)) from None
    return filesystem, path


@contextmanager
def errors_in_words(address: str) -> Iterator[None]:
    """A context in which any error of a store's library becomes a `StoreError` with the address."""
    try:
        yield
    except MeshReelError:
        raise
    except Exception as error:
        raise StoreError(_message(address, error)) from error


def _message(address: str, error: Exception) -> str:
    """The message of an error, by its class name: each library has its own classes."""
    if isinstance(error, FileNotFoundError) and isinstance(error.__cause__, Exception):
        error = error.__cause__  # fsspec raises FileNotFoundError for every error of a web server
    name, status = type(error).__name__, getattr(error, "status", None)
    is_missing = isinstance(error, FileNotFoundError) or name in ("NoSuchBucket", "NoSuchKey")
    if is_missing or status == _NOT_FOUND:
        return f"there is no {address}; check the address"
    is_forbidden = isinstance(error, PermissionError) or status in _FORBIDDEN
    if "Credentials" in name or is_forbidden:
        scheme = scheme_of(address)
        family = {"s3a": "s3", "gcs": "gs"}.get(scheme, scheme)
        advice = _CREDENTIALS.get(family, "it may need a name and a password, or a token")
        return f"{address} is refused without (other) credentials ({_one_line(error)}); {advice}"
    if "Payload" in name or "IncompleteRead" in name:
        return f"the answer for {address} was cut short ({_one_line(error)}); try again"
    if isinstance(error, ConnectionError | TimeoutError) or "Connect" in name:
        return f"{address} cannot be reached ({_one_line(error)})"
    return f"{address} failed: {_one_line(error)}"


def _one_line(error: Exception) -> str:
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text[:300]}" if text else type(error).__name__


@dataclass(frozen=True)
class RemoteFile:
    """A file in a store."""

    name: str
    """Path relative to the listed folder, with slashes."""
    size_bytes: int
    version: str
    """A string that changes with the file; empty if the store provides none."""


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
