"""A glTF file whose JSON is parsed, with its lists of things and its binary data."""

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
"""Lists of the file that are read, and what one of their items is called."""

DRACO = "KHR_draco_mesh_compression"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
INSTANCING = "EXT_mesh_gpu_instancing"
HEEDED = frozenset({DRACO, INSTANCING, "KHR_mesh_quantization", *MESHOPT})
LOOKS = (
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "MSFT_texture_",
    "KHR_lights_",
    "KHR_xmp",
)
"""Extensions that begin so say how a surface looks, and nothing about where it is."""

READ = "glTF 2.0 is read"
REMEDY = f"{READ}; convert it (gltf-pipeline)"


@dataclass(frozen=True, eq=False)
class Document:
    """A glTF file whose JSON is parsed.

    Attributes
    ----------
    folder : Path
        Where the file lies; other files are named relative to it.
    size_bytes : int
        Of the file.
    lists : dict of tuples of JsonObject
        By their names in the file, as in `LISTS`.
    binary : memoryview, optional
        The binary chunk of a GLB file.
    allow_outside : bool
        Whether files may be read that are outside of the folder.
    """

    folder: Path
    size_bytes: int
    root: JsonObject
    lists: dict[str, tuple[JsonObject, ...]]
    binary: memoryview | None
    allow_outside: bool = False

    def index(self, holder: JsonObject, key: str, kind: str) -> int | None:
        """The number of an item of a list that an object names; None if it names none."""
        return holder.index(key, len(self.lists[kind]))

    def item(self, holder: JsonObject, key: str, kind: str) -> JsonObject:
        """The item of a list that an object must name."""
        index = self.index(holder, key, kind)
        if index is None:
            raise holder.error(key, f"the number of {LISTS[kind]}")
        return self.lists[kind][index]


def read_document(path: Path, *, allow_outside: bool = False) -> Document:
    """The glTF file at a path, `.gltf` or `.glb`; other files that it names are not read yet.

    They must be in its folder or below, unless others are allowed.

    Raises
    ------
    FormatError
        If it is damaged, no glTF 2.0, or requires an extension that is not read.
    InvalidInputError
        If it cannot be read.
    """
    with os_errors_naming(path):
        data = path.read_bytes()
    parsed, binary = split_container(data)
    if not isinstance(parsed, dict):
        raise FormatError("is no glTF file: its JSON is no object")
    root = JsonObject(parsed, "the file")
    _check_version(root)
    _check_extensions(root)
    nameless = JsonObject(parsed, "")
    lists = {kind: nameless.children(kind, called) for kind, called in LISTS.items()}
    return Document(path.parent, len(data), root, lists, binary, allow_outside)


def _check_version(root: JsonObject) -> None:
    if "asset" not in root and isinstance(root.values.get("meshes"), dict):  # lists since 2.0
        raise FormatError(f"is glTF 1.0 or older; {REMEDY}")
    asset = root.needed("asset")
    number = asset.values.get("version")
    if isinstance(number, int | float) and 0 < number < 2:  # text since 2.0
        raise FormatError(f"is glTF {float(number)}; {REMEDY}")
    version = asset.text("minVersion", asset.text("version"))
    if not version:
        raise FormatError(
            f"does not say which glTF it is: the version of its asset is ''; {READ}; write "
            '"version": "2.0" there if it is that'
        )
    if version != "2.0":
        raise FormatError(f"is glTF {version!r}; {REMEDY}")


def _check_extensions(root: JsonObject) -> None:
    required = root.texts("extensionsRequired")
    unknown = [name for name in required if name not in HEEDED and not name.startswith(LOOKS)]
    if unknown:
        raise FormatError(
            f"requires the extension {', '.join(unknown)}, which is not read; export it without"
        )
