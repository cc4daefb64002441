"""Writing arrays to the single buffer of a glTF file, with buffer views and accessors."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

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
