"""Containers of glTF files: GLB chunks around JSON, and the buffer of a written file."""

import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError, InvalidInputError

Json = dict[str, Any]

COMPONENT_TYPES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
ALIGNMENT = 4
"""Alignment of each vertex attribute and its stride, in bytes."""


@dataclass(frozen=True, eq=False)
class VertexValues:
    """Vertex values in the buffer.

    Attributes
    ----------
    view : int
        Index of the buffer view.
    offset, stride : int
        Byte offset in the view, and bytes per vertex.
    values : array of shape (N, C)
    """

    view: int
    offset: int
    stride: int
    values: npt.NDArray[Any]


class BufferWriter:
    """The buffer of a file, to which arrays are appended.

    Attributes
    ----------
    pieces : list of bytes
        Consecutive pieces of the buffer.
    size_bytes : int
    views, accessors : list of dict
        Entries of the JSON.
    """

    def __init__(self) -> None:
        self.pieces: list[bytes] = []
        self.size_bytes: int = 0
        self.views: list[Json] = []
        self.accessors: list[Json] = []

    def add_vertices(self, arrays: Sequence[npt.NDArray[Any]]) -> list[VertexValues]:
        """Append vertex values, consecutive arrays of the same type and shape (N, C)."""
        n_verts, width = arrays[0].shape
        dtype = arrays[0].dtype
        row = width * dtype.itemsize
        stride = -(-row // ALIGNMENT) * ALIGNMENT
        padded = np.zeros((len(arrays), n_verts, stride), np.uint8)
        for target, array in zip(padded, arrays, strict=True):
            exact = np.ascontiguousarray(array, dtype.newbyteorder("<"))
            target[:, :row] = exact.view(np.uint8).reshape(n_verts, row)
        view = self._add_view(padded.tobytes(), {"byteStride": stride, "target": ARRAY_BUFFER})
        return [
            VertexValues(view, number * n_verts * stride, stride, array)
            for number, array in enumerate(arrays)
        ]

    def vertex_accessor(self, name: str, stored: VertexValues, verts: slice) -> int:
        """Add an accessor of an attribute on a range of vertices, and return its index.

        Integers are normalized, except in application-specific attributes.
        """
        values = stored.values[verts]
        accessor = _accessor(stored.view, values, stored.offset + verts.start * stored.stride)
        if values.dtype.kind in "iu" and not name.startswith("_"):
            accessor["normalized"] = True
        if name == "POSITION":
            accessor |= _bounds(values)
        return self._add_accessor(accessor)

    def add_indices(self, indices: npt.NDArray[np.integer]) -> int:
        """Append triangle corners in the smallest index type, and return their accessor."""
        dtype = np.dtype("<u2" if indices.max() < 0xFFFF else "<u4")  # 0xFFFF is primitive restart
        values = indices.astype(dtype).reshape(-1, 1)
        view = self._add_view(values.tobytes(), {"target": ELEMENT_ARRAY_BUFFER})
        return self._add_accessor(_accessor(view, values, 0))

    def add_samples(self, values: npt.NDArray[np.float32], *, are_times: bool) -> int:
        """Append numbers of an animation, and return their accessor."""
        column = values.astype("<f4").reshape(-1, 1)
        accessor = _accessor(self._add_view(column.tobytes(), {}), column, 0)
        return self._add_accessor(accessor | (_bounds(column) if are_times else {}))

    def add_vectors(self, values: npt.NDArray[np.float32]) -> int:
        """Append vectors of an animation, of shape (N, C), and return their accessor."""
        data = values.astype("<f4")
        return self._add_accessor(_accessor(self._add_view(data.tobytes(), {}), data, 0))

    def add_image(self, data: bytes) -> int:
        """Append the bytes of an image, and return the index of their buffer view."""
        return self._add_view(data, {})

    def _add_view(self, data: bytes, about: Json) -> int:
        view = {"buffer": 0, "byteOffset": self.size_bytes, "byteLength": len(data)}
        self.views.append(view | about)
        self.pieces.append(data + bytes(-len(data) % ALIGNMENT))
        self.size_bytes += len(self.pieces[-1])
        return len(self.views) - 1

    def _add_accessor(self, accessor: Json) -> int:
        self.accessors.append(accessor)
        return len(self.accessors) - 1


def _accessor(view: int, values: npt.NDArray[Any], offset: int) -> Json:
    accessor = {
        "bufferView": view,
        "componentType": COMPONENT_TYPES[values.dtype.str[1:]],
        "count": len(values),
        "type": TYPES[values.shape[1]],
    }
    return accessor | ({"byteOffset": offset} if offset else {})


def _bounds(values: npt.NDArray[Any]) -> Json:
    return {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}


MAGIC = b"glTF"
HEADER = struct.Struct("<4sII")
CHUNK = struct.Struct("<I4s")
JSON_CHUNK, BINARY_CHUNK = b"JSON", b"BIN\x00"

VERSION = 2
MAX_BYTES = (1 << 32) - 1


def split_container(data: bytes) -> tuple[Any, memoryview | None]:
    """Return the parsed JSON of a file, and the binary chunk of a GLB file if it has one.

    The container is detected from the first bytes, not from the file extension.

    Raises
    ------
    FormatError
        If the file is truncated, has a version other than 2, or is not JSON.
    """
    if data[:4] != MAGIC:
        return _parsed(data), None
    if len(data) < HEADER.size:
        raise FormatError(f"ends after {len(data)} bytes, within the header of a GLB file")
    _, version, size = HEADER.unpack_from(data)
    if version != 2:
        raise FormatError(
            f"is a GLB file of version {version}; only version 2 is supported; convert it to "
            "glTF 2.0 (gltf-pipeline)"
        )
    if size > len(data):
        raise FormatError(f"is truncated: it has {len(data)} of the declared {size} bytes")
    chunks = _chunks(memoryview(data)[:size])
    if not chunks or chunks[0][0] != JSON_CHUNK:
        raise FormatError("is a GLB file that does not start with JSON")
    has_binary = len(chunks) > 1 and chunks[1][0] == BINARY_CHUNK
    return _parsed(bytes(chunks[0][1])), chunks[1][1] if has_binary else None


def _chunks(data: memoryview) -> list[tuple[bytes, memoryview]]:
    """Return type and bytes of the first two chunks."""
    chunks: list[tuple[bytes, memoryview]] = []
    offset = HEADER.size
    while len(chunks) < 2 and len(data) - offset >= CHUNK.size:
        size, kind = CHUNK.unpack_from(data, offset)
        offset += CHUNK.size
        if size > len(data) - offset:
            raise FormatError(
                f"chunk {len(chunks)} declares {size} bytes; only {len(data) - offset} follow"
            )
        chunks.append((kind, data[offset : offset + size]))
        offset += size
    return chunks


def _parsed(text: bytes) -> Any:
    try:
        return json.loads(text.decode("utf-8-sig"), parse_constant=_refuse_constant)
    except RecursionError:
        raise FormatError("is JSON nested too deeply") from None
    except ValueError as error:  # includes invalid UTF-8 and huge integers
        raise FormatError(f"is not a glTF file: its JSON cannot be read ({error})") from None


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a JSON number")


def write_container(path: Path, document: Json, buffer: BufferWriter, advice: str) -> int:
    """Write a ``.glb`` file, and return its size in bytes.

    Parameters
    ----------
    path : Path
    document : dict
        The JSON, without the buffer.
    buffer : BufferWriter
    advice : str
        Advice for the user if the file is too large.

    Raises
    ------
    InvalidInputError
        If the file is too large for its format.
    """
    complete = document | {"buffers": [{"byteLength": buffer.size_bytes}]}
    text = json.dumps(complete, ensure_ascii=False, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    size_bytes = HEADER.size + CHUNK.size + len(text) + CHUNK.size + buffer.size_bytes
    if size_bytes > MAX_BYTES:
        raise InvalidInputError(
            f"the file would have {size_bytes} bytes; a .glb file can have at most "
            f"{MAX_BYTES}; {advice}"
        )
    with path.open("wb") as file:
        file.write(HEADER.pack(MAGIC, VERSION, size_bytes))
        file.write(CHUNK.pack(len(text), JSON_CHUNK) + text)
        file.write(CHUNK.pack(buffer.size_bytes, BINARY_CHUNK))
        file.writelines(buffer.pieces)
    return size_bytes
