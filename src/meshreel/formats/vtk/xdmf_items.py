"""DataItems of XDMF files: arrays stored inline, or in separate HDF5 and binary files."""

import ast
import math
import operator
import re
from collections.abc import Callable, Sequence
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
from meshreel.formats.options import Reading

CODES = {"float": "f", "int": "i", "uint": "u", "char": "i", "uchar": "u", "short": "i"}
PRECISIONS = {"char": "1", "uchar": "1", "short": "2"}
MAX_REFERENCES = 16
MAX_NESTED, MAX_FUNCTION_LENGTH, MAX_JOINED = 3, 200, 9
"""How deep items may be nested, and limits on the text and the columns of a function."""

OPERATORS: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
}  # fmt: skip
PATH_ELEMENT = re.compile(r"(\w+)(?:\[(?:(\d{1,9})|@Name=['\"]([^'\"]*)['\"])\])?")
"""One step of a path to an element: a tag, and an index or name among those of the tag."""

Array = npt.NDArray[Any]


class DataItems:
    """Reads the arrays of an XDMF file.

    Parameters
    ----------
    root : Element
        Root of the document.
    reading : Reading
        Whether referenced files may be outside the folder of this one.

    Attributes
    ----------
    taken : set of Element
        Elements that are read.
    """

    def __init__(self, path: Path, root: Element, reading: Reading) -> None:
        self._path, self._root, self._options = path, root, reading
        self._files: dict[Path, Node] = {}
        self.taken: set[Element] = set()

    def dereference(self, element: Element) -> Element:
        """Return the element itself, or the one that it refers to.

        Raises
        ------
        FormatError
            If the target does not exist, or references form a cycle.
        """
        for _ in range(MAX_REFERENCES):
            self.taken.add(element)
            reference = element.get("Reference")
            if reference is None:
                return element
            path = (element.text or "").strip() if reference.upper() == "XML" else reference
            element = _follow(self._root, path)
        raise FormatError("has circular references")

    def item_of(self, element: Element) -> Element:
        """Return the only DataItem of an element."""
        items = element.findall("DataItem")
        if len(items) != 1:
            raise FormatError(f"has a {element.tag} with {len(items)} DataItems; expected 1")
        return self.dereference(items[0])

    def key(self, item: Element, depth: int = 0) -> Any:
        """Return a key that is equal for items with the same array, without reading it."""
        if depth > MAX_REFERENCES:
            raise FormatError("has circular references")
        item = self.dereference(item)
        attributes = tuple(sorted(item.attrib.items()))
        children = tuple(self.key(child, depth + 1) for child in item)
        return attributes, (item.text or "").strip(), children

    def read(self, item: Element, depth: int = 0) -> Array:
        """Read the array of an item, in native byte order.

        Raises
        ------
        FormatError
            If the item has an unsupported kind, is damaged, or is outside the folder of the file.
        """
        source, part, shape = self._locate(item, depth)
        with hdf_errors():
            return native(np.asarray(source[part])).reshape(shape)

    def describe(self, item: Element) -> tuple[int, np.dtype[Any]]:
        """Return the size and type of an item, without reading data from HDF5 files.

        Raises
        ------
        FormatError
            As `read`.
        """
        source, _, shape = self._locate(item)
        return math.prod(shape), source.dtype.newbyteorder("=")

    def _locate(
        self, item: Element, depth: int = 0
    ) -> tuple[Array | Dataset, tuple[slice, ...], tuple[int, ...]]:
        """Return the array or HDF5 dataset of an item, the part that it selects, and its shape."""
        item = self.dereference(item)
        source, part = self._source(item, depth)
        if source.dtype.kind not in "iuf":
            raise FormatError(f"has a DataItem of {source.dtype}; expected numbers")
        axes = zip(part, source.shape, strict=True) if part else ()
        stored_shape = tuple(len(range(*axis.indices(n))) for axis, n in axes) or source.shape
        size, shape = math.prod(stored_shape), _shape(item) or stored_shape
        if math.prod(shape) != size:
            raise FormatError(f"has {size} numbers in a DataItem with Dimensions {shape}")
        return source, part, shape

    def _slab(self, item: Element, depth: int) -> tuple[Array | Dataset, tuple[slice, ...]]:
        """Return another item and the part of it with a start, stride and count of each axis."""
        children = item.findall("DataItem")
        if len(children) != 2:
            raise FormatError(f"has a HyperSlab with {len(children)} DataItems; it needs 2")
        numbers = self.read(children[0], depth + 1).ravel()
        source, part = self._source(self.dereference(children[1]), depth + 1)
        source = source[part] if part else source
        return source, _slices(source, numbers)

    def _function(self, item: Element, depth: int) -> Array:
        """Return the result of a function of other items, such as JOIN($0, $1, 0*$0)."""
        text, n_rows = item.get("Function") or item.get("function") or "", _shape(item)[:-1]
        if len(text) > MAX_FUNCTION_LENGTH:
            raise FormatError(f"has a function longer than {MAX_FUNCTION_LENGTH} characters")
        arrays = []
        for child in item.findall("DataItem"):
            values = self.read(child, depth + 1).ravel()
            arrays.append(values.astype(np.int64) if values.dtype.kind in "iu" else values)
        expression = re.sub(r"\$(\d+)", r"_\1", text).replace(";", ",").strip()
        try:
            tree = ast.parse(expression, mode="eval")
            with np.errstate(all="ignore"):
                return np.asarray(_evaluate(tree.body, arrays, math.prod(n_rows)))
        # Text that is not an expression, and arrays that do not fit each other, raise one of these.
        except (ArithmeticError, LookupError, MemoryError, RecursionError, SyntaxError,
                ValueError) as error:  # fmt: skip
            raise FormatError(f"cannot compute the function {text!r} ({error})") from error

    def _source(self, item: Element, depth: int) -> tuple[Array | Dataset, tuple[slice, ...]]:
        """Return the array or HDF5 dataset of an item, and the part that it selects."""
        if depth > MAX_NESTED:
            raise FormatError(f"has DataItems nested deeper than {MAX_NESTED} levels")
        match item.get("ItemType", "Uniform").lower():
            case "hyperslab":
                return self._slab(item, depth)
            case "function":
                return self._function(item, depth), ()
            case kind if kind != "uniform":
                raise FormatError(f"has a DataItem of unsupported type {kind!r}")
        text, kind = (item.text or "").strip(), item.get("Format", "XML").upper()
        if kind == "XML":
            return self._parse(item, text), ()
        if kind == "HDF":
            return self._dataset(item)
        if kind == "BINARY":
            return self._binary(item, self._resolve(text)), ()
        raise FormatError(
            f"has a DataItem of format {kind[:40]!r}; XML, HDF and Binary are supported"
        )

    def _dataset(self, item: Element) -> tuple[Dataset, tuple[slice, ...]]:
        """Return the HDF5 dataset of an item, and the part that is selected after its path.

        XDMF 3 writes ``file.h5:/dataset|starts:strides:counts:size of the dataset``. Some programs
        declare the number of steps as the size of an axis that is stored once.
        """
        location, bar, selection = (item.text or "").strip().partition("|")
        file, colon, name = location.rpartition(":/")
        if not colon:  # file names may contain colons too
            file, _, name = location.partition(":")
        with hdf_errors():
            dataset = require_dataset(self._file(self._resolve(file)), name)
        if not bar:
            return dataset, ()
        axes = [[_parse_integer(word) for word in words.split()] for words in selection.split(":")]
        sizes = axes[-1]
        if len(axes) != 4 or [*dataset.shape] not in (sizes, [1, *sizes[1:]]):
            raise FormatError(
                f"selects {selection[:80]!r} of an array of shape {dataset.shape}; expected "
                "start:stride:count:size with this size"
            )
        numbers = np.array([number for axis in axes[:3] for number in axis], np.int64)
        return dataset, _slices(dataset, numbers)

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


