"""Bounded reads: of whole remote files, and of the answers of web servers."""

import asyncio
import io
import shutil
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from meshreel.errors import Keyword, StoreError
from meshreel.runtime.counting import size_text
from meshreel.runtime.stores.address import folder_of, is_web
from meshreel.runtime.stores.filesystem import errors_in_words, filesystem_of

PART_BYTES = 1 << 20
"""Largest size of a single read."""

MIN_BYTES, PATIENCE_S = 1 << 12, 60.0
"""An answer fails if fewer bytes arrive in this time."""


def read_whole(address: str, limit_bytes: float) -> bytes:
    """Return the bytes of a remote file, at most `limit_bytes`.

    Raises
    ------
    StoreError
        If it does not exist, cannot be reached, or is larger than announced or allowed; or if the
        answer is encoded, cut short or slow.
    """
    data, remedy = io.BytesIO(), ("if you trust it, allow more with ", Keyword("memory"))
    _transfer(address, data.write, limit_bytes, limit_bytes, remedy)
    return data.getvalue()


def download(address: str, file: Path, limit_bytes: float) -> None:
    """Copy a remote file to a local path, at most `limit_bytes` if its size is not announced.

    Raises
    ------
    StoreError
        As `read_whole`, or if the file is larger than the free space.
    """
    free_bytes = shutil.disk_usage(file.parent).free
    with errors_in_words(address), file.open("wb") as local:
        remedy = ("download it to another folder, and open the copy",)
        _transfer(address, local.write, limit_bytes, free_bytes, remedy)


def _transfer(
    address: str,
    write: Callable[[bytes], Any],
    limit_bytes: float,
    room_bytes: float,
    remedy: tuple[str | Keyword, ...],
) -> None:
    """Pass all bytes of a file to `write`.

    An announced size may be `room_bytes`; a file without one may have `limit_bytes`.
    """
    filesystem, path = filesystem_of(address)

    def max_bytes(size_bytes: int | None) -> int:
        if size_bytes is not None and size_bytes > room_bytes:
            text = f"{address} has {size_text(size_bytes)}; there is room for "
            raise StoreError(f"{text}{size_text(room_bytes)}; ", *remedy)
        return int(limit_bytes) if size_bytes is None else size_bytes

    def check_received(n_bytes: int, size_bytes: int | None) -> None:
        if n_bytes > max_bytes(size_bytes):
            limit = "limit without an announced" if size_bytes is None else "announced"
            text = f"the server of {address} sent more than {size_text(n_bytes - 1)}"
            raise StoreError(f"{text}, the {limit} size; ", *remedy)
        if n_bytes < (size_bytes or 0):
            raise StoreError(
                f"the answer for {address} was cut short: {n_bytes} of {size_bytes} bytes; "
                "try again"
            )

    async def transfer_web() -> None:
        async with web_answer(filesystem, path, address) as answer:
            size_bytes = answer.content_length
            n_bytes = await receive(answer, max_bytes(size_bytes) + 1, write, address)
            check_received(n_bytes, size_bytes)

    with errors_in_words(address):
        if is_web(address):
            from fsspec.asyn import sync

            sync(filesystem.loop, transfer_web)
            return
        with filesystem.open(path, "rb") as file:
            size_bytes, n_bytes = getattr(file, "size", None), 0
            n_left = max_bytes(size_bytes) + 1
            while part := file.read(min(PART_BYTES, n_left - n_bytes)):
                write(part)
                n_bytes += len(part)
            check_received(n_bytes, size_bytes)


@asynccontextmanager
async def web_answer(filesystem: Any, url: str, address: str, **headers: str) -> AsyncIterator[Any]:
    """Request a file from a web server; yield the answer, whose body is not encoded.

    Raises
    ------
    StoreError
        If the server encodes it anyway, or does not answer in time.
    """
    from aiohttp import ClientTimeout

    session = await filesystem.set_session()
    options = {"timeout": ClientTimeout(), **filesystem.kwargs}  # large files may take any time
    options["headers"] = {**options.get("headers", {}), **headers, "Accept-Encoding": "identity"}
    async with _in_time(address):
        answer = await session.get(filesystem.encode_url(url), **options)
    async with answer:
        answer.raise_for_status()
        encoding = answer.headers.get("Content-Encoding") or "identity"
        if encoding.lower() != "identity":
            raise StoreError(
                f"the server of {address} answers with {encoding[:20]}-encoded bytes, though asked "
                "for none; download and decompress it"
            )
        yield answer


async def receive(answer: Any, max_bytes: int, write: Callable[[bytes], Any], address: str) -> int:
    """Pass the body of an answer to `write`, but not more than `max_bytes`; return its size.

    Raises
    ------
    StoreError
        If fewer than `MIN_BYTES` arrive in `PATIENCE_S` seconds.
    """
    n_bytes = 0
    while n_bytes < max_bytes:
        target = min(n_bytes + MIN_BYTES, max_bytes)
        async with _in_time(address):
            while n_bytes < target:
                part = await answer.content.read(min(PART_BYTES, max_bytes - n_bytes))
                if not part:
                    return n_bytes
                write(part)
                n_bytes += len(part)
    return n_bytes


@asynccontextmanager
async def _in_time(address: str) -> AsyncIterator[None]:
    try:
        async with asyncio.timeout(PATIENCE_S):
            yield
    except TimeoutError:
        raise StoreError(
            f"the server of {address} sent fewer than {MIN_BYTES} bytes in {PATIENCE_S:g} s; "
            "try again later"
        ) from None


def exists(address: str) -> bool:
    """Whether a file or folder exists; raises `StoreError` if the store fails."""
    filesystem, path = filesystem_of(address)
    with errors_in_words(address):
        filesystem.invalidate_cache()
        return bool(filesystem.exists(path))


def sibling(address: str, name: str) -> str:
    """The address of a file in the same folder, or in a subfolder, by its relative path."""
    return f"{folder_of(address)}/{name}"
