"""Containers of glTF files: JSON and binary chunk to read, nodes and buffer to write."""

import base64
import json
import struct
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.gltf.meshopt import MAX_STRIDE, MESHOPT
from meshreel.formats.gltf.meshopt_encoding import encode_view

Json = dict[str, Any]

MAGIC = b"glTF"
HEADER = struct.Struct("<4sII")
CHUNK = struct.Struct("<I4s")
JSON_CHUNK, BINARY_CHUNK = b"JSON", b"BIN\x00"

VERSION = 2
MAX_BYTES = (1 << 32) - 1

COMPONENT_TYPES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
JOINTS = "JOINTS_0"
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
ALIGNMENT = 4
"""Alignment of each vertex attribute and its stride, in bytes."""

QUANTIZATION = "KHR_mesh_quantization"
TINY = np.float32(1e-30)
GZIP_WINDOW = 31
"""`wbits` of zlib for the format gzip."""
EXTENSION_BYTES = 200
"""Approximate bytes of JSON that a compressed buffer view adds."""


def split_container(data: bytes) -> tuple[Any, memoryview | None]:
    """Return the parsed JSON of a file, and the binary chunk of a GLB file if it has one.

    The container is detected from the first bytes, not from the file extension.
    """
    if data[:4] != MAGIC:
        return _parse_json(data), None
    if len(data) < HEADER.size:
        raise FormatError(f"ends after {len(data)} bytes, within the header of a GLB file")
    _, version, size = HEADER.unpack_from(data)
    if version != VERSION:
        raise FormatError(
            f"is a GLB file of version {version}; only version 2 is supported; convert it to "
            "glTF 2.0 (gltf-pipeline)"
        )
    if size > len(data):
        raise FormatError(f"is truncated: it has {len(data)} of the declared {size} bytes")
    chunks: list[tuple[bytes, memoryview]] = []
    offset = HEADER.size
    while len(chunks) < 2 and size - offset >= CHUNK.size:
        length, kind = CHUNK.unpack_from(data, offset)
        offset += CHUNK.size
        if length > size - offset:
            raise FormatError(
                f"chunk {len(chunks)} declares {length} bytes; only {size - offset} follow"
            )
        chunks.append((kind, memoryview(data)[offset : offset + length]))
        offset += length
    if not chunks or chunks[0][0] != JSON_CHUNK:
        raise FormatError("is a GLB file that does not start with JSON")
    has_binary = len(chunks) > 1 and chunks[1][0] == BINARY_CHUNK
    return _parse_json(bytes(chunks[0][1])), chunks[1][1] if has_binary else None


def _parse_json(text: bytes) -> Any:
    try:
        return json.loads(text.decode("utf-8-sig"), parse_constant=_refuse_constant)
    except RecursionError:
        raise FormatError("is JSON nested too deeply") from None
    except ValueError as error:  # includes invalid UTF-8 and huge integers
        raise FormatError(f"is not a glTF file: its JSON cannot be read ({error})") from None


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a JSON number")


@dataclass(frozen=True, eq=False)
class VertexValues:
    """Vertex values in the buffer."""

    view: int
    """Index of the buffer view."""
    offset: int
    stride: int
    """Byte offset in the view, and bytes per vertex."""
    values: npt.NDArray[Any]
    """Array of shape (N, C)."""


