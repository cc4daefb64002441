"""DataItems of XDMF files: arrays stored inline, or in separate HDF5 and binary files."""

import math
import re
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import numpy.typing as npt

from meshreel.arrays import native
from meshreel.errors import FormatError
from meshreel.formats.file_errors import errors_naming, os_errors_naming
from meshreel.formats.file_references import resolve_reference
from meshreel.formats.hdf import Dataset, Node, hdf_errors, open_hdf, require_dataset
from meshreel.formats.options import ReadOptions

CODES = {"float": "f", "int": "i", "uint": "u", "char": "i", "uchar": "u", "short": "i"}
PRECISIONS = {"char": "1", "uchar": "1", "short": "2"}
MAX_REFERENCES = 16
PATH_ELEMENT = re.compile(r"(\w+)(?:\[(?:(\d{1,9})|@Name=['\"]([^'\"]*)['\"])\])?")
"""One step of a path to an element: a tag, and an index or name among those of the tag."""

Array = npt.NDArray[Any]


class DataItems:
    """Reads the arrays of an XDMF file.

    Parameters
    ----------
    root : Element
        Root of the document.
    options : ReadOptions
        Whether referenced files may be outside the folder of this one.
    """

    def __init__(self, path: Path, root: Element, options: ReadOptions) -> None:
        self._path, self._root, self._options = path, root, options
        self._files: dict[Path, Node] = {}

    def dereference(self, element: Element) -> Element:
        """Return the element itself, or the one that it refers to.

        Raises
        ------
        FormatError
            If the target does not exist, or references form a cycle.
        """
        for _ in range(MAX_REFERENCES):
            reference = element.get("Reference")
            if reference is None:
                return element
            path = (element.text or "").strip() if reference.upper() == "XML" else reference
            element = _follow(self._root, path)
        raise FormatError("has circular references")

    def item_of(self, element: Element) -> Element:
        """Return the first DataItem of an element."""
        if (item := element.find("DataItem")) is None:
            raise FormatError(f"has a {element.tag} without a DataItem")
        return self.dereference(item)

    def key(self, item: Element, depth: int = 0) -> Any:
        """Return a key that is equal for items with the same array, without reading it."""
        if depth > MAX_REFERENCES:
            raise FormatError("has circular references")
        item = self.dereference(item)
        attributes = tuple(sorted(item.attrib.items()))
        children = tuple(self.key(child, depth + 1) for child in item)
        return attributes, (item.text or "").strip(), children

    def read(self, item: Element) -> Array:
        """Read the array of an item, in native byte order.

        Raises
        ------
        FormatError
            If the item has an unsupported kind, is damaged, or is outside the folder of the file.
        """
        item = self.dereference(item)
        match item.get("ItemType", "Uniform").lower():
            case "uniform":
                values = self._read_stored(item)
            case "hyperslab":
                values = self._read_slab(item)
            case kind:
                raise FormatError(f"has a DataItem of unsupported type {kind!r}")
        values = native(np.asarray(values))
        if values.dtype.kind not in "iuf":
            raise FormatError(f"has a DataItem of {values.dtype}; expected numbers")
        shape = _shape(item)
        if shape and math.prod(shape) != values.size:
            raise FormatError(f"has {values.size} numbers in a DataItem with Dimensions {shape}")
        return values.reshape(shape) if shape else values

    def describe(self, item: Element) -> tuple[int, np.dtype[Any]]:
        """Return the size and type of an item, without reading data from HDF5 files.

        Raises
        ------
        FormatError
            As `read`.
        """
        item = self.dereference(item)
        shape, children = _shape(item), item.findall("DataItem")
        source = self.dereference(children[-1]) if children else item
        if shape and source.get("Format", "XML").upper() == "HDF":
            dataset, _ = self._dataset(source)
            return math.prod(shape), dataset.dtype.newbyteorder("=")
        values = self.read(item)
        return values.size, values.dtype

    def _read_stored(self, item: Element) -> Array:
        source = self._source(item)
        if isinstance(source, np.ndarray):
            return source
        with hdf_errors():
            return np.asarray(source[()])

    def _read_slab(self, item: Element) -> Array:
        """Read a part of another item, given start, stride and count of each axis."""
        children = item.findall("DataItem")
        if len(children) != 2:
            raise FormatError(f"has a HyperSlab with {len(children)} DataItems; it needs 2")
        source = self._source(self.dereference(children[1]))
        return _part(source, self._read_stored(self.dereference(children[0])).ravel())

    def _source(self, item: Element) -> Array | Dataset:
        """Return the whole array of an item, or the HDF5 dataset that stores it."""
        text, kind = (item.text or "").strip(), item.get("Format", "XML").upper()
        if kind == "XML":
            return self._parse(item, text)
        if kind == "HDF":
            dataset, part = self._dataset(item)
            return dataset if part is None else _part(dataset, part)
        if kind == "BINARY":
            return self._binary(item, self._resolve(text))
        raise FormatError(
            f"has a DataItem of format {kind[:40]!r}; XML, HDF and Binary are supported"
        )

    def _dataset(self, item: Element) -> tuple[Dataset, Array | None]:
        """Return the HDF5 dataset of an item, and the numbers after its path that select a part.

        XDMF 3 writes ``file.h5:/dataset|starts:strides:counts:size of the dataset``.
        """
        location, bar, selection = (item.text or "").strip().partition("|")
        file, colon, name = location.rpartition(":/")
        if not colon:  # file names may contain colons too
            file, _, name = location.partition(":")
        with hdf_errors():
            dataset = require_dataset(self._file(self._resolve(file)), name)
        if not bar:
            return dataset, None
        axes = [[_parse_integer(word) for word in words.split()] for words in selection.split(":")]
        if len(axes) != 4 or tuple(axes[3]) != dataset.shape:
            raise FormatError(
                f"selects {selection[:80]!r} of an array of shape {dataset.shape}; expected "
                "start:stride:count:size with this size"
            )
        return dataset, np.array([number for axis in axes[:3] for number in axis], np.int64)

    def _resolve(self, file: str) -> Path:
        return resolve_reference(self._path, file, self._options)

    def _parse(self, item: Element, text: str) -> Array:
        """Parse numbers in XML text."""
        code = _code(item)
        try:
            words = text.split()
            values = np.array(words, code if code[0] == "f" else np.int64).astype(code)
        except (ValueError, OverflowError) as error:
            raise FormatError(f"has a DataItem that is not numbers ({error})") from error
        shape = _shape(item)
        return values.reshape(shape) if math.prod(shape) == values.size and shape else values

    def _binary(self, item: Element, path: Path) -> Array:
        if item.get("Compression", "Raw").lower() != "raw":
            raise FormatError("has a compressed binary DataItem, which is not supported")
        order = ">" if item.get("Endian", "Native").lower() == "big" else "<"
        seek, shape = _parse_integer(item.get("Seek", "0")), _shape(item)
        size = math.prod(shape) * int(_code(item)[1])
        if not 0 <= seek <= seek + size <= path.stat().st_size:
            raise FormatError(
                f"needs {size} bytes from byte {seek} on of {path.name}, which is shorter"
            )
        with os_errors_naming(path):
            values: Array = np.fromfile(path, order + _code(item), math.prod(shape), offset=seek)
        return values.reshape(shape)

    def _file(self, path: Path) -> Node:
        if path not in self._files:
            with errors_naming(path):
                self._files[path] = open_hdf(path)
        return self._files[path]


