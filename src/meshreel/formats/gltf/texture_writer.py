"""Textures, samplers and images as they stand in a glTF file."""

from typing import Any

from meshreel.formats.gltf.buffer_writer import BufferWriter, Json
from meshreel.formats.gltf.image_reading import PACKED
from meshreel.formats.gltf.material_values import FILTER_CODES, TRANSFORM, WRAP_CODES
from meshreel.formats.gltf.seams import texcoord_numbers
from meshreel.formats.notes import note_left_out
from meshreel.model.materials import Image, Texture, Wrap
from meshreel.model.surface import Surface

CORE = ("image/png", "image/jpeg")
EXTENSION_OF = {mime_type: name for name, mime_type in PACKED.items()}
NEAREST_WRAPS = {Wrap.BLACK: Wrap.CLAMP, Wrap.METADATA: Wrap.REPEAT}
"""The replacements for what glTF does not have."""


class Textures:
    """Textures, samplers and images of a file, each written once.

    Parameters
    ----------
    buffer : BufferWriter
        Gains the images.
    notes : list of str
        Gains a sentence for each texture that glTF cannot have.

    Attributes
    ----------
    textures, samplers, images : list of dict
        As they stand in the JSON.
    used, required : set of str
        Extensions.
    """

    def __init__(self, surface: Surface, buffer: BufferWriter, notes: list[str]) -> None:
        self.textures: list[Json] = []
        self.samplers: list[Json] = []
        self.images: list[Json] = []
        self.used: set[str] = set()
        self.required: set[str] = set()
        self._given, self._buffer, self._notes = surface.images, buffer, notes
        self._uvs = texcoord_numbers(surface)
        self._numbers: dict[int, int] = {}
        self._places: dict[str, int] = {}

    def told(self, texture: Texture, what: str) -> Json | None:
        """A texture as a material tells of it; None if glTF cannot have it.

        Parameters
        ----------
        what : str
            Which one it is, for the notes.
        """
        image = self._given[texture.image]
        if image.mime_type not in (*CORE, *EXTENSION_OF):
            note_left_out(self._notes, f"{what}: glTF has no images of {image.mime_type}")
            return None
        if texture.uv not in self._uvs:
            note_left_out(self._notes, f"{what}: there are no texture coordinates {texture.uv!r}")
            return None
        found: Json = {"index": self._texture(texture, image, what)}
        if number := self._uvs[texture.uv]:
            found["texCoord"] = number
        if texture.is_placed:
            self.used.add(TRANSFORM)
            found["extensions"] = {TRANSFORM: _placed(texture)}
        return found

    def _texture(self, texture: Texture, image: Image, what: str) -> int:
        number = self._image(texture.image, image)
        written: Json = {"source": number}
        if extension := EXTENSION_OF.get(image.mime_type):
            self.required.add(extension)
            written = {"extensions": {extension: {"source": number}}}
        if sampler := self._sampler(texture, what):
            written["sampler"] = _place(self.samplers, self._places, sampler)
        return _place(self.textures, self._places, written)

    def _image(self, given: int, image: Image) -> int:
        if given not in self._numbers:
            view = self._buffer.add_image(image.data)
            named = {"name": image.name} if image.name else {}
            self.images.append({**named, "mimeType": image.mime_type, "bufferView": view})
            self._numbers[given] = len(self.images) - 1
        return self._numbers[given]

    def _sampler(self, texture: Texture, what: str) -> Json:
        wraps = [NEAREST_WRAPS.get(one, one) for one in (texture.wrap_u, texture.wrap_v)]
        if wraps != [texture.wrap_u, texture.wrap_v]:
            told = f"{wraps[0]} and {wraps[1]}, not {texture.wrap_u} and {texture.wrap_v}"
            note = f"{what} wraps by {told}, which glTF does not have"
            if note not in self._notes:
                self._notes.append(note)
        keys = zip(("wrapS", "wrapT"), wraps, strict=True)
        found = {key: WRAP_CODES[wrap] for key, wrap in keys if wrap is not Wrap.REPEAT}
        if texture.magnified is not None:
            found["magFilter"] = FILTER_CODES[texture.magnified]
        if texture.shrunk is not None:
            found["minFilter"] = FILTER_CODES[texture.shrunk]
        return found


def unless(usual: Any, **values: Any) -> Json:
    """Those of the values that are not the usual one."""
    return {key: value for key, value in values.items() if value != usual}


def _placed(texture: Texture) -> Json:
    found = unless([0.0, 0.0], offset=list(texture.offset))
    found |= unless(0.0, rotation=texture.rotation)
    return found | unless([1.0, 1.0], scale=list(texture.scale))


def _place(listed: list[Json], places: dict[str, int], item: Json) -> int:
    """Where an item is in a list; it is added if it is not there."""
    if (key := repr(item)) not in places:
        listed.append(item)
        places[key] = len(listed) - 1
    return places[key]