class BufferWriter:
    """The buffer of a file, to which arrays are appended.

    Parameters
    ----------
    is_compressed : bool, default False
        Whether arrays are compressed where that makes the file smaller. If not, floats replace the
        signed integers that only `KHR_mesh_quantization` allows, since programs without the one
        extension often lack the other.

    Attributes
    ----------
    pieces : list of bytes
        Consecutive pieces of the buffer.
    size_bytes, decompressed_bytes : int
        Size of the buffer, and of the values that readers decompress.
    views, accessors : list of dict
        Entries of the JSON.
    is_quantized : bool
        Whether readers need `KHR_mesh_quantization`.
    """

    def __init__(self, *, is_compressed: bool = False) -> None:
        self.pieces: list[bytes] = []
        self.size_bytes: int = 0
        self.decompressed_bytes: int = 0
        self.views: list[Json] = []
        self.accessors: list[Json] = []
        self.is_quantized: bool = False
        self._is_compressed = is_compressed

    @property
    def required_extensions(self) -> list[str]:
        """The extensions that readers of the buffer need."""
        return [MESHOPT] if self.decompressed_bytes else []

    def buffers(self, **properties: Any) -> list[Json]:
        """Return the JSON of the buffer, and of the one that readers decompress it to."""
        buffers: list[Json] = [{"byteLength": self.size_bytes, **properties}]
        for name in self.required_extensions:
            extensions = {name: {"fallback": True}}
            buffers.append({"byteLength": self.decompressed_bytes, "extensions": extensions})
        return buffers

    def add_vertices(
        self, arrays: Sequence[npt.NDArray[Any]], *, are_unit: bool = False
    ) -> list[VertexValues]:
        """Append vertex values, consecutive arrays of the same type and shape (N, C).

        Signed integers are normalized values, stored as floats if there is no compression.

        Parameters
        ----------
        are_unit : bool, default False
            Whether the values are unit vectors; so are their floats then.
        """
        if arrays[0].dtype.kind == "i":
            self.is_quantized = self._is_compressed
            if not self.is_quantized:
                largest = np.float32(np.iinfo(arrays[0].dtype).max)
                arrays = [array / largest for array in arrays]
                if are_unit:
                    lengths = [np.linalg.norm(array, axis=1, keepdims=True) for array in arrays]
                    arrays = [
                        array / np.maximum(length, TINY)
                        for array, length in zip(arrays, lengths, strict=True)
                    ]
        n_verts, width = arrays[0].shape
        dtype = arrays[0].dtype
        row_bytes = width * dtype.itemsize
        stride = -(-row_bytes // ALIGNMENT) * ALIGNMENT
        padded = np.zeros((len(arrays), n_verts, stride), np.uint8)
        for target, array in zip(padded, arrays, strict=True):
            encoded = np.ascontiguousarray(array, dtype.newbyteorder("<"))
            target[:, :row_bytes] = encoded.view(np.uint8).reshape(n_verts, row_bytes)
        rows = padded.reshape(-1, stride)
        elements = rows.view(dtype.newbyteorder("<"))
        view = self._add_elements(elements, "ATTRIBUTES", byteStride=stride, target=ARRAY_BUFFER)
        return [
            VertexValues(view, number * n_verts * stride, stride, array)
            for number, array in enumerate(arrays)
        ]

    def vertex_accessors(self, columns: Mapping[str, VertexValues], verts: slice) -> dict[str, int]:
        """Add accessors of attributes on a range of vertices, and return their indices by name.

        Integers are normalized, except joints and application-specific attributes.
        """
        accessors = {}
        for name, column in columns.items():
            values = column.values[verts]
            start = column.offset + verts.start * column.stride
            properties: Json = {"byteOffset": start} if start else {}
            if values.dtype.kind in "iu" and not name.startswith("_") and name != JOINTS:
                properties["normalized"] = True
            has_bounds = name == "POSITION"
            accessors[name] = self._add_accessor(
                column.view, values, has_bounds=has_bounds, **properties
            )
        return accessors

    def add_indices(self, indices: npt.NDArray[np.integer]) -> int:
        """Append triangle corners in the smallest index type, and return their accessor."""
        dtype = np.dtype("<u2" if indices.max() < 0xFFFF else "<u4")  # 0xFFFF is primitive restart
        values = indices.astype(dtype).reshape(-1, 1)
        view = self._add_elements(values, "TRIANGLES", target=ELEMENT_ARRAY_BUFFER)
        return self._add_accessor(view, values)

    def add_rows(
        self,
        rows: npt.NDArray[np.floating],
        width: int | None = None,
        *,
        has_bounds: bool = False,
    ) -> int:
        """Append float32 rows of shape (N, C), and return their accessor.

        It has items of `width` values, of which each row may have several; by default one.
        """
        rows = rows.astype("<f4")
        items = rows.reshape(-1, width or rows.shape[1])
        view = self._add_elements(rows if rows[0].nbytes <= MAX_STRIDE else items)
        return self._add_accessor(view, items, has_bounds=has_bounds)

    def add_curves(
        self,
        curves: Sequence[npt.NDArray[Any]],
        filter_input: tuple[npt.NDArray[Any], str] | None = None,
        *,
        has_bounds: bool = False,
    ) -> list[int]:
        """Append values of several animations, of shape (N, C), and return their accessors.

        Parameters
        ----------
        filter_input : tuple of array and str, optional
            Array that a filter decodes to the values, and its name, for compression.
        """
        values = np.concatenate(curves)
        values = values.astype(values.dtype.newbyteorder("<"))
        view = self._add_elements(values, filter_input=filter_input)
        accessors, start = [], 0
        for curve in curves:
            properties: Json = {"byteOffset": start} if start else {}
            if values.dtype.kind == "i":
                properties["normalized"] = True
            accessors.append(self._add_accessor(view, curve, has_bounds=has_bounds, **properties))
            start += curve.nbytes
        return accessors

    def add_view(self, data: bytes, **properties: Any) -> int:
        """Append bytes, such as those of an image, and return the index of their buffer view."""
        view = {"buffer": 0, "byteOffset": self.size_bytes, "byteLength": len(data)}
        self.views.append(view | properties)
        self.pieces.append(data + bytes(-len(data) % ALIGNMENT))
        self.size_bytes += len(self.pieces[-1])
        return len(self.views) - 1

    def _add_elements(
        self,
        elements: npt.NDArray[Any],
        mode: str = "ATTRIBUTES",
        filter_input: tuple[npt.NDArray[Any], str] | None = None,
        **properties: Any,
    ) -> int:
        """Append rows, compressed if that is shorter, and return the index of their view."""
        if not self._is_compressed:
            return self.add_view(elements.tobytes(), **properties)
        source, filter_kind = filter_input or (elements, "NONE")
        data, kind = encode_view(source, mode)
        if filter_input:
            kind = filter_kind
        if len(data) + EXTENSION_BYTES > elements.nbytes:
            return self.add_view(elements.tobytes(), **properties)
        index = self.add_view(data)
        compression = {
            **self.views[index],
            "byteStride": elements[0].nbytes,
            "count": len(elements),
            "mode": mode,
            "filter": kind,
        }
        self.views[index] = {
            "buffer": 1,
            "byteOffset": self.decompressed_bytes,
            "byteLength": elements.nbytes,
            **properties,
            "extensions": {MESHOPT: compression},
        }
        self.decompressed_bytes += elements.nbytes + -elements.nbytes % ALIGNMENT
        return index

    def _add_accessor(
        self, view: int, values: npt.NDArray[Any], *, has_bounds: bool = False, **properties: Any
    ) -> int:
        accessor = {
            "bufferView": view,
            "componentType": COMPONENT_TYPES[values.dtype.str[1:]],
            "count": len(values),
            "type": TYPES[values.shape[1]],
        } | properties
        if has_bounds:
            accessor |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        self.accessors.append(accessor)
        return len(self.accessors) - 1


@dataclass(frozen=True, eq=False)
class Placement:
    """A translation and a uniform scale, for the node of a mesh."""

    offset: Floats
    """float64 array of shape (3,). Center of the box, exact in float32."""
    scale: float
    """Half size of the box, positive and exact in float32."""


IDENTITY = Placement(np.zeros(3), 1.0)
"""The placement that leaves positions unchanged."""


NodePath = tuple[str, ...]


class NodeTree:
    """The nodes of a scene, with parents created on demand.

    Attributes
    ----------
    nodes : list of dict
        Entries of the JSON.
    """

    def __init__(self) -> None:
        self.nodes: list[Json] = []
        self.roots: list[int] = []
        self._numbers: dict[NodePath, int] = {}
        self._placements: list[Placement] = []

    def add(self, name: str, mesh: int, placement: Placement) -> int:
        """Add a node with a mesh, and return its index; add shorter paths first.

        Parameters
        ----------
        name : str
            Name, or path of nodes if it starts with a slash.
        placement : Placement
            Placement of the mesh in the world, independent of its parents.
        """
        path = path_of(name)
        parent = self._parent(path)
        parent_placement = self._placements[parent] if parent is not None else IDENTITY
        node: Json = {"name": path[-1], "mesh": mesh}
        shift = (placement.offset - parent_placement.offset) / parent_placement.scale
        if shift.any():
            node["translation"] = shift.tolist()
        if placement.scale != parent_placement.scale:
            node["scale"] = [placement.scale / parent_placement.scale] * 3
        return self._append(path, node, placement, parent)

    def group(self, name: str) -> int:
        """Return the index of a root node without a mesh, added if it is missing."""
        parent = self._parent((name, ""))
        assert parent is not None
        return parent

    def _parent(self, path: NodePath) -> int | None:
        parent = None
        for end in range(1, len(path)):
            inherited = self._placements[parent] if parent is not None else IDENTITY
            if (number := self._numbers.get(path[:end])) is None:
                number = self._append(path[:end], {"name": path[end - 1]}, inherited, parent)
            parent = number
        return parent

    def _append(self, path: NodePath, node: Json, placement: Placement, parent: int | None) -> int:
        number = len(self.nodes)
        self.nodes.append(node)
        self._placements.append(placement)
        self._numbers.setdefault(path, number)
        siblings = self.roots if parent is None else self.nodes[parent].setdefault("children", [])
        siblings.append(number)
        return number


def path_of(name: str) -> NodePath:
    """Return the node names from the root to a mesh; a single one unless its name is a path."""
    elements = tuple(element for element in name.split("/") if element)
    return elements if name.startswith("/") and elements else (name or "mesh",)


class FileSize(NamedTuple):
    """Bytes of a file, and those that a server sends if it compresses the file with gzip."""

    stored: int
    gzipped: int


def write_document(path: Path, document: Json, buffer: BufferWriter, advice: str) -> FileSize:
    """Write a ``.glb`` file, or a ``.gltf`` file with the buffer as base64; return the size.

    Parameters
    ----------
    document : dict
        The JSON, without the buffer.
    advice : str
        Advice for the user if a ``.glb`` file is too large.

    Raises
    ------
    InvalidInputError
        If the file is too large for its format.
    """
    if path.suffix.lower() == ".gltf":
        data = base64.b64encode(b"".join(buffer.pieces)).decode("ascii")
        uri = f"data:application/octet-stream;base64,{data}"
        complete = document | {"buffers": buffer.buffers(uri=uri)}
        text = json.dumps(complete, ensure_ascii=False, indent=1).encode()
        return FileSize(len(text), _write([text], path))
    text = _text_of(document, buffer)
    size_bytes = _binary_size(text, buffer)
    if size_bytes > MAX_BYTES:
        raise InvalidInputError(
            f"the file would have {size_bytes} bytes; a .glb file can have at most "
            f"{MAX_BYTES}; {advice}"
        )
    head = HEADER.pack(MAGIC, VERSION, size_bytes) + CHUNK.pack(len(text), JSON_CHUNK) + text
    pieces = [head, CHUNK.pack(buffer.size_bytes, BINARY_CHUNK), *buffer.pieces]
    return FileSize(size_bytes, _write(pieces, path))


def document_bytes(document: Json, buffer: BufferWriter) -> int:
    """Return the size of a ``.glb`` file."""
    return _binary_size(_text_of(document, buffer), buffer)


def _text_of(document: Json, buffer: BufferWriter) -> bytes:
    complete = document | {"buffers": buffer.buffers()}
    text = json.dumps(complete, ensure_ascii=False, separators=(",", ":")).encode()
    return text + b" " * (-len(text) % 4)


def _binary_size(text: bytes, buffer: BufferWriter) -> int:
    return HEADER.size + CHUNK.size + len(text) + CHUNK.size + buffer.size_bytes


def _write(pieces: list[bytes], path: Path) -> int:
    """Write consecutive pieces of a file, and return its size after gzip."""
    gzip, n_gzipped = zlib.compressobj(wbits=GZIP_WINDOW), 0
    with path.open("wb") as file:
        for piece in pieces:
            file.write(piece)
            n_gzipped += len(gzip.compress(piece))
    return n_gzipped + len(gzip.flush())