def _part(source: Array | Dataset, numbers: Array) -> Array:
    """Read a part of an array: its starts, then its strides, then its counts along all axes."""
    try:
        starts, strides, counts = numbers.reshape(3, -1).astype(np.int64).tolist()
    except ValueError:
        raise FormatError("has a HyperSlab without start, stride and count") from None
    ends = [
        start + (count - 1) * stride
        for start, stride, count in zip(starts, strides, counts, strict=True)
    ]
    if (
        len(starts) != len(source.shape)
        or min([*starts, *counts, *(stride - 1 for stride in strides)]) < 0
        or any(end >= size for end, size in zip(ends, source.shape, strict=True))
    ):
        raise FormatError(f"has a HyperSlab outside its source of shape {source.shape}")
    ranges = zip(starts, ends, strides, strict=True)
    with hdf_errors():
        return np.asarray(source[tuple(slice(start, end + 1, step) for start, end, step in ranges)])


def _follow(root: Element, path: str) -> Element:
    """Return the element at a path such as /Xdmf/Domain/Grid[2]/Topology."""
    element = root
    for word in path.strip().removeprefix("/Xdmf/").split("/"):
        if (match := PATH_ELEMENT.fullmatch(word)) is None:
            raise FormatError(f"refers to {path[:80]!r}, which is not a supported path")
        tag, number, name = match.groups()
        children = [child for child in element if child.tag == tag]
        if name is not None:
            children = [child for child in children if child.get("Name") == name]
        matches = children[int(number) - 1 if number else 0 :][:1]
        if not matches or number == "0":
            raise FormatError(f"refers to {path[:80]!r}, which does not exist")
        element = matches[0]
    return element


def _code(item: Element) -> str:
    kind = (item.get("NumberType") or item.get("DataType") or "Float").lower()
    code = CODES.get(kind, "") + PRECISIONS.get(kind, item.get("Precision", "4"))
    if code not in ("f4", "f8", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8"):
        raise FormatError(
            f"has a DataItem of {kind[:40]!r} with Precision {item.get('Precision')!r}; it is "
            "not supported"
        )
    return code


def _shape(item: Element) -> tuple[int, ...]:
    return tuple(_parse_integer(word) for word in item.get("Dimensions", "").split())


def _parse_integer(word: str) -> int:
    if not (word.isascii() and word.isdigit() and len(word) <= 18):
        raise FormatError(f"has {word[:40]!r} where a non-negative integer is expected")
    return int(word)
