"""A parsed glTF file: JSON objects whose values are checked on access, and its lists."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.file_errors import os_errors_naming
from meshreel.formats.gltf.container import split_container

MAX_INTEGER = 1 << 53
"""Integers up to here are exact in every JSON reader."""


@dataclass(frozen=True, eq=False)
class JsonObject:
    """An object of a JSON file and its location.

    Parameters
    ----------
    values : dict
        Parsed values.
    place : str
        Location in the file, such as "accessor 3", with which messages start.
    """

    values: dict[str, Any]
    place: str

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def error(self, key: str, allowed: str) -> FormatError:
        """Return the error for a missing or invalid value of a key."""
        if key not in self.values:
            return FormatError(f"{self.place}: has no {key!r}; it must be {allowed}")
        value = repr(self.values[key])
        shortened = value if len(value) <= 60 else f"{value[:57]}..."
        return FormatError(f"{self.place}: {key!r} must be {allowed}; got {shortened}")

    def integer(self, key: str, default: int | None = None) -> int:
        """Return a nonnegative integer; without a default the key is required."""
        value = self.values.get(key, default)
        if isinstance(value, float) and value.is_integer():
            value = int(value)
        if value is None or not _is_integer(value):
            raise self.error(key, "an integer from 0 to 2^53")
        return int(value)

    def index(self, key: str, n_items: int) -> int | None:
        """Return an index below `n_items`; None if the key is missing."""
        if key not in self.values:
            return None
        value = self.integer(key)
        if value >= n_items:
            raise self.error(key, f"below {n_items}, the number of items")
        return value

    def indices(self, key: str, n_items: int) -> list[int]:
        """Return a list of indices below `n_items`; empty if the key is missing."""
        values = self.values.get(key, [])
        if not isinstance(values, list) or not all(_is_integer(value) for value in values):
            raise self.error(key, "a list of integers from 0 to 2^53")
        if any(value >= n_items for value in values):
            raise self.error(key, f"a list of indices below {n_items}, the number of items")
        return values

    def numbers(
        self, key: str, length: int, default: npt.ArrayLike | None = None
    ) -> npt.NDArray[np.float64]:
        """Return `length` finite numbers; without a default the key is required."""
        if key not in self.values and default is not None:
            return np.array(default, np.float64)
        values = self.values.get(key)
        if (
            not isinstance(values, list)
            or len(values) != length
            or not all(_is_finite(value) for value in values)
        ):
            raise self.error(key, f"a list of {length} finite numbers")
        return np.array(values, np.float64)

    def number(self, key: str, default: float) -> float:
        """Return a finite number; the default if the key is missing."""
        value = self.values.get(key, default)
        if not _is_finite(value):
            raise self.error(key, "a finite number")
        return float(value)

    def flag(self, key: str) -> bool:
        """Return a boolean; false if the key is missing."""
        value = self.values.get(key, False)
        if not isinstance(value, bool):
            raise self.error(key, "true or false")
        return value

    def text(self, key: str, default: str | None = None) -> str:
        """Return a string; without a default the key is required."""
        value = self.values.get(key, default)
        if not isinstance(value, str):
            raise self.error(key, "text")
        return value

    def texts(self, key: str) -> list[str]:
        """Return a list of strings; empty if the key is missing."""
        values = self.values.get(key, [])
        if not isinstance(values, list) or not all(isinstance(value, str) for value in values):
            raise self.error(key, "a list of text")
        return values

    def child(self, key: str) -> "JsonObject | None":
        """Return a child object; None if the key is missing."""
        if key not in self.values:
            return None
        value = self.values[key]
        if not isinstance(value, dict):
            raise self.error(key, "an object")
        return JsonObject(value, f"{self.place}, {key}")

    def required_child(self, key: str) -> "JsonObject":
        """Return a child object, which is required."""
        child = self.child(key)
        if child is None:
            raise self.error(key, "an object")
        return child

    def children(self, key: str, item_name: str) -> tuple["JsonObject", ...]:
        """Return the objects of a list; empty if the key is missing.

        Parameters
        ----------
        key : str
        item_name : str
            Name of an item in messages, such as "primitive".
        """
        values = self.values.get(key, [])
        if not isinstance(values, list) or not all(isinstance(value, dict) for value in values):
            raise self.error(key, "a list of objects")
        prefix = f"{self.place}, " if self.place else ""
        return tuple(
            JsonObject(value, f"{prefix}{item_name} {number}")
            for number, value in enumerate(values)
        )

    def extension(self, name: str) -> "JsonObject | None":
        """Return the object of an extension; None if this object does not have it."""
        extensions = self.child("extensions")
        return None if extensions is None else extensions.child(name)


def _is_integer(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= MAX_INTEGER


def _is_finite(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= MAX_INTEGER if isinstance(value, int) else math.isfinite(value)


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

DRACO = "KHR_draco_mesh_compression"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
INSTANCING = "EXT_mesh_gpu_instancing"
SUPPORTED_EXTENSIONS = frozenset(
    {
        DRACO,
        INSTANCING,
        "KHR_mesh_quantization",
        "KHR_node_visibility",
        "KHR_animation_pointer",
        *MESHOPT,
    }
)
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


@dataclass(frozen=True, eq=False)
class Document:
    """A parsed glTF file.

    Attributes
    ----------
    folder : Path
        Folder of the file, to which URIs are relative.
    size_bytes : int
        Size of the file.
    root : JsonObject
    lists : dict of tuples of JsonObject
        By name, as in `LISTS`.
    binary : memoryview, optional
        The binary chunk of a GLB file.
    allow_outside : bool
        Whether files outside of the folder may be read.
    """

    folder: Path
    size_bytes: int
    root: JsonObject
    lists: dict[str, tuple[JsonObject, ...]]
    binary: memoryview | None
    allow_outside: bool = False

    def index(self, parent: JsonObject, key: str, kind: str) -> int | None:
        """Return the list index to which an object refers; None if the key is missing."""
        return parent.index(key, len(self.lists[kind]))

    def item(self, parent: JsonObject, key: str, kind: str) -> JsonObject:
        """Return the list item to which an object refers; the key is required."""
        index = self.index(parent, key, kind)
        if index is None:
            raise parent.error(key, f"the index of a {LISTS[kind]}")
        return self.lists[kind][index]


def read_document(path: Path, *, allow_outside: bool = False) -> Document:
    """Return the parsed glTF file at a path, `.gltf` or `.glb`, without reading other files.

    Parameters
    ----------
    path : Path
    allow_outside : bool
        Whether it may refer to files outside of its folder.

    Raises
    ------
    FormatError
        If it is damaged, not glTF 2.0, or requires an unsupported extension.
    InvalidInputError
        If it cannot be read.
    """
    with os_errors_naming(path):
        data = path.read_bytes()
    parsed, binary = split_container(data)
    if not isinstance(parsed, dict):
        raise FormatError("is not a glTF file: its JSON is not an object")
    root = JsonObject(parsed, "the file")
    _check_version(root)
    _check_extensions(root)
    unnamed_root = JsonObject(parsed, "")
    lists = {kind: unnamed_root.children(kind, name) for kind, name in LISTS.items()}
    return Document(path.parent, len(data), root, lists, binary, allow_outside)


def _check_version(root: JsonObject) -> None:
    if "asset" not in root and isinstance(root.values.get("meshes"), dict):  # a list since 2.0
        raise FormatError(f"is glTF 1.0 or older; {ADVICE}")
    asset = root.required_child("asset")
    number = asset.values.get("version")
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
    required = root.texts("extensionsRequired")
    unknown = [
        name
        for name in required
        if name not in SUPPORTED_EXTENSIONS and not name.startswith(APPEARANCE_PREFIXES)
    ]
    if unknown:
        raise FormatError(
            f"requires the unsupported extension {', '.join(unknown)}; export it without"
        )
