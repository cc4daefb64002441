"""A parsed glTF file: its JSON lists and binary chunk."""

from dataclasses import dataclass
from pathlib import Path

from meshreel.errors import FormatError
from meshreel.formats.file_errors import os_errors_naming
from meshreel.formats.gltf.container import split_container
from meshreel.formats.gltf.json_object import JsonObject

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
