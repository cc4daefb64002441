"""A parsed glTF file: JSON objects that are checked on access, and the arrays they describe.

The JSON is parsed with the standard library and validated here, since libraries for glTF do not
validate indices and sizes, and files may come from anywhere.
"""

import base64
import binascii
import math
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.file_errors import os_errors_naming, read_bytes
from meshreel.formats.file_references import MAX_REFERENCE, resolve_reference
from meshreel.formats.gltf.container import split_container
from meshreel.formats.gltf.meshopt import READ_EXTENSIONS, decode_view
from meshreel.formats.options import Reading

LISTS = {
    "accessors": "accessor",
    "animations": "animation",
    "buffers": "buffer",
    "bufferViews": "buffer view",
    "images": "image",
    "materials": "material",
    "meshes": "mesh",
    "nodes": "node",
    "samplers": "sampler",
    "scenes": "scene",
    "skins": "skin",
    "textures": "texture",
}
"""Lists of the file that are read, and the name of their items in messages."""

ROOT = "the file"
"""Location of the object that contains all others."""

DRACO = "KHR_draco_mesh_compression"
VISIBILITY, POINTER = "KHR_node_visibility", "KHR_animation_pointer"
SUPPORTED_EXTENSIONS = {
    "KHR_mesh_quantization",
    DRACO,
    POINTER,
    VISIBILITY,
    *READ_EXTENSIONS,
}
APPEARANCE_PREFIXES = (
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "MSFT_texture_",
    "KHR_lights_",
    "KHR_xmp",
)
"""Prefixes of extensions that affect only appearance, so that they can be ignored."""

SUPPORTED = "only glTF 2.0 is supported"
ADVICE = f"{SUPPORTED}; convert it (gltf-pipeline)"

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}

TRIANGLES, STRIP, FAN = 4, 5, 6
N_MODES = 7
"""Modes of primitives; lower ones are points and lines."""

MAX_INTEGER = 1 << 53
"""Integers up to here are exact in every JSON reader."""

MIN_EXPANDED_BYTES, MIN_DECOMPRESSED_BYTES = 1 << 26, 1 << 30
MAX_EXPANSION = 32
"""Arrays may need this many times the bytes of the file and of its decompressed views, or
`MIN_EXPANDED_BYTES` if that is more: a small file must not fill the memory with arrays that share
bytes or have none. Decompression may need `MIN_DECOMPRESSED_BYTES`, since values that do not change
take hardly any."""

DATA_URI = re.compile(r"data:([^,;]{0,100})(?:;[^,]{0,200})?;base64,", re.IGNORECASE)

NOT_RELATIVE = re.compile(r"[a-z][a-z0-9+.-]*:|//", re.IGNORECASE)
"""Start of a URI with a scheme or a host, to which nothing must connect."""


