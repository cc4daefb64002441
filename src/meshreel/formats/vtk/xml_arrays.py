"""Safe parsing of XML, and decoding of the DataArrays of VTK: text or binary, compressed or not."""

import binascii
import re
import zlib
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.runtime.extras import LZ4

MAX_DEPTH = 200
MAX_ENTITY_BYTES = 1 << 24  # of all uses of an entity
ENTITY = re.compile(rb"&([\w.:-]+);")


def parse_xml(data: bytes) -> Element:
    """Return the root element of an XML document.

    Raises
    ------
    FormatError
        If it is not well formed, has external or very large entities, or is nested too deeply.
    """
    builder, depth, names = TreeBuilder(), 0, {b"amp", b"lt", b"gt", b"quot", b"apos"}

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > MAX_DEPTH:
            raise FormatError(f"has elements nested deeper than {MAX_DEPTH} levels")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def declare(name: str, is_parameter: bool, value: str | None, *_: Any) -> None:
        is_text = not is_parameter and value is not None and "&" not in value
        if not is_text or len(value or "") * data.count(b"&") > MAX_ENTITY_BYTES:
            raise FormatError(f"declares the entity {name!r}; only short plain text is supported")
        names.add(name.encode())

    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.EntityDeclHandler = declare
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise FormatError(f"is not XML, or is damaged ({error})") from error
    if missing := {*ENTITY.findall(data)} - names:  # expat may replace them by nothing
        raise FormatError(f"refers to the entity {min(missing)[:40]!r}, which is not declared")
    root: Element = builder.close()
    return root


def local_name(element: Element) -> str:
    """Tag of an element without its namespace prefix."""
    return element.tag.rpartition(":")[2]


SUBJECTS = {
    "FieldData": "field data", "Attribute": "data of neither nodes nor cells", "Set": "sets",
    "Grid": "grids", "Information": "information", "PointData": "arrays", "CellData": "arrays",
}  # fmt: skip
"""How notes name the contents of elements, or elements, that are not read; others by their tag."""

DERIVED = {
    "DataItem": "part of the element around it", "PDataArray": "describes an array of each piece",
    "PArray": "describes an array of each piece",
    "L2_NORM_RANGE": "computed from values", "L2_NORM_FINITE_RANGE": "computed from values",
    "COMPONENT_RANGE": "computed from values", "FINITE_RANGE": "computed from values",
}  # fmt: skip
"""Tags and names of elements without contents of their own, and the reason."""


TIMES = ("TimeValue", "TIME")
"""Field data with the time of a file in seconds, as of ParaView, deal.II and VisIt."""

COMPONENTS = "names of components"
"""How notes name the names that files give to the components of arrays."""


def unread(parents: Iterable[Element], taken: Collection[Element]) -> Iterator[tuple[str, str]]:
    """Yield the subject and name, for notes, of each child of elements that is not taken."""
    for parent in parents:
        for child in parent:
            name = child.get("Name", child.get("name", ""))
            has_contents = bool(name or len(child) or (child.text or "").strip())
            if has_contents and child not in taken and not DERIVED.keys() & {name, child.tag}:
                subject = SUBJECTS.get(child.tag, SUBJECTS.get(parent.tag, child.tag))
                yield subject, name or child.tag


TRACK_KIND, ATTRIBUTE_KIND = "track_kind", "attribute_kind"
"""XML attributes that meshreel adds: the kind of an array that is a track or an attribute."""
UNITS = "UNITS_LABEL"
"""VTK's information key for the unit of an array."""

NUMBERS = {
    "Int8": "i1", "UInt8": "u1", "Int16": "i2", "UInt16": "u2", "Int32": "i4", "UInt32": "u4",
    "Int64": "i8", "UInt64": "u8", "Float32": "f4", "Float64": "f8",
}  # fmt: skip
TEXT, MAX_TEXT_BYTES = "String", 1 << 10
"""The type of text, and its longest average."""
Unpack = Callable[[bytes, int], bytes]
"""Decompresses a block to at most the given number of bytes."""

MAX_RATIO = 1100  # deflate compresses by at most 1032:1


def _unpack_zlib(packed: bytes, size_bytes: int) -> bytes:
    return zlib.decompressobj().decompress(packed, size_bytes)


def _unpack_lzma(packed: bytes, size_bytes: int) -> bytes:
    import lzma  # some Python builds lack it

    try:
        return lzma.LZMADecompressor().decompress(packed, size_bytes)
    except lzma.LZMAError as error:
        raise FormatError(f"contains a block that is not LZMA ({error})") from error


def _unpack_lz4(packed: bytes, size_bytes: int) -> bytes:
    library = LZ4.load()
    try:
        return bytes(library.lz4_decode(packed, out=size_bytes))
    except library.Lz4Error as error:
        raise FormatError(f"contains a block that is not LZ4, or is damaged ({error})") from error


UNPACKERS: dict[str, Unpack] = {
    "vtkZLibDataCompressor": _unpack_zlib,
    "vtkLZMADataCompressor": _unpack_lzma,
    "vtkLZ4DataCompressor": _unpack_lz4,
}


