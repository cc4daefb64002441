"""Reading accessors of a glTF file as NumPy arrays, with all sizes checked before allocation."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.gltf.buffers import MAX_EXPANSION, MIN_EXPANDED_BYTES, Buffers
from meshreel.formats.gltf.document import Document
from meshreel.formats.gltf.json_object import JsonObject

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
