"""Bytes of the buffers of a glTF file, wherever they are kept."""

import base64
import binascii
import re
from dataclasses import dataclass, field

from meshreel.errors import FormatError
from meshreel.formats.file_errors import os_errors_naming
from meshreel.formats.gltf.document import MESHOPT, Document
from meshreel.formats.gltf.json_object import JsonObject
from meshreel.formats.gltf.meshopt import decode_view
from meshreel.formats.gltf.named_files import file_beside

LEAST_DECODED_BYTES = 1 << 30
EXPANSION = 32
"""Arrays may take this many times the bytes of the file, or `LEAST_DECODED_BYTES`: arrays that
share bytes, have none, or are compressed must not make a small file fill the memory."""

DATA_URI = re.compile(r"data:[^,]{0,200};base64,", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Buffers:
    """The buffers of a file, each read when it is first needed."""

    document: Document
    _read: dict[int, memoryview] = field(default_factory=dict)
    _decoded: dict[int, memoryview] = field(default_factory=dict)

    @property
    def size_bytes(self) -> int:
        """Bytes of those that were read."""
        return sum(len(data) for data in self._read.values())

    def view(self, index: int) -> tuple[memoryview, int]:
        """The bytes of a buffer view, decompressed, and its stride; 0 if it has none.

        Raises
        ------
        FormatError
            If it is not within its buffer, the buffer cannot be had, or the bytes cannot be
            decompressed.
        """
        found = self.document.lists["bufferViews"][index]
        stride = found.whole("byteStride", 0)
        packed = next(filter(None, map(found.extension, MESHOPT)), None)
        if packed is None:
            return self._stored(found), stride
        if index not in self._decoded:
            self._decoded[index] = self._decompressed(found, packed)
        return self._decoded[index], stride

    def _decompressed(self, found: JsonObject, packed: JsonObject) -> memoryview:
        size = found.whole("byteLength")
        if packed.whole("count") * packed.whole("byteStride") != size:
            raise FormatError(
                f"{packed.place}: its 'count' times its 'byteStride' must be the {size} bytes of "
                f"{found.place}"
            )
        data = bytes(self._stored(packed))
        total = size + sum(map(len, self._decoded.values()))
        available = self.document.size_bytes + self.size_bytes
        if total > max(LEAST_DECODED_BYTES, EXPANSION * available):
            raise FormatError(
                f"{packed.place}: what is compressed in the file would take more than {EXPANSION} "
                f"times its size, and more than {LEAST_DECODED_BYTES >> 30} GiB"
            )
        return memoryview(decode_view(data, packed).tobytes())

    def _stored(self, holder: JsonObject) -> memoryview:
        """The bytes of a buffer that a buffer view or its compression names."""
        buffer = self.document.item(holder, "buffer", "buffers")
        number = holder.whole("buffer")
        start, length = holder.whole("byteOffset", 0), holder.whole("byteLength")
        size = buffer.whole("byteLength")
        if start + length > size:
            raise FormatError(
                f"{holder.place}: bytes {start}..{start + length} are not within {buffer.place}, "
                f"which has {size}"
            )
        if number not in self._read:
            self._read[number] = self._bytes(buffer, number, size)
        return self._read[number][start : start + length]

    def _bytes(self, holder: JsonObject, number: int, size: int) -> memoryview:
        if "uri" in holder:
            data = self._from_uri(holder, size)
        elif number == 0 and self.document.binary is not None:
            data = self.document.binary
        else:
            raise _missing(holder)
        if len(data) < size:
            raise FormatError(f"{holder.place}: has {len(data)} bytes of the {size} announced")
        return data[:size]

    def _from_uri(self, holder: JsonObject, size: int) -> memoryview:
        uri = holder.text("uri")
        if match := DATA_URI.match(uri):
            try:
                return memoryview(base64.b64decode(uri[match.end() :]))
            except (binascii.Error, ValueError) as error:
                raise FormatError(f"{holder.place}: its data is no base64 ({error})") from None
        path = file_beside(self.document, uri, holder.place)
        with os_errors_naming(path):
            if path.stat().st_size < size:
                raise FormatError(
                    f"{holder.place}: {path.name} has {path.stat().st_size} bytes; "
                    f"{size} are announced"
                )
            with path.open("rb") as file:
                return memoryview(file.read(size))


def _missing(holder: JsonObject) -> FormatError:
    packed = next((name for name in MESHOPT if holder.extension(name) is not None), None)
    if packed is not None:
        return FormatError(
            f"{holder.place}: is the fallback of {packed} and has no data; buffer views that name "
            "it must have that extension too"
        )
    return FormatError(f"{holder.place}: has no 'uri', and there is no binary chunk for it")
