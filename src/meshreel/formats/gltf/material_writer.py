"""Writing materials with their textures, samplers and images to the JSON of a glTF file."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from meshreel.formats.gltf.container import BufferWriter, Json
from meshreel.formats.gltf.materials import (
    ALPHA_CODES,
    FILTER_CODES,
    IMAGE_EXTENSIONS,
    LIT_TEXTURES,
    STRENGTH,
    TRANSFORM,
    UNLIT,
    WRAP_CODES,
)
from meshreel.formats.notes import note_left_out
from meshreel.model.materials import DEFAULT_MATERIAL, AlphaMode, Image, Material, Texture, Wrap
from meshreel.model.surface import Kind, Surface

CORE_TYPES = ("image/png", "image/jpeg")
EXTENSION_OF = {mime_type: name for name, mime_type in IMAGE_EXTENSIONS.items()}
NEAREST_WRAPS = {Wrap.BLACK: Wrap.CLAMP, Wrap.METADATA: Wrap.REPEAT}
"""Replacements for wrap modes that glTF does not support."""


class Materials:
    """Materials by label, each written once.

    Parameters
    ----------
    surface : Surface
    buffer : BufferWriter
        Gains the images.
    notes : list of str
        Gains a sentence for every property that glTF cannot store.

    Attributes
    ----------
    listed : list of dict
        Entries of the JSON.
    textures : Textures
    """

    def __init__(self, surface: Surface, buffer: BufferWriter, notes: list[str]) -> None:
        self.listed: list[Json] = []
        self.textures: Textures = Textures(surface, buffer, notes)
        self._looks = {one.name: one for one in surface.materials}
        self._notes = notes
        self._indices: dict[str | None, int] = {}

    def index(self, label: str | None) -> int:
        """Return the index of the material of a label, or None, after writing it if necessary."""
        if label not in self._indices:
            self._indices[label] = len(self.listed)
            look = DEFAULT_MATERIAL if label is None else self._looks.get(label, DEFAULT_MATERIAL)
            self.listed.append(({"name": label} if label else {}) | self._material(look))
        return self._indices[label]

    def document(self) -> Json:
        """Return the JSON lists of materials, textures, samplers and images."""
        textures = self.textures
        lists = {
            "materials": self.listed,
            "textures": textures.textures,
            "samplers": textures.samplers,
            "images": textures.images,
        }
        return {key: values for key, values in lists.items() if values}

    def note_unused(self) -> None:
        """Note the materials that no face uses."""
        if unused := [name for name in self._looks if name not in self._indices]:
            note_left_out(self._notes, f"materials that no face uses: {', '.join(unused)}")

    def _material(self, look: Material) -> Json:
        material: Json = {}
        if pbr := self._pbr(look):
            material["pbrMetallicRoughness"] = pbr
        for slot, (key, channels) in LIT_TEXTURES.items():
            if (info := self._texture(look, slot, channels)) is not None:
                material[key] = info
        if "normalTexture" in material:
            material["normalTexture"] |= omit_defaults(1.0, scale=look.normal_scale)
        if "occlusionTexture" in material:
            strength = self._clip("occlusion strength", [look.occlusion_strength], look)[0]
            material["occlusionTexture"] |= omit_defaults(1.0, strength=strength)
        material |= self._emissive(look)
        if look.alpha_mode is not AlphaMode.OPAQUE:
            material["alphaMode"] = ALPHA_CODES[look.alpha_mode]
        if look.alpha_mode is AlphaMode.MASK:
            material |= omit_defaults(0.5, alphaCutoff=look.alpha_cutoff)
        if look.unlit:
            self.textures.used.add(UNLIT)
            material.setdefault("extensions", {})[UNLIT] = {}
        return material | omit_defaults(False, doubleSided=look.double_sided)

    def _pbr(self, look: Material) -> Json:
        color = self._clip("base color", look.base_color, look)
        metallic, roughness = self._clip(
            "metallic or roughness", [look.metallic, look.roughness], look
        )
        pbr = omit_defaults([1.0] * 4, baseColorFactor=color)
        pbr |= omit_defaults(1.0, metallicFactor=metallic, roughnessFactor=roughness)
        color_channels = "rgb" if look.alpha_mode is AlphaMode.OPAQUE else "rgba"
        if (info := self._texture(look, "base_color", color_channels, "rgba")) is not None:
            pbr["baseColorTexture"] = info
        if (info := self._metallic_roughness(look)) is not None:
            pbr["metallicRoughnessTexture"] = info
        return pbr

    def _metallic_roughness(self, look: Material) -> Json | None:
        """Return the single texture of both, if they share it or one of them has no effect."""
        metallic, roughness = look.textures.get("metallic"), look.textures.get("roughness")
        if metallic is None and roughness is None:
            return None
        is_shared = (
            _has_channel(roughness, "g")
            and _has_channel(metallic, "b")
            and _differ_only_in_channels(roughness, metallic)
        )
        is_rough = _has_channel(roughness, "g") and metallic is None and look.metallic == 0
        is_metal = _has_channel(metallic, "b") and roughness is None and look.roughness == 0
        texture = roughness or metallic
        if texture is not None and (is_shared or is_rough or is_metal):
            return self.textures.texture_info(texture, _texture_label(look, "roughness"))
        note_left_out(
            self._notes,
            f"the metallic and roughness textures of material {look.name!r}: glTF stores them in "
            "the blue and green channels of one image",
        )
        return None

    def _emissive(self, look: Material) -> Json:
        strength = max(1.0, *look.emissive)
        scaled = [one / strength for one in look.emissive]
        emissive = omit_defaults([0.0] * 3, emissiveFactor=self._clip("emissive", scaled, look))
        if strength > 1:
            self.textures.used.add(STRENGTH)
            emissive["extensions"] = {STRENGTH: {"emissiveStrength": strength}}
        return emissive

    def _texture(self, look: Material, slot: str, *channels: str) -> Json | None:
        texture = look.textures.get(slot)
        if texture is None:
            return None
        if texture.channels in channels:
            return self.textures.texture_info(texture, _texture_label(look, slot))
        if slot == "base_color":
            self._note(f"{_texture_label(look, slot)} keeps its alpha channel, as glTF requires")
            return self.textures.texture_info(texture, _texture_label(look, slot))
        note_left_out(
            self._notes,
            f"{_texture_label(look, slot)}: glTF uses channel {channels[0]}, not "
            f"{texture.channels}",
        )
        return None

    def _clip(self, what: str, values: Sequence[float], look: Material) -> list[float]:
        clipped = [min(1.0, max(0.0, one)) for one in values]
        if clipped != list(values):
            self._note(f"{what} of material {look.name!r} is clipped to 0..1")
        return clipped

    def _note(self, note: str) -> None:
        if note not in self._notes:
            self._notes.append(note)


def _texture_label(look: Material, slot: str) -> str:
    return f"the {slot.replace('_', ' ')} texture of material {look.name!r}"


def _has_channel(texture: Texture | None, channel: str) -> bool:
    return texture is not None and texture.channels == channel


def _differ_only_in_channels(first: Texture | None, second: Texture | None) -> bool:
    """Return whether two textures are equal except for their channels."""
    if first is None or second is None:
        return first is second
    return replace(first, channels="") == replace(second, channels="")


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


def uv_indices(surface: Surface) -> dict[str, int]:
    """Return the TEXCOORD set index of each UV set, by name."""
    numbers: dict[str, int] = {}
    for number, attribute in enumerate(surface.of_kind(Kind.UV)):
        numbers.setdefault(attribute.name, number)
    return numbers
