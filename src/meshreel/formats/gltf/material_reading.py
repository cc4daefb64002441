"""Reading materials of a glTF file with their images, with notes on unsupported properties."""

import base64
import binascii
import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache, cached_property
from pathlib import PurePosixPath
from urllib.parse import unquote

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.file_errors import os_errors_naming
from meshreel.formats.gltf.buffers import (
    MAX_EXPANSION,
    MIN_EXPANDED_BYTES,
    Buffers,
    referenced_file,
)
from meshreel.formats.gltf.document import Document
from meshreel.formats.gltf.json_object import JsonObject
from meshreel.formats.gltf.material_values import (
    SPECULAR_GLOSSINESS,
    SPECULAR_TEXTURE,
    STRENGTH,
    UNLIT,
    read_look,
    read_texture,
    specular_glossiness,
    with_sampler,
)
from meshreel.formats.gltf.nodes import unique_names
from meshreel.formats.gltf.primitives import triangle_primitives
from meshreel.formats.notes import NoteKind, list_in_note, listed, note_kinds, note_left_out
from meshreel.formats.surfaces.images import UNKNOWN, image_type
from meshreel.model.materials import DEFAULT_MATERIAL, Image, Material, Texture, select_materials

VARIANTS = "KHR_materials_variants"
SUPPORTED_EXTENSIONS = {UNLIT, STRENGTH}

LIT_TEXTURES = {
    "normal": ("normalTexture", "rgb"),
    "occlusion": ("occlusionTexture", "r"),
    "emissive": ("emissiveTexture", "rgb"),
}
DIFFUSE_TEXTURES = {"base_color": ("diffuseTexture", "rgba")}
PBR_TEXTURES = {
    "base_color": ("baseColorTexture", "rgba"),
    "metallic": ("metallicRoughnessTexture", "b"),
    "roughness": ("metallicRoughnessTexture", "g"),
}
"""Texture keys of each slot, and the image channels that apply."""
DROPPED_TEXTURE = "specular-glossiness textures, replaced by metalness 0 and half the glossiness"

DATA_URI = re.compile(r"data:([^,;]{0,100})(?:;[^,]{0,200})?;base64,", re.IGNORECASE)

IMAGE_EXTENSIONS = {
    "EXT_texture_webp": "image/webp",
    "EXT_texture_avif": "image/avif",
    "KHR_texture_basisu": "image/ktx2",
    "MSFT_texture_dds": "image/vnd-ms.dds",
}
"""Extensions with images of types other than PNG and JPEG, and their media types."""

CONVERTED = "converted from specular-glossiness to metallic-roughness"
"""Subject of the note on materials of an older extension."""


class MaterialReader:
    """The materials of a file and their images, read on demand.

    Parameters
    ----------
    document : Document
    buffers : Buffers
    notes : list of str
        Gains a sentence for each material or image that is left out as invalid or missing.
    """

    def __init__(self, document: Document, buffers: Buffers, notes: list[str]) -> None:
        self._document, self._buffers = document, buffers
        self._notes = notes
        self._n_bytes = 0
        self._image_indices: dict[str, int] = {}
        self._images: list[Image] = []
        self._read = cache(self._read_material)
        self._image = cache(self._read_image)

    @cached_property
    def labels(self) -> list[str]:
        """Unique names of the materials; empty for one without name and properties."""
        names = [one.text("name", "") for one in self._document.lists["materials"]]
        # A single unnamed material with default values carries no information; several do, since
        # they group the faces.
        has_labels = names.count("") > 1 or self._has_unnamed_look(names)
        named = [name or f"material_{i}" for i, name in enumerate(names) if name or has_labels]
        unique = iter(unique_names(named))
        return [next(unique) if name or has_labels else "" for name in names]

    def look(self, numbers: Iterable[int]) -> tuple[tuple[Material, ...], tuple[Image, ...]]:
        """Return the materials of these indices that have labels, and the images they use."""
        materials = {number: self._read(number) for number in numbers}
        named = [
            replace(one, name=self.labels[number])
            for number, one in materials.items()
            if one is not None and self.labels[number]
        ]
        return select_materials([one.name for one in named], named, self._images)

    def _has_unnamed_look(self, names: Sequence[str]) -> bool:
        if "" not in names:
            return False
        look = self._read(names.index(""))
        return look not in (None, Material(""), DEFAULT_MATERIAL)

    def _read_material(self, number: int) -> Material | None:
        material = self._document.lists["materials"][number]
        try:
            return self._with_textures(read_look(material), material)
        except FormatError as error:
            note_kinds(self._notes, "appearance of materials", [str(error)])
            return None

    def _with_textures(self, look: Material, material: JsonObject) -> Material:
        pbr, specular = material.child("pbrMetallicRoughness"), specular_glossiness(material)
        if specular is not None:
            name = material.text("name", "") or material.place
            list_in_note(self._notes, NoteKind.CHANGED, CONVERTED, [name])
            if SPECULAR_TEXTURE in specular:
                note_kinds(self._notes, DROPPED_TEXTURE, [name])
        textures = {}
        for parent, keys in (
            (pbr, PBR_TEXTURES), (specular, DIFFUSE_TEXTURES), (material, LIT_TEXTURES),
        ):  # fmt: skip
            for slot, (key, channels) in keys.items():
                info = None if parent is None else parent.child(key)
                if info is not None and (texture := self._texture(info, channels)) is not None:
                    textures[slot] = texture
        return look.with_textures(textures)

    def _texture(self, info: JsonObject, channels: str) -> Texture | None:
        """Return a texture, whose image is read if necessary; None if the image is unreadable."""
        lists = self._document.lists
        declared = self._document.item(info, "index", "textures")
        sampler = self._document.index(declared, "sampler", "samplers")
        image = self._image(image_index(declared, len(lists["images"])))
        if image is None:
            return None
        texture = read_texture(info, image, channels)
        return texture if sampler is None else with_sampler(texture, lists["samplers"][sampler])

    def _read_image(self, number: int) -> int | None:
        """Return the index of an image among those read so far, after reading it if necessary."""
        image = self._document.lists["images"][number]
        source = repr((image.values.get("bufferView"), image.values.get("uri")))
        if source not in self._image_indices:
            try:
                self._images.append(self._check_size(read_image(image, self._buffers), image))
            except (FormatError, InvalidInputError) as error:
                note_kinds(self._notes, "texture images", [str(error)])
                return None
            self._image_indices[source] = len(self._images) - 1
        return self._image_indices[source]

    def _check_size(self, image: Image, json: JsonObject) -> Image:
        """Return the image, unless images that share buffer bytes would fill the memory."""
        if "bufferView" not in json:
            return image
        self._n_bytes += len(image.data)
        limit = max(MIN_EXPANDED_BYTES, MAX_EXPANSION * self._buffers.size_bytes)
        if self._n_bytes > limit:
            raise FormatError(
                f"{json.place}: images need {self._n_bytes} bytes; the limit is {limit}"
            )
        return image


