"""Bytes of the buffers of a glTF file, wherever they are kept."""

import base64
import binascii
import re
from dataclasses import dataclass, field

from meshreel.errors import FormatError
from meshreel.formats.file_errors import os_errors_naming
from meshreel.formats.gltf.document import MESHOPT, Document
from meshreel.formats.gltf.json_object import JsonObject
from meshreel.formats.gltf.named_files import file_beside

DATA_URI = re.compile(r"data:[^,]{0,200};base64,", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Buffers:
    """The buffers of a file, each read when it is first needed.

    Parameters
    ----------
    document : Document
    """

    document: Document
    _read: dict[int, memoryview] = field(default_factory=dict)

    @property
    def size_bytes(self) -> int:
        """Bytes of those that were read."""
        return sum(len(data) for data in self._read.values())

    def view(self, index: int) -> tuple[memoryview, int]:
        """The bytes of a buffer view, and its stride; 0 if it has none.

        Raises
        ------
        FormatError
            If it is not within its buffer, or the buffer cannot be had.
        """
        found = self.document.lists["bufferViews"][index]
        holder = self.document.item(found, "buffer", "buffers")
        number = found.whole("buffer")
        start, length = found.whole("byteOffset", 0), found.whole("byteLength")
        size = holder.whole("byteLength")
        if start + length > size:
            raise FormatError(
                f"{found.place}: bytes {start}..{start + length} are not within {holder.place}, "
                f"which has {size}"
            )
        if number not in self._read:
            self._read[number] = self._bytes(holder, number, size)
        return self._read[number][start : start + length], found.whole("byteStride", 0)

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
            f"{holder.place}: holds data only as {packed}, which is not read; "
            "decompress it (gltf-transform cp)"
        )
    return FormatError(f"{holder.place}: has no 'uri', and there is no binary chunk for it")