@dataclass(frozen=True, eq=False)
class JsonObject:
    """An object of a JSON file and its location."""

    values: dict[str, Any]
    """Parsed values."""
    place: str
    """Location in the file, such as "accessor 3", with which messages start."""
    lists: Mapping[str, tuple["JsonObject", ...]] = field(default_factory=dict)
    """The lists of the file to which indices refer, by name."""
    read_keys: set[tuple[int, str]] = field(default_factory=set)
    """Identities of the values of all objects of the file, with the keys that were read."""

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def get(self, key: str, default: Any = None) -> Any:
        """Return an unchecked value, which counts as read."""
        if key in self.values:
            self.read_keys.add((id(self.values), key))
        return self.values.get(key, default)

    def dismiss(self) -> None:
        """Count everything in the object as read, when a note names it as a whole."""
        for key in self.values:
            value = self.get(key)
            for inner in value if isinstance(value, list) else [value]:
                if isinstance(inner, dict):
                    replace(self, values=inner).dismiss()

    def error(self, key: str, allowed: str) -> FormatError:
        """Return the error for a missing or invalid value of a key."""
        if key not in self.values:
            return FormatError(f"{self.place}: has no {key!r}; it must be {allowed}")
        value = repr(self.values[key])
        shortened = value if len(value) <= 60 else f"{value[:57]}..."
        return FormatError(f"{self.place}: {key!r} must be {allowed}; got {shortened}")

    def integer(self, key: str, default: int | None = None) -> int:
        """Return a nonnegative integer; without a default the key is required."""
        value = self.get(key, default)
        if isinstance(value, float) and value.is_integer():
            value = int(value)
        if value is None or not _is_integer(value):
            raise self.error(key, "an integer from 0 to 2^53")
        return int(value)

    def index(self, key: str, items: str | int) -> int | None:
        """Return an index into a list of the file, or below a number; None if it is missing."""
        if key not in self.values:
            return None
        value = self.integer(key)
        if value >= (n_items := self._count(items)):
            raise self.error(key, f"below {n_items}, the number of items")
        return value

    def item(self, key: str, kind: str) -> "JsonObject":
        """Return the item of a list of the file to which a key, which is required, refers."""
        index = self.index(key, kind)
        if index is None:
            raise self.error(key, f"the index of a {LISTS[kind]}")
        return self.lists[kind][index]

    def indices(self, key: str, items: str | int) -> list[int]:
        """Return indices as `index`; an empty list if the key is missing."""
        values = self._list(key, _is_integer, "a list of integers from 0 to 2^53")
        if any(value >= self._count(items) for value in values):
            n_items = self._count(items)
            raise self.error(key, f"a list of indices below {n_items}, the number of items")
        return values

    def numbers(
        self, key: str, length: int, default: npt.ArrayLike | None = None
    ) -> npt.NDArray[np.float64]:
        """Return `length` finite numbers; without a default the key is required."""
        if key not in self.values and default is not None:
            return np.array(default, np.float64)
        allowed = f"a list of {length} finite numbers"
        values = self._list(key, _is_finite, allowed)
        if key not in self.values or len(values) != length:
            raise self.error(key, allowed)
        return np.array(values, np.float64)

    def vectors(self, **defaults: Sequence[float]) -> dict[str, npt.NDArray[np.float64]]:
        """Return lists of finite numbers by key, with the lengths of their defaults."""
        return {key: self.numbers(key, len(default), default) for key, default in defaults.items()}

    def number(self, key: str, default: float) -> float:
        """Return a finite number; the default if the key is missing."""
        value = self.get(key, default)
        if not _is_finite(value):
            raise self.error(key, "a finite number")
        return float(value)

    def flag(self, key: str) -> bool:
        """Return a boolean; false if the key is missing."""
        value = self.get(key, False)
        if not isinstance(value, bool):
            raise self.error(key, "true or false")
        return value

    def text(self, key: str, default: str | None = None) -> str:
        """Return a string; without a default the key is required."""
        value = self.get(key, default)
        if not isinstance(value, str):
            raise self.error(key, "text")
        return value

    def texts(self, key: str) -> list[str]:
        """Return a list of strings; empty if the key is missing."""
        return self._list(key, lambda value: isinstance(value, str), "a list of text")

    def child(self, key: str) -> "JsonObject | None":
        """Return a child object; None if the key is missing."""
        return self.required_child(key) if key in self.values else None

    def required_child(self, key: str) -> "JsonObject":
        """Return a child object, which is required."""
        value = self.get(key)
        if not isinstance(value, dict):
            raise self.error(key, "an object")
        return replace(self, values=value, place=f"{self.place}, {key}")

    def children(self, key: str, item_name: str) -> tuple["JsonObject", ...]:
        """Return the objects of a list; empty if the key is missing.

        Parameters
        ----------
        item_name : str
            Name of an item in messages, such as "primitive".
        """
        values = self._list(key, lambda value: isinstance(value, dict), "a list of objects")
        prefix = f"{self.place}, " if self.place else ""
        return tuple(
            replace(self, values=value, place=f"{prefix}{item_name} {number}")
            for number, value in enumerate(values)
        )

    def extension(self, name: str) -> "JsonObject | None":
        """Return the object of an extension; None if this object does not have it."""
        extensions = self.child("extensions")
        return None if extensions is None else extensions.child(name)

    def label(self) -> str:
        """Return the name of the object, or its location if it has none."""
        return self.text("name", "") or self.place

    def _list(self, key: str, is_valid: Callable[[Any], bool], allowed: str) -> list[Any]:
        values = self.get(key, [])
        if not isinstance(values, list) or not all(map(is_valid, values)):
            raise self.error(key, allowed)
        return values

    def _count(self, items: str | int) -> int:
        return items if isinstance(items, int) else len(self.lists[items])


