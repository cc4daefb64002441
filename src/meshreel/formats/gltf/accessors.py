"""Arrays of a glTF file: accessors to NumPy arrays, every size checked before it is taken."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.gltf.buffers import EXPANSION, LEAST_DECODED_BYTES, Buffers
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
        Of the type that the file has.
    is_normalized : bool
        Whether integers stand for -1..1, or 0..1 if they are unsigned.
    """

    array: npt.NDArray[Any]
    is_normalized: bool = False

    def floats(self) -> npt.NDArray[Any]:
        """The numbers that are meant, as float32 if it holds them exactly, else as float64."""
        array = self.array
        if array.dtype.kind == "f":
            return array
        if not self.is_normalized:
            return array.astype(np.float32 if array.itemsize <= 2 else np.float64)
        scaled = array / np.float64(np.iinfo(array.dtype).max)
        found: npt.NDArray[Any] = np.maximum(scaled, -1.0)
        return found


class Accessors:
    """The accessors of a file, each decoded whenever it is asked for."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.buffers = Buffers(document)
        self._reserved = 0

    def count(self, holder: JsonObject, key: str) -> int:
        """Number of elements that an accessor announces, which an object must name."""
        return self.document.item(holder, key, "accessors").whole("count")

    def read(self, holder: JsonObject, key: str, *kinds: str, count: int | None = None) -> Values:
        """The values of an accessor, which an object must name.

        Parameters
        ----------
        holder : JsonObject
        key : str
            Under which the number of the accessor stands.
        *kinds : str
            What it may be: "SCALAR", "VEC3".
        count : int, optional
            How many elements it must have; else at least one.

        Raises
        ------
        FormatError
            If it is of another kind or size, or not all within its bytes.
        """
        found = self.document.item(holder, key, "accessors")
        dtype, width = declared_type(found, kinds)
        n_elements = found.whole("count")
        if n_elements == 0 or n_elements != (count or n_elements):
            raise found.error("count", f"{count or 'at least 1'} as {holder.place} needs")
        array = self._dense(found, dtype, n_elements, width)
        if (sparse := found.child("sparse")) is not None:
            self._overwrite(array, sparse)
        return Values(array, found.flag("normalized"))

    def _dense(
        self, found: JsonObject, dtype: np.dtype[Any], count: int, width: int
    ) -> npt.NDArray[Any]:
        """The values without those that are sparse; an array of its own."""
        is_stored = self.document.index(found, "bufferView", "bufferViews") is not None
        stored = self._taken(found, dtype, count, width) if is_stored else None
        self.reserve(count * width * dtype.itemsize, found.place)
        return np.zeros((count, width), dtype) if stored is None else stored.copy()

    def reserve(self, size_bytes: int, place: str) -> None:
        """Count bytes that are about to be taken, and refuse far more than the file has."""
        self._reserved += size_bytes
        available = self.document.size_bytes + self.buffers.size_bytes
        if self._reserved > max(LEAST_DECODED_BYTES, EXPANSION * available):
            raise FormatError(
                f"{place}: the arrays of the file would take more than {EXPANSION} times its size, "
                f"and more than {LEAST_DECODED_BYTES >> 30} GiB"
            )

    def _taken(
        self, holder: JsonObject, dtype: np.dtype[Any], count: int, width: int
    ) -> npt.NDArray[Any]:
        """Elements where an accessor, or a part of a sparse one, says that they lie."""
        self.document.item(holder, "bufferView", "bufferViews")
        data, stride = self.buffers.view(holder.whole("bufferView"))
        size = width * dtype.itemsize
        start, apart = holder.whole("byteOffset", 0), stride or size
        if apart < size:
            raise FormatError(f"{holder.place}: elements of {size} bytes are {apart} bytes apart")
        if count and start + (count - 1) * apart + size > len(data):
            raise FormatError(
                f"{holder.place}: {count} elements of {size} bytes, {apart} bytes apart from byte "
                f"{start} on, are not within the {len(data)} bytes of their buffer view"
            )
        return np.ndarray((count, width), dtype, data, start, (apart, dtype.itemsize))

    def _overwrite(self, array: npt.NDArray[Any], sparse: JsonObject) -> None:
        count = sparse.whole("count")
        places, values = sparse.needed("indices"), sparse.needed("values")
        rows = self._taken(places, component_type(places, "u"), count, 1)[:, 0]
        if count and int(rows.max()) >= len(array):
            raise FormatError(
                f"{places.place}: names element {int(rows.max())}; there are {len(array)}"
            )
        array[rows] = self._taken(values, array.dtype, count, array.shape[1])


def component_type(holder: JsonObject, kinds: str = "iuf") -> np.dtype[Any]:
    """The number type that an object declares; one of these kinds, as NumPy calls them."""
    code = COMPONENTS.get(holder.whole("componentType"))
    if code is None or np.dtype(code).kind not in kinds:
        allowed = [str(one) for one, name in COMPONENTS.items() if np.dtype(name).kind in kinds]
        raise holder.error("componentType", f"one of {', '.join(allowed)}")
    return np.dtype(code)


def declared_type(accessor: JsonObject, kinds: tuple[str, ...]) -> tuple[np.dtype[Any], int]:
    """Number type and numbers per element of an accessor of one of these kinds."""
    kind = accessor.text("type")
    if kind not in kinds:
        raise accessor.error("type", f"{' or '.join(kinds)} here")
    return component_type(accessor), WIDTHS[kind]