def note_extensions(document: Document, meshes: Sequence[JsonObject], notes: list[str]) -> None:
    """Note the unsupported extensions in the materials of some meshes."""
    lists = document.lists
    primitives = [one for mesh in meshes for one in triangle_primitives(mesh)]
    numbers = {document.index(one, "material", "materials") for one in primitives}
    users: dict[str, list[str]] = {}
    for number in sorted(one for one in numbers if one is not None):
        material = lists["materials"][number]
        label = material.text("name", "") or f"material {number}"
        converted = set() if "pbrMetallicRoughness" in material else {SPECULAR_GLOSSINESS}
        for name in _extensions(material) - SUPPORTED_EXTENSIONS - converted:
            users.setdefault(name, []).append(label)
    if any(one.extension(VARIANTS) is not None for one in primitives):
        users[VARIANTS] = ["other materials of the same faces"]
    for texture in lists["textures"]:
        for name in _extensions(texture):
            if name not in IMAGE_EXTENSIONS or "source" in texture:
                users.setdefault(name, []).append(texture.place)
    if users:
        described = listed(f"{name} ({listed(users[name], 3)})" for name in sorted(users))
        note_left_out(notes, f"extensions of materials: {described}")


def _extensions(json: JsonObject) -> set[str]:
    extensions = json.values.get("extensions")
    return set(extensions) if isinstance(extensions, dict) else set()


def image_index(texture: JsonObject, n_images: int) -> int:
    """Return the image of a texture: that of the core specification, or else of an extension.

    Raises
    ------
    FormatError
        If it has no supported image.
    """
    if (source := texture.index("source", n_images)) is not None:
        return source
    for name in IMAGE_EXTENSIONS:
        extension = texture.extension(name)
        if extension is not None and (source := extension.index("source", n_images)) is not None:
            return source
    raise FormatError(f"{texture.place}: has no supported image")


def read_image(image: JsonObject, buffers: Buffers) -> Image:
    """Return an image of the file.

    Raises
    ------
    FormatError, InvalidInputError
        If it cannot be read.
    """
    document = buffers.document
    name, declared = image.text("name", ""), image.text("mimeType", "")
    view = document.index(image, "bufferView", "bufferViews")
    if view is not None:
        data = bytes(buffers.view(view)[0])
        return Image(name, declared or image_type(data), data)
    uri = image.text("uri")
    if match := DATA_URI.match(uri):
        data = _decode_base64(uri[match.end() :], image)
        detected = image_type(data)
        mime_type = match[1].lower() if detected == UNKNOWN else detected
        return Image(name, declared or mime_type or detected, data)
    path = referenced_file(document, uri, image.place)
    with os_errors_naming(path):
        data = path.read_bytes()
    file_name = PurePosixPath(unquote(uri))
    return Image(name or file_name.stem, declared or image_type(data, file_name.name), data)


def _decode_base64(text: str, image: JsonObject) -> bytes:
    try:
        return base64.b64decode(text)
    except (binascii.Error, ValueError) as error:
        raise FormatError(f"{image.place}: its data are not valid base64 ({error})") from None
