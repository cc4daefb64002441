"""The store behind an address, and its errors in words."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from meshreel.errors import MeshReelError, StoreError
from meshreel.runtime.stores.address import scheme_of

_EXTRA = "pip install 'meshreel[remote]'"

_OF_EXTRA = frozenset({"s3", "s3a", "gs", "gcs", "http", "https"})
"""Schemes whose libraries the extra brings."""

_CREDENTIALS = {
    "s3": "set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or AWS_PROFILE; of a public bucket, "
    "FSSPEC_S3_ANON=true",
    "gs": "set GOOGLE_APPLICATION_CREDENTIALS; of a public bucket, FSSPEC_GS_TOKEN=anon",
}
"""What to do where a store wants to know who asks."""

_REFUSED, _NOT_THERE = (401, 403), 404


def filesystem_of(address: str) -> tuple[Any, str]:
    """The fsspec file system of an address, and the path in it.

    Settings such as endpoints are those of fsspec, from its files or from variables such as
    ``FSSPEC_S3_ENDPOINT_URL``.

    Raises
    ------
    StoreError
        If fsspec or the library of the scheme is not installed, or there is no such scheme.
    """
    try:
        from fsspec.core import url_to_fs
    except ImportError:
        raise StoreError(f"{address} needs fsspec, which is not installed: {_EXTRA}") from None
    try:
        filesystem, path = url_to_fs(address)
    except ImportError as error:
        advice = f"; {_EXTRA}" if scheme_of(address) in _OF_EXTRA else ""
        raise StoreError(f"{address} cannot be reached: {error}{advice}") from None
    except ValueError as error:
        raise StoreError(f"{address} cannot be reached: {error}") from None
    except Exception as error:  # whatever a library has to say of its settings
        raise StoreError(_words(address, error)) from None
    return filesystem, path


@contextmanager
def errors_in_words(address: str) -> Iterator[None]:
    """Within it, whatever a store's library raises is a `StoreError` that names the address."""
    try:
        yield
    except MeshReelError:
        raise
    except Exception as error:
        raise StoreError(_words(address, error)) from error


def _words(address: str, error: Exception) -> str:
    """The error in a sentence; libraries of stores have many classes, told apart by their names."""
    if isinstance(error, FileNotFoundError) and isinstance(error.__cause__, Exception):
        error = error.__cause__  # fsspec says of every answer of a web server that there is none
    name, status = type(error).__name__, getattr(error, "status", None)
    is_missing = isinstance(error, FileNotFoundError) or name in ("NoSuchBucket", "NoSuchKey")
    if is_missing or status == _NOT_THERE:
        return f"there is no {address}; check it"
    is_refused = isinstance(error, PermissionError) or status in _REFUSED
    if "Credentials" in name or is_refused:
        scheme = scheme_of(address)
        family = {"s3a": "s3", "gcs": "gs"}.get(scheme, scheme)
        advice = _CREDENTIALS.get(family, "it may want a name and a password, or a token")
        return f"{address} is refused without (other) credentials ({_said(error)}); {advice}"
    if "Payload" in name or "IncompleteRead" in name:
        return f"the answer for {address} was cut short ({_said(error)}); try again"
    if isinstance(error, ConnectionError | TimeoutError) or "Connect" in name:
        return f"{address} cannot be reached ({_said(error)})"
    return f"{address} failed: {_said(error)}"


def _said(error: Exception) -> str:
    """The error in one short line."""
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text[:300]}" if text else type(error).__name__
