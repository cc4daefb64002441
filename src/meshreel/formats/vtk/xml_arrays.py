"""Safe parsing of XML, and decoding of the DataArrays of VTK: text or binary, compressed or not."""

import binascii
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.runtime.extras import LZ4

MAX_DEPTH = 200


def parse_xml(data: bytes) -> Element:
    """Return the root element of an XML document.

    Raises
    ------
    FormatError
        If it is not well formed, declares entities, or is nested too deeply.
    """
    builder, depth = TreeBuilder(), 0

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

    def refuse(name: str, *rest: Any) -> None:
        raise FormatError(f"declares the entity {name!r}; entities are not supported")

    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise FormatError(f"is not XML, or is damaged ({error})") from error
    root: Element = builder.close()
    return root


def local_name(element: Element) -> str:
    """Tag of an element without its namespace prefix."""
    return element.tag.rpartition(":")[2]


TRACK_KIND, ATTRIBUTE_KIND = "track_kind", "attribute_kind"
"""XML attributes that meshreel adds: the kind of an array that is a track or an attribute."""
UNITS = "UNITS_LABEL"
"""VTK's information key for the unit of an array."""

NUMBERS = {
    "Int8": "i1", "UInt8": "u1", "Int16": "i2", "UInt16": "u2", "Int32": "i4", "UInt32": "u4",
    "Int64": "i8", "UInt64": "u8", "Float32": "f4", "Float64": "f8",
}  # fmt: skip
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

    def read(self, element: Element) -> npt.NDArray[Any]:
        """Decode a DataArray, of shape (N,) or (N, C), in native byte order.

        Raises
        ------
        FormatError
            If its type or format is unknown, or it is damaged.
        """
        name, kind = element.get("Name", "(unnamed)"), element.get("type", "")
        if kind not in NUMBERS:
            raise FormatError(f"array {name!r} has type {kind!r}; expected a numeric type")
        try:
            values = self._numbers(element, NUMBERS[kind])
            width = int(element.get("NumberOfComponents", "1"))
            return values.reshape(-1, width) if width > 1 else values
        # Damaged text, base64 or compressed data raises one of these.
        except (ValueError, zlib.error, OverflowError) as error:
            raise FormatError(f"array {name!r} is damaged ({error})") from error

    def _numbers(self, element: Element, code: str) -> npt.NDArray[Any]:
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
        data = self._plain(stream) if self.unpack is None else self._unpack(stream, self.unpack)
        return np.frombuffer(data, f"{self.order}{code}").astype(code, copy=False)

    def _plain(self, stream: "_Stream") -> bytes:
        """Read uncompressed data, which follows its size in bytes."""
        width = self._width
        [size] = self._header(stream.decode(0, width), 1)
        if stream.is_padded(stream.encoded_size(width)):  # some writers encode the size separately
            return stream.decode(stream.encoded_size(width), size)
        return stream.decode(0, width + size)[width:]

    def _unpack(self, stream: "_Stream", unpack: Unpack) -> bytes:
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