@dataclass(frozen=True)
class ArrayCoding:
    """How a file encodes its arrays."""

    order: str
    """{"<", ">"}. Byte order: little or big endian."""
    header: str
    """{"u4", "u8"}. Type of the sizes in front of the data."""
    unpack: Unpack | None
    """Decompressor, for files with compressed arrays."""
    appended: bytes = b""
    """Content of AppendedData."""
    is_raw: bool = False
    """Whether the appended data is raw bytes rather than base64."""
    taken: set[Element] = field(default_factory=set)
    """Elements that are read."""
    max_corners: int = 0
    """Largest number of corners of a cell that the number of points allows."""

    def read(
        self, element: Element, n_items: int | None = None, *, allows_text: bool = False
    ) -> npt.NDArray[Any]:
        """Decode an array, of shape (N,) or (N, C), in native byte order; text as `str` objects.

        Parameters
        ----------
        n_items : int, optional
            Declared number of items. Default: unknown.
        allows_text : bool, default False
            Whether the array may be text.

        Raises
        ------
        FormatError
            If its type or format is unknown, it is damaged, or has another number of items.
        """
        name, kind = element.get("Name", "(unnamed)"), element.get("type", "")
        is_text = allows_text and kind == TEXT
        if kind not in NUMBERS and not is_text:
            raise FormatError(f"array {name!r} has type {kind!r}; expected a numeric type")
        self.taken.add(element)
        code = NUMBERS.get(kind, "u1")
        try:
            width = max(1, int(element.get("NumberOfComponents", "1")))
            size = None if n_items is None else n_items * width
            item_bytes = MAX_TEXT_BYTES if is_text else int(code[1])
            values = self._numbers(element, code, None if size is None else size * item_bytes)
            if is_text and values.size - np.count_nonzero(values) == size:
                texts = values.tobytes().decode("utf-8", "replace").split("\0")[:-1]
                values = np.array(texts, object)
            if size not in (None, len(values)):
                raise ValueError(f"it has {len(values)} numbers; the file declares {size}")
            return values.reshape(-1, width) if width > 1 else values
        # Damaged text, base64 or compressed data raises one of these.
        except (ValueError, zlib.error, OverflowError) as error:
            raise FormatError(f"array {name!r} is damaged ({error})") from error

    def _numbers(self, element: Element, code: str, max_bytes: int | None) -> npt.NDArray[Any]:
        match element.get("format", "ascii"):
            case "ascii":
                words = (element.text or "").split()
                return np.array(words, code if code[0] == "f" else np.int64).astype(code)
            case "binary":
                stream = _Stream("".join((element.text or "").split()).encode(), is_raw=False)
            case "appended":
                begin = max(0, int(element.get("offset", "0")))
                stream = _Stream(self.appended[begin:], self.is_raw)
            case other:
                raise FormatError(f"has a DataArray of unknown format {other!r}")
        unpack = self.unpack
        data = self._unpack(stream, unpack, max_bytes) if unpack else self._plain(stream, max_bytes)
        return np.frombuffer(data, f"{self.order}{code}").astype(code, copy=False)

    def _plain(self, stream: "_Stream", max_bytes: int | None) -> bytes:
        """Read uncompressed data, which follows its size in bytes."""
        width = self._width
        [size] = self._header(stream.decode(0, width), 1)
        _check_size(size, max_bytes)
        if stream.is_padded(stream.encoded_size(width)):  # some writers encode the size separately
            return stream.decode(stream.encoded_size(width), size)
        return stream.decode(0, width + size)[width:]

    def _unpack(self, stream: "_Stream", unpack: Unpack, max_bytes: int | None) -> bytes:
        """Decompress blocks.

        The header lists their number, the size of a block, the size of a smaller last block or 0,
        and the compressed size of each.
        """
        [n_blocks] = self._header(stream.decode(0, self._width), 1)
        if n_blocks == 0:
            return b""
        head_bytes = (3 + n_blocks) * self._width
        _, size, last_size, *packed = self._header(stream.decode(0, head_bytes), 3 + n_blocks)
        sizes = [size] * (n_blocks - bool(last_size)) + [last_size] * bool(last_size)
        _check_size(sum(sizes), max_bytes)
        if sum(sizes) > MAX_RATIO * len(stream.data):
            raise FormatError(
                f"declares {sum(sizes)} bytes, more than its compressed data can contain"
            )
        data, offset = memoryview(stream.decode(stream.encoded_size(head_bytes), sum(packed))), 0
        pieces = []
        for length, expected in zip(packed, sizes, strict=True):
            pieces.append(unpack(bytes(data[offset : offset + length]), expected))
            offset += length
            if len(pieces[-1]) != expected:
                raise FormatError(
                    f"a block has {len(pieces[-1])} bytes; its header declares {expected}"
                )
        return b"".join(pieces)

    @property
    def _width(self) -> int:
        return int(self.header[1])

    def _header(self, data: bytes, count: int) -> list[int]:
        numbers: list[int] = np.frombuffer(data, f"{self.order}{self.header}", count).tolist()
        return numbers


def _check_size(n_bytes: int, max_bytes: int | None) -> None:
    if max_bytes is not None and n_bytes > max_bytes:
        raise ValueError(f"it has {n_bytes} bytes; the counts of the file allow {max_bytes}")


@dataclass(frozen=True)
class _Stream:
    """Binary data, raw or in base64; offsets count encoded characters."""

    data: bytes
    is_raw: bool

    def encoded_size(self, count: int) -> int:
        """Size of `count` bytes that are encoded separately."""
        return count if self.is_raw else -(-count // 3) * 4

    def is_padded(self, offset: int) -> bool:
        """Whether base64 padding ends at this offset."""
        return not self.is_raw and self.data[offset - 1 : offset] == b"="

    def decode(self, offset: int, count: int) -> bytes:
        """Decode `count` bytes from an offset.

        Raises
        ------
        FormatError
            If the data ends before them.
        """
        contents = self.data[offset : offset + self.encoded_size(count)]
        if not self.is_raw:
            contents = binascii.a2b_base64(contents, strict_mode=True)[:count]
        if len(contents) < count:
            raise FormatError(f"has {len(contents)} bytes; {count} are declared")
        return contents