def _evaluate(node: ast.AST, arrays: Sequence[Array], n_rows: int) -> Any:
    """Evaluate a function of arrays of shape (N,); JOIN makes them the columns of n_rows values."""
    match node:
        case ast.Constant(value=int() | float() as number):
            return number
        case ast.Name(id=name) if re.fullmatch(r"_\d+", name):
            return arrays[int(name[1:])]
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_evaluate(operand, arrays, n_rows)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
            values = (_evaluate(side, arrays, n_rows) for side in (left, right))
            return OPERATORS[type(op)](*values)
        case ast.Call(func=ast.Name(id=name), args=args) if (
            name.upper() == "JOIN" and len(args) <= MAX_JOINED
        ):
            columns = [np.atleast_1d(_evaluate(argument, arrays, n_rows)) for argument in args]
            if any(len(column) != n_rows for column in columns):
                raise ValueError(f"JOIN needs {n_rows} numbers in each column")
            return np.stack(columns, axis=1)
    raise ValueError(f"only {', '.join('+-*/')} and JOIN of at most {MAX_JOINED} are supported")


def _slices(source: Array | Dataset, numbers: Array) -> tuple[slice, ...]:
    """Return a part of an array: its starts, then its strides, then its counts along all axes."""
    try:
        starts, strides, counts = numbers.reshape(3, -1).astype(np.int64).tolist()
    except ValueError:
        raise FormatError("has a HyperSlab without start, stride and count") from None
    for axis in reversed(range(len(starts))):  # programs declare axes of one value, not stored
        if len(starts) > len(source.shape) and (starts[axis], counts[axis]) == (0, 1):
            del starts[axis], strides[axis], counts[axis]
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
    return tuple(slice(start, end + 1, step) for start, end, step in ranges)


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
