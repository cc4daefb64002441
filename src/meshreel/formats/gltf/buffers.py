"""Bytes of the buffers of a glTF file: in the file, in data URIs, or in files that it names."""

import base64
import binascii
import re
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from urllib.parse import unquote

from meshreel.errors import FormatError
from meshreel.formats.file_errors import os_errors_naming
from meshreel.formats.file_references import is_within, outside_error
from meshreel.formats.gltf.document import MESHOPT, Document
from meshreel.formats.gltf.json_object import JsonObject
from meshreel.formats.gltf.meshopt import decode_view

MIN_EXPANDED_BYTES = 1 << 30
MAX_EXPANSION = 32
"""Arrays may need this many times the bytes of the file, or `MIN_EXPANDED_BYTES` if that is more:
a small file must not fill the memory with arrays that share bytes, have none, or are compressed."""

DATA_URI = re.compile(r"data:[^,]{0,200};base64,", re.IGNORECASE)

SCHEME = re.compile(r"[a-z][a-z0-9+.-]*:", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Buffers:
    """The buffers of a file, read on demand."""

    document: Document
    _read: dict[int, memoryview] = field(default_factory=dict)
    _decoded: dict[int, memoryview] = field(default_factory=dict)

    @property
    def size_bytes(self) -> int:
        """Total size of the buffers read so far."""
        return sum(len(data) for data in self._read.values())

    def view(self, index: int) -> tuple[memoryview, int]:
        """Return the decompressed bytes of a buffer view, and its stride, or 0 without one.

        Raises
        ------
        FormatError
            If the view exceeds its buffer, the buffer cannot be read, or the data cannot be
            decompressed.
        """
        view = self.document.lists["bufferViews"][index]
        stride = view.integer("byteStride", 0)
        compressed = next(filter(None, map(view.extension, MESHOPT)), None)
        if compressed is None:
            return self._stored(view), stride
        if index not in self._decoded:
            self._decoded[index] = self._decompressed(view, compressed)
        return self._decoded[index], stride

    def _decompressed(self, view: JsonObject, compressed: JsonObject) -> memoryview:
        size = view.integer("byteLength")
        if compressed.integer("count") * compressed.integer("byteStride") != size:
            raise FormatError(
                f"{compressed.place}: its 'count' times its 'byteStride' must be the {size} bytes "
                f"of {view.place}"
            )
        data = bytes(self._stored(compressed))
        total = size + sum(map(len, self._decoded.values()))
        available = self.document.size_bytes + self.size_bytes
        if total > max(MIN_EXPANDED_BYTES, MAX_EXPANSION * available):
            raise FormatError(
                f"{compressed.place}: compressed data of the file would need more than "
                f"{MAX_EXPANSION} times its size, and more than {MIN_EXPANDED_BYTES >> 30} GiB"
            )
        return memoryview(decode_view(data, compressed).tobytes())

    def _stored(self, parent: JsonObject) -> memoryview:
        """Return the bytes in a buffer to which a view or its compression extension refers."""
        buffer = self.document.item(parent, "buffer", "buffers")
        number = parent.integer("buffer")
        start, length = parent.integer("byteOffset", 0), parent.integer("byteLength")
        size = buffer.integer("byteLength")
        if start + length > size:
            raise FormatError(
                f"{parent.place}: bytes {start}..{start + length} exceed {buffer.place}, "
                f"which has {size} bytes"
            )
        if number not in self._read:
            self._read[number] = self._bytes(buffer, number, size)
        return self._read[number][start : start + length]

    def _bytes(self, buffer: JsonObject, number: int, size: int) -> memoryview:
        if "uri" in buffer:
            data = self._from_uri(buffer, size)
        elif number == 0 and self.document.binary is not None:
            data = self.document.binary
        else:
            raise _missing(buffer)
        if len(data) < size:
            raise FormatError(f"{buffer.place}: has {len(data)} of the declared {size} bytes")
        return data[:size]

    def _from_uri(self, buffer: JsonObject, size: int) -> memoryview:
        uri = buffer.text("uri")
        if match := DATA_URI.match(uri):
            try:
                return memoryview(base64.b64decode(uri[match.end() :]))
            except (binascii.Error, ValueError) as error:
                raise FormatError(
                    f"{buffer.place}: its data are not valid base64 ({error})"
                ) from None
        path = referenced_file(self.document, uri, buffer.place)
        with os_errors_naming(path):
            if path.stat().st_size < size:
                raise FormatError(
                    f"{buffer.place}: {path.name} has {path.stat().st_size} of the declared "
                    f"{size} bytes"
                )
            with path.open("rb") as file:
                return memoryview(file.read(size))


def _missing(buffer: JsonObject) -> FormatError:
    extension = next((name for name in MESHOPT if buffer.extension(name) is not None), None)
    if extension is not None:
        return FormatError(
            f"{buffer.place}: is the fallback of {extension} without data; its buffer views must "
            "have that extension too"
        )
    return FormatError(f"{buffer.place}: has neither 'uri' nor a binary chunk")


def referenced_file(document: Document, uri: str, place: str) -> Path:
    """Return the path of a file to which a document refers, after checking its location.

    Raises
    ------
    FormatError
        If it is missing, or outside of the folder without permission.
    """
    name = unquote(uri)
    parts = PurePosixPath(name).parts
    is_remote = SCHEME.match(name) or name.startswith("//")
    if is_remote or "\\" in name or "\0" in name or not parts:
        raise FormatError(
            f"{place}: refers to {uri[:200]!r}; only files in the folder of the glTF file or below "
            "are supported; move the file there"
        )
    path = document.folder.joinpath(*parts)
    with os_errors_naming(path):
        is_inside = ".." not in parts and is_within(path, document.folder)
        exists = path.is_file()
    if not (is_inside or document.allow_outside):
        raise FormatError(f"{place}: {outside_error(name)}")
    if not exists:
        raise FormatError(f"{place}: there is no file {name!r} next to the glTF file")
    return path
