"""Writing textures, samplers and images to the JSON of a glTF file."""

from typing import Any

from meshreel.formats.gltf.buffer_writer import BufferWriter, Json
from meshreel.formats.gltf.image_reading import IMAGE_EXTENSIONS
from meshreel.formats.gltf.material_values import FILTER_CODES, TRANSFORM, WRAP_CODES
from meshreel.formats.gltf.seams import uv_indices
from meshreel.formats.notes import note_left_out
from meshreel.model.materials import Image, Texture, Wrap
from meshreel.model.surface import Surface

CORE_TYPES = ("image/png", "image/jpeg")
EXTENSION_OF = {mime_type: name for name, mime_type in IMAGE_EXTENSIONS.items()}
NEAREST_WRAPS = {Wrap.BLACK: Wrap.CLAMP, Wrap.METADATA: Wrap.REPEAT}
"""Replacements for wrap modes that glTF does not support."""


class Textures:
    """Textures, samplers and images of a file, each written once.

    Parameters
    ----------
    surface : Surface
    buffer : BufferWriter
        Gains the images.
    notes : list of str
        Gains a sentence for each texture that glTF cannot store.

    Attributes
    ----------
    textures, samplers, images : list of dict
        Entries of the JSON.
    used, required : set of str
        Names of extensions.
    """

    def __init__(self, surface: Surface, buffer: BufferWriter, notes: list[str]) -> None:
        self.textures: list[Json] = []
        self.samplers: list[Json] = []
        self.images: list[Json] = []
        self.used: set[str] = set()
        self.required: set[str] = set()
        self._source_images, self._buffer, self._notes = surface.images, buffer, notes
        self._uv_indices = uv_indices(surface)
        self._image_indices: dict[int, int] = {}
        self._item_indices: dict[str, int] = {}

    def texture_info(self, texture: Texture, label: str) -> Json | None:
        """Return the texture info for a material, after writing the texture, or None.

        Parameters
        ----------
        texture : Texture
        label : str
            Description of the texture for notes.
        """
        image = self._source_images[texture.image]
        if image.mime_type not in (*CORE_TYPES, *EXTENSION_OF):
            note_left_out(
                self._notes, f"{label}: glTF does not support images of type {image.mime_type}"
            )
            return None
        if texture.uv not in self._uv_indices:
            note_left_out(self._notes, f"{label}: there are no UVs {texture.uv!r}")
            return None
        texture_info: Json = {"index": self._texture(texture, image, label)}
        if number := self._uv_indices[texture.uv]:
            texture_info["texCoord"] = number
        if texture.is_placed:
            self.used.add(TRANSFORM)
            texture_info["extensions"] = {TRANSFORM: _transform_json(texture)}
        return texture_info

    def _texture(self, texture: Texture, image: Image, label: str) -> int:
        number = self._image(texture.image, image)
        written: Json = {"source": number}
        if extension := EXTENSION_OF.get(image.mime_type):
            self.required.add(extension)
            written = {"extensions": {extension: {"source": number}}}
        if sampler := self._sampler(texture, label):
            written["sampler"] = _index_of(self.samplers, self._item_indices, sampler)
        return _index_of(self.textures, self._item_indices, written)

    def _image(self, source: int, image: Image) -> int:
        if source not in self._image_indices:
            view = self._buffer.add_image(image.data)
            named = {"name": image.name} if image.name else {}
            self.images.append({**named, "mimeType": image.mime_type, "bufferView": view})
            self._image_indices[source] = len(self.images) - 1
        return self._image_indices[source]

    def _sampler(self, texture: Texture, label: str) -> Json:
        wraps = [NEAREST_WRAPS.get(one, one) for one in (texture.wrap_u, texture.wrap_v)]
        if wraps != [texture.wrap_u, texture.wrap_v]:
            replacement = f"{wraps[0]} and {wraps[1]}, not {texture.wrap_u} and {texture.wrap_v}"
            note = f"{label} wraps by {replacement}, which glTF does not support"
            if note not in self._notes:
                self._notes.append(note)
        keys = zip(("wrapS", "wrapT"), wraps, strict=True)
        sampler = {key: WRAP_CODES[wrap] for key, wrap in keys if wrap is not Wrap.REPEAT}
        if texture.magnified is not None:
            sampler["magFilter"] = FILTER_CODES[texture.magnified]
        if texture.shrunk is not None:
            sampler["minFilter"] = FILTER_CODES[texture.shrunk]
        return sampler


def omit_defaults(default: Any, **values: Any) -> Json:
    """Return the values that differ from the default."""
    return {key: value for key, value in values.items() if value != default}


def _transform_json(texture: Texture) -> Json:
    transform = omit_defaults([0.0, 0.0], offset=list(texture.offset))
    transform |= omit_defaults(0.0, rotation=texture.rotation)
    return transform | omit_defaults([1.0, 1.0], scale=list(texture.scale))


def _index_of(items: list[Json], indices: dict[str, int], item: Json) -> int:
    """Return the index of an item in a list, after adding it if necessary."""
    if (key := repr(item)) not in indices:
        items.append(item)
        indices[key] = len(items) - 1
    return indices[key]
