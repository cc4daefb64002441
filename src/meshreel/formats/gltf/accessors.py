"""Arrays of a glTF file: buffers, buffer views and accessors, with all sizes checked."""

import base64
import binascii
import re
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.file_errors import os_errors_naming
from meshreel.formats.file_references import is_within, outside_error
from meshreel.formats.gltf.document import MESHOPT, Document, JsonObject
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


COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


@dataclass(frozen=True, eq=False)
class Values:
    """The values of an accessor.

    Attributes
    ----------
    array : array of shape (N, C)
        In the component type of the file.
    is_normalized : bool
        Whether integers represent -1 to 1, or 0 to 1 if unsigned.
    """

    array: npt.NDArray[Any]
    is_normalized: bool = False

    def floats(self) -> npt.NDArray[Any]:
        """Return the represented numbers, as float32 if that is exact, otherwise float64."""
        array = self.array
        if array.dtype.kind == "f":
            return array
        if not self.is_normalized:
            return array.astype(np.float32 if array.itemsize <= 2 else np.float64)
        scaled = array / np.float64(np.iinfo(array.dtype).max)
        clamped: npt.NDArray[Any] = np.maximum(scaled, -1.0)
        return clamped


class Accessors:
    """The accessors of a file, decoded on each read."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.buffers: Buffers = Buffers(document)
        self._reserved = 0

    def count(self, parent: JsonObject, key: str) -> int:
        """Return the declared number of elements of an accessor that an object refers to."""
        return self.document.item(parent, key, "accessors").integer("count")

    def read(self, parent: JsonObject, key: str, *kinds: str, count: int | None = None) -> Values:
        """Return the values of an accessor that an object refers to.

        Parameters
        ----------
        parent : JsonObject
        key : str
            Key of the accessor index.
        *kinds : str
            Allowed accessor types, such as "SCALAR" and "VEC3".
        count : int, optional
            Required number of elements; by default any positive number.

        Raises
        ------
        FormatError
            If the accessor has another type or size, or exceeds its buffer view.
        """
        accessor = self.document.item(parent, key, "accessors")
        dtype, width = declared_type(accessor, kinds)
        n_elements = accessor.integer("count")
        if n_elements == 0 or n_elements != (count or n_elements):
            raise accessor.error("count", f"{count or 'at least 1'}, as {parent.place} requires")
        array = self._dense(accessor, dtype, n_elements, width)
        if (sparse := accessor.child("sparse")) is not None:
            self._overwrite(array, sparse)
        return Values(array, accessor.flag("normalized"))

    def _dense(
        self, accessor: JsonObject, dtype: np.dtype[Any], count: int, width: int
    ) -> npt.NDArray[Any]:
        """Return a copy of the values without sparse substitution."""
        is_stored = self.document.index(accessor, "bufferView", "bufferViews") is not None
        stored = self._elements(accessor, dtype, count, width) if is_stored else None
        self.reserve(count * width * dtype.itemsize, accessor.place)
        return np.zeros((count, width), dtype) if stored is None else stored.copy()

    def reserve(self, size_bytes: int, place: str) -> None:
        """Count bytes before they are allocated, and reject far more than the file has."""
        self._reserved += size_bytes
        available = self.document.size_bytes + self.buffers.size_bytes
        if self._reserved > max(MIN_EXPANDED_BYTES, MAX_EXPANSION * available):
            raise FormatError(
                f"{place}: the arrays of the file would need more than {MAX_EXPANSION} times its "
                f"size, and more than {MIN_EXPANDED_BYTES >> 30} GiB"
            )

    def _elements(
        self, accessor: JsonObject, dtype: np.dtype[Any], count: int, width: int
    ) -> npt.NDArray[Any]:
        """Return a view of the elements of an accessor, or of a part of a sparse one."""
        self.document.item(accessor, "bufferView", "bufferViews")
        data, stride = self.buffers.view(accessor.integer("bufferView"))
        size = width * dtype.itemsize
        start, spacing = accessor.integer("byteOffset", 0), stride or size
        if spacing < size:
            raise FormatError(
                f"{accessor.place}: elements of {size} bytes have a stride of {spacing} bytes"
            )
        if count and start + (count - 1) * spacing + size > len(data):
            raise FormatError(
                f"{accessor.place}: {count} elements of {size} bytes with stride {spacing}, from "
                f"byte {start} on, exceed the {len(data)} bytes of their buffer view"
            )
        return np.ndarray((count, width), dtype, data, start, (spacing, dtype.itemsize))

    def _overwrite(self, array: npt.NDArray[Any], sparse: JsonObject) -> None:
        count = sparse.integer("count")
        indices, values = sparse.required_child("indices"), sparse.required_child("values")
        rows = self._elements(indices, component_type(indices, "u"), count, 1)[:, 0]
        if count and int(rows.max()) >= len(array):
            raise FormatError(
                f"{indices.place}: refers to element {int(rows.max())}; there are {len(array)}"
            )
        array[rows] = self._elements(values, array.dtype, count, array.shape[1])


def component_type(accessor: JsonObject, kinds: str = "iuf") -> np.dtype[Any]:
    """Return the component type of an object, which must be one of these NumPy kinds."""
    code = COMPONENTS.get(accessor.integer("componentType"))
    if code is None or np.dtype(code).kind not in kinds:
        allowed = [str(one) for one, name in COMPONENTS.items() if np.dtype(name).kind in kinds]
        raise accessor.error("componentType", f"one of {', '.join(allowed)}")
    return np.dtype(code)


def declared_type(accessor: JsonObject, kinds: tuple[str, ...]) -> tuple[np.dtype[Any], int]:
    """Return component type and components per element of an accessor of one of these types."""
    kind = accessor.text("type")
    if kind not in kinds:
        raise accessor.error("type", f"{' or '.join(kinds)}")
    return component_type(accessor), WIDTHS[kind]