def _is_integer(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= MAX_INTEGER


def _is_finite(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= MAX_INTEGER if isinstance(value, int) else math.isfinite(value)


@dataclass(frozen=True, eq=False)
class Primitive:
    """Triangles of a mesh, with positions."""

    json: JsonObject
    attributes: JsonObject
    """The accessor of each attribute."""
    mode: int
    """How corners form triangles, one of `TRIANGLES`, `STRIP` and `FAN`."""

    @cached_property
    def material(self) -> int | None:
        """Index of the material."""
        return self.json.index("material", "materials")

    @cached_property
    def targets(self) -> tuple[JsonObject, ...]:
        """The accessors of each morph target."""
        return self.json.children("targets", "target")


@dataclass(frozen=True, eq=False)
class Mesh:
    """A mesh of the file, without its values."""

    json: JsonObject
    others: Counter[str]
    """Number of other primitives by kind."""
    triangles: tuple[Primitive, ...]
    """The primitives that consist of triangles and have positions."""
    names: frozenset[str]
    """Names of their attributes."""

    @property
    def has_joints(self) -> bool:
        """Whether the mesh can be skinned."""
        joints = {"JOINTS_0", "WEIGHTS_0"}
        return any(joints <= triangles.attributes.values.keys() for triangles in self.triangles)

    @cached_property
    def n_targets(self) -> int:
        """The number of morph targets; raises `FormatError` if primitives differ in it."""
        counts = {len(triangles.targets) for triangles in self.triangles}
        if len(counts) > 1:
            raise FormatError(
                f"{self.json.place}: its primitives have {' or '.join(map(str, sorted(counts)))} "
                "morph targets; expected the same number in all"
            )
        return counts.pop() if counts else 0


@dataclass(frozen=True, eq=False)
class Values:
    """The values of an accessor."""

    array: npt.NDArray[Any]
    """Array of shape (N, C). In the component type of the file."""
    is_normalized: bool = False
    """Whether integers represent -1 to 1, or 0 to 1 if unsigned."""

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


class Document:
    """A glTF file, `.gltf` or `.glb`; its buffers and images are read on demand.

    Parameters
    ----------
    reading : Reading, optional
        Whether it may refer to files outside of its folder. Default: it may not.

    Attributes
    ----------
    lists : dict of tuples of JsonObject
        By name, as in `LISTS`.

    Raises
    ------
    FormatError
        If it is damaged, not glTF 2.0, or requires an unsupported extension.
    InvalidInputError
        If it cannot be read.
    """

    def __init__(self, path: Path, reading: Reading | None = None) -> None:
        data = read_bytes(path)
        parsed, self._binary = split_container(data)
        if not isinstance(parsed, dict):
            raise FormatError("is not a glTF file: its JSON is not an object")
        self.lists: dict[str, tuple[JsonObject, ...]] = {}
        self.root: JsonObject = JsonObject(parsed, ROOT, self.lists)
        _check_version(self.root)
        _check_extensions(self.root)
        unnamed_root = replace(self.root, place="")
        self.lists.update((kind, unnamed_root.children(kind, name)) for kind, name in LISTS.items())
        self._path, self._options = path, reading or Reading()
        self._available_bytes, self._reserved_bytes = len(data), 0
        self._buffers: dict[str, memoryview] = {}
        self._decompressed: dict[str, memoryview] = {}
        self._meshes: dict[JsonObject, Mesh] = {}

    def mesh(self, json: JsonObject) -> Mesh:
        """Return the primitives of a mesh of the file, which are read once."""
        if json not in self._meshes:
            triangles, others = list[Primitive](), Counter[str]()
            for primitive in json.children("primitives", "primitive"):
                mode = primitive.index("mode", N_MODES)
                attributes = primitive.required_child("attributes")
                mode = TRIANGLES if mode is None else mode
                if mode >= TRIANGLES and "POSITION" in attributes:
                    triangles.append(Primitive(primitive, attributes, mode))
                    continue
                is_line = mode < TRIANGLES
                others["points and lines" if is_line else "primitives without positions"] += 1
                primitive.dismiss()
            names = frozenset().union(*[primitive.attributes.values for primitive in triangles])
            self._meshes[json] = Mesh(json, others, tuple(triangles), names)
        return self._meshes[json]

    def read(self, parent: JsonObject, key: str, *kinds: str, count: int | None = None) -> Values:
        """Return the values of an accessor that an object refers to.

        Parameters
        ----------
        key : str
            Key of the accessor index.
        *kinds : str
            Allowed accessor types, such as "SCALAR" and "VEC3".
        count : int, optional
            Required number of elements; by default any positive number.
        """
        accessor = parent.item(key, "accessors")
        dtype, width = declared_type(accessor, kinds)
        n_elements = accessor.integer("count")
        if n_elements == 0 or n_elements != (count or n_elements):
            raise accessor.error("count", f"{count or 'at least 1'}, as {parent.place} requires")
        is_stored = accessor.index("bufferView", "bufferViews") is not None
        elements = self._elements(accessor, dtype, n_elements, width) if is_stored else None
        self.reserve(n_elements * width * dtype.itemsize, accessor.place)
        array = np.zeros((n_elements, width), dtype) if elements is None else elements.copy()
        if (sparse := accessor.child("sparse")) is not None:
            self._overwrite(array, sparse)
        return Values(array, accessor.flag("normalized"))

    def read_floats(
        self, parent: JsonObject, key: str, *kinds: str, count: int | None = None
    ) -> npt.NDArray[np.float64]:
        """Return the numbers of an accessor as float64; arguments as `read`."""
        values = self.read(parent, key, *kinds, count=count)
        self.reserve(values.array.size * np.float64().itemsize, parent.place)
        numbers = values.floats().astype(np.float64)
        if not np.isfinite(numbers).all():
            raise FormatError(f"{parent.place}: the numbers of {key!r} must be finite")
        return numbers

    def read_named(
        self,
        parent: JsonObject,
        kinds: Mapping[str, tuple[str, ...]],
        decoded_values: Mapping[str, Values],
        *,
        count: int,
    ) -> dict[str, Values]:
        """Return the values of the accessors with these keys and types, unless they are decoded."""
        return {
            key: decoded_values[key]
            if key in decoded_values
            else self.read(parent, key, *kinds[key], count=count)
            for key in parent.values
            if key in kinds
        }

    def read_each(
        self, parents: Sequence[JsonObject], key: str, kind: str, *, count: int
    ) -> tuple[npt.NDArray[Any] | None, ...]:
        """Return the numbers of an accessor of each object; None if it has none.

        An accessor is read once, since millions of objects may share it.
        """
        arrays: dict[int | None, npt.NDArray[Any] | None] = {None: None}
        indices = [parent.index(key, "accessors") for parent in parents]
        for parent, index in zip(parents, indices, strict=True):
            if index not in arrays:
                arrays[index] = self.read(parent, key, kind, count=count).floats()
        return tuple(arrays[index] for index in indices)

    def view(self, parent: JsonObject) -> tuple[memoryview, int]:
        """Return the decompressed bytes of a buffer view, and its stride, or 0 without one."""
        view = parent.item("bufferView", "bufferViews")
        stride = view.integer("byteStride", 0)
        compressed = next(filter(None, map(view.extension, READ_EXTENSIONS)), None)
        if compressed is None:
            return self._buffer_bytes(view), stride
        if view.place not in self._decompressed:
            size = view.integer("byteLength")
            if compressed.integer("count") * compressed.integer("byteStride") != size:
                raise FormatError(
                    f"{compressed.place}: its 'count' times its 'byteStride' must be the {size} "
                    f"bytes of {view.place}"
                )
            data = bytes(self._buffer_bytes(compressed))
            self.reserve(size, compressed.place, MIN_DECOMPRESSED_BYTES)
            count, stride_bytes = compressed.integer("count"), compressed.integer("byteStride")
            mode, kind = compressed.text("mode"), compressed.text("filter", "NONE")
            try:
                decoded = decode_view(data, count, stride_bytes, mode, kind)
            except FormatError as error:
                raise FormatError(
                    f"{compressed.place}: meshopt cannot decode it ({error})"
                ) from None
            self._decompressed[view.place] = memoryview(decoded.tobytes())
            self._available_bytes += size
        return self._decompressed[view.place], stride

    def reserve(self, size_bytes: int, place: str, min_bytes: int = 0) -> None:
        """Count bytes before they are allocated, and reject far more than the file has."""
        min_bytes = max(min_bytes, MIN_EXPANDED_BYTES)
        reserved_bytes = self._reserved_bytes + size_bytes
        if reserved_bytes > max(min_bytes, MAX_EXPANSION * self._available_bytes):
            raise FormatError(
                f"{place}: the arrays of the file would need more than {MAX_EXPANSION} times its "
                f"size, and more than {min_bytes >> 20} MiB"
            )
        self._reserved_bytes = reserved_bytes

    def read_uri(self, json: JsonObject, size: int | None = None) -> tuple[bytes, str, str]:
        """Return data, media type, and file name of the URI of a buffer or an image.

        Parameters
        ----------
        size : int, optional
            Number of bytes to read; by default all.

        Returns
        -------
        tuple of bytes, str, str
            The type is empty if the data are in a file, the name if they are in the URI.
        """
        uri = json.text("uri")
        if match := DATA_URI.match(uri):
            try:
                return base64.b64decode(uri[match.end() :]), match[1].lower(), ""
            except (binascii.Error, ValueError) as error:
                raise FormatError(
                    f"{json.place}: its data are not valid base64 ({error})"
                ) from None
        name = unquote(uri) if len(uri) <= 3 * MAX_REFERENCE else ""
        if NOT_RELATIVE.match(name) or "\\" in name or "\0" in name or not name:
            raise FormatError(
                f"{json.place}: refers to {uri[:200]!r}; only files in the folder of the glTF file "
                "or below are supported; move the file there"
            )
        try:
            path = resolve_reference(self._path, name, self._options)
        except FormatError as error:
            raise FormatError(f"{json.place}: {error}") from None
        with os_errors_naming(path), path.open("rb") as file:
            return file.read() if size is None else file.read(size), "", path.name

    def _buffer_bytes(self, parent: JsonObject) -> memoryview:
        """Return the bytes in a buffer to which a view or its compression extension refers."""
        buffer = parent.item("buffer", "buffers")
        start, length = parent.integer("byteOffset", 0), parent.integer("byteLength")
        size = buffer.integer("byteLength")
        if start + length > size:
            raise FormatError(
                f"{parent.place}: bytes {start}..{start + length} exceed {buffer.place}, "
                f"which has {size} bytes"
            )
        if buffer.place not in self._buffers:
            self._buffers[buffer.place] = data = self._read_buffer(buffer, size)
            self._available_bytes += len(data)
        return self._buffers[buffer.place][start : start + length]

    def _read_buffer(self, buffer: JsonObject, size: int) -> memoryview:
        if "uri" in buffer:
            data = memoryview(self.read_uri(buffer, size)[0])
        elif buffer is self.lists["buffers"][0] and self._binary is not None:
            data = self._binary
        elif extension := next((name for name in READ_EXTENSIONS if buffer.extension(name)), None):
            raise FormatError(
                f"{buffer.place}: is the fallback of {extension} without data; its buffer views "
                "must have that extension too"
            )
        else:
            raise FormatError(f"{buffer.place}: has neither 'uri' nor a binary chunk")
        if len(data) < size:
            raise FormatError(f"{buffer.place}: has {len(data)} of the declared {size} bytes")
        return data[:size]

    def _elements(
        self, accessor: JsonObject, dtype: np.dtype[Any], count: int, width: int
    ) -> npt.NDArray[Any]:
        """Return a view of the elements of an accessor, or of a part of a sparse one."""
        data, stride = self.view(accessor)
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
        """Replace the elements that a sparse accessor stores."""
        count = sparse.integer("count")
        indices, values = sparse.required_child("indices"), sparse.required_child("values")
        rows = self._elements(indices, _component_type(indices, "u"), count, 1)[:, 0]
        if count and int(rows.max()) >= len(array):
            raise FormatError(
                f"{indices.place}: refers to element {int(rows.max())}; there are {len(array)}"
            )
        array[rows] = self._elements(values, array.dtype, count, array.shape[1])


def declared_type(accessor: JsonObject, kinds: tuple[str, ...]) -> tuple[np.dtype[Any], int]:
    """Return component type and components per element of an accessor of one of these types."""
    kind = accessor.text("type")
    if kind not in kinds:
        raise accessor.error("type", f"{' or '.join(kinds)}")
    return _component_type(accessor, "iuf"), WIDTHS[kind]


def _component_type(accessor: JsonObject, kinds: str) -> np.dtype[Any]:
    """Return the component type of an object, which must be one of these NumPy kinds."""
    code = accessor.integer("componentType")
    allowed = {code: name for code, name in COMPONENTS.items() if np.dtype(name).kind in kinds}
    if code not in allowed:
        raise accessor.error("componentType", f"one of {', '.join(map(str, allowed))}")
    return np.dtype(allowed[code])


GENERATOR = "meshreel"
"""Generator of the assets that we write."""


def _check_version(root: JsonObject) -> None:
    if "asset" not in root and isinstance(root.values.get("meshes"), dict):  # a list since 2.0
        raise FormatError(f"is glTF 1.0 or older; {ADVICE}")
    asset = root.required_child("asset")
    number = asset.get("version")
    if isinstance(number, int | float) and 0 < number < 2:  # a string since 2.0
        raise FormatError(f"is glTF {float(number)}; {ADVICE}")
    version = asset.text("minVersion", asset.text("version"))
    if not version:
        raise FormatError(
            f"does not declare its glTF version: the version of its asset is ''; {SUPPORTED}; set "
            '"version": "2.0" if it is that version'
        )
    if version != "2.0":
        raise FormatError(f"is glTF {version!r}; {ADVICE}")


def _check_extensions(root: JsonObject) -> None:
    unknown = [
        name
        for name in root.texts("extensionsRequired")
        if name not in SUPPORTED_EXTENSIONS and not name.startswith(APPEARANCE_PREFIXES)
    ]
    if unknown:
        raise FormatError(
            f"requires the unsupported extension {', '.join(unknown)}; export it without"
        )


def unique_names(names: list[str]) -> list[str]:
    """Return the names, with a number appended to repeated ones."""
    used, counts = set(names), dict.fromkeys(names, 0)
    unique = []
    for name in names:
        candidate = name
        while counts[name] and (candidate := f"{name}_{counts[name]}") in used:
            counts[name] += 1
        counts[name] += 1
        used.add(candidate)
        unique.append(candidate)
    return unique
