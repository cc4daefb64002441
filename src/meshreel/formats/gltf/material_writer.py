"""Writing materials with their textures, samplers and images to the JSON of a glTF file."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from meshreel.formats.gltf.container import BufferWriter, Json
from meshreel.formats.gltf.materials import (
    ALPHA_MODES,
    FILTERS,
    IMAGE_EXTENSIONS,
    LIT_TEXTURES,
    STRENGTH,
    TRANSFORM,
    UNLIT,
    WRAPS,
)
from meshreel.formats.notes import note_left_out
from meshreel.model.materials import DEFAULT_MATERIAL, AlphaMode, Material, Texture, Wrap
from meshreel.model.surface import Kind, Surface

WRAP_CODES = {mode: code for code, mode in WRAPS.items()}
FILTER_CODES = {mode: code for code, mode in FILTERS.items()}
ALPHA_CODES = {mode: code for code, mode in ALPHA_MODES.items()}
EXTENSION_OF = {mime_type: name for name, mime_type in IMAGE_EXTENSIONS.items()}

CORE_TYPES = ("image/png", "image/jpeg")
NEAREST_WRAPS = {Wrap.BLACK: Wrap.CLAMP, Wrap.METADATA: Wrap.REPEAT}
"""Replacements for wrap modes that glTF does not support."""


class Materials:
    """Materials by label with their textures, samplers and images, each written once.

    Parameters
    ----------
    surface : Surface
    buffer : BufferWriter
        Gains the images.
    notes : list of str
        Gains a sentence for every property that glTF cannot store.

    Attributes
    ----------
    lists : dict of lists of dict
        The lists of the JSON.
    used, required : set of str
        Names of extensions; required ones count as used.
    """

    def __init__(self, surface: Surface, buffer: BufferWriter, notes: list[str]) -> None:
        self.lists: dict[str, list[Json]] = {
            "materials": [],
            "textures": [],
            "samplers": [],
            "images": [],
        }
        self.used: set[str] = set()
        self.required: set[str] = set()
        self._surface, self._buffer, self._notes = surface, buffer, notes
        self._looks = {material.name: material for material in surface.materials}
        self._indices: dict[str | None, int] = {}
        self._image_indices: dict[int, int] = {}
        self._uv_indices: dict[str, int] = {}
        for number, attribute in enumerate(surface.of_kind(Kind.UV)):
            self._uv_indices.setdefault(attribute.name, number)

    def index(self, label: str | None) -> int:
        """Return the index of the material of a label, or None, after writing it if necessary."""
        materials = self.lists["materials"]
        if label not in self._indices:
            self._indices[label] = len(materials)
            look = DEFAULT_MATERIAL if label is None else self._looks.get(label, DEFAULT_MATERIAL)
            materials.append(({"name": label} if label else {}) | self._material(look))
        return self._indices[label]

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
            self.used.add(UNLIT)
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
        texture = roughness or metallic
        if texture is None:
            return None
        is_rough = roughness is not None and roughness.channels == "g"
        is_metal = metallic is not None and metallic.channels == "b"
        if metallic is not None and roughness is not None:
            is_shared = replace(roughness, channels="") == replace(metallic, channels="")
            fits = is_rough and is_metal and is_shared
        else:
            fits = (is_rough and look.metallic == 0) or (is_metal and look.roughness == 0)
        if fits:
            return self._texture_info(texture, _texture_label(look, "roughness"))
        note_left_out(
            self._notes,
            f"the metallic and roughness textures of material {look.name!r}: glTF stores them in "
            "the blue and green channels of one image",
        )
        return None

    def _emissive(self, look: Material) -> Json:
        strength = max(1.0, *look.emissive)
        scaled = [component / strength for component in look.emissive]
        emissive = omit_defaults([0.0] * 3, emissiveFactor=self._clip("emissive", scaled, look))
        if strength > 1:
            self.used.add(STRENGTH)
            emissive["extensions"] = {STRENGTH: {"emissiveStrength": strength}}
        return emissive

    def _texture(self, look: Material, slot: str, *channels: str) -> Json | None:
        texture, label = look.textures.get(slot), _texture_label(look, slot)
        if texture is None:
            return None
        if texture.channels not in channels:
            if slot != "base_color":
                note_left_out(
                    self._notes,
                    f"{label}: glTF uses channel {channels[0]}, not {texture.channels}",
                )
                return None
            self._note(f"{label} keeps its alpha channel, as glTF requires")
        return self._texture_info(texture, label)

    def _texture_info(self, texture: Texture, label: str) -> Json | None:
        """Return the texture info for a material, after writing the texture, or None."""
        image = self._surface.images[texture.image]
        if image.mime_type not in (*CORE_TYPES, *EXTENSION_OF):
            note_left_out(
                self._notes, f"{label}: glTF does not support images of type {image.mime_type}"
            )
            return None
        if texture.uv not in self._uv_indices:
            note_left_out(self._notes, f"{label}: there are no UVs {texture.uv!r}")
            return None
        written: Json = {"source": self._image(texture.image)}
        if extension := EXTENSION_OF.get(image.mime_type):
            self.required.add(extension)
            written = {"extensions": {extension: written}}
        if sampler := self._sampler(texture, label):
            written["sampler"] = self._item("samplers", sampler)
        texture_info: Json = {"index": self._item("textures", written)}
        if number := self._uv_indices[texture.uv]:
            texture_info["texCoord"] = number
        if texture.is_placed:
            self.used.add(TRANSFORM)
            transform = omit_defaults([0.0, 0.0], offset=list(texture.offset))
            transform |= omit_defaults(0.0, rotation=texture.rotation)
            transform |= omit_defaults([1.0, 1.0], scale=list(texture.scale))
            texture_info["extensions"] = {TRANSFORM: transform}
        return texture_info

    def _image(self, source: int) -> int:
        if source not in self._image_indices:
            image, images = self._surface.images[source], self.lists["images"]
            named = {"name": image.name} if image.name else {}
            view = self._buffer.add_view(image.data)
            images.append({**named, "mimeType": image.mime_type, "bufferView": view})
            self._image_indices[source] = len(images) - 1
        return self._image_indices[source]

    def _sampler(self, texture: Texture, label: str) -> Json:
        wraps = [NEAREST_WRAPS.get(wrap, wrap) for wrap in (texture.wrap_u, texture.wrap_v)]
        if wraps != [texture.wrap_u, texture.wrap_v]:
            replacement = f"{wraps[0]} and {wraps[1]}, not {texture.wrap_u} and {texture.wrap_v}"
            self._note(f"{label} wraps by {replacement}, which glTF does not support")
        keys = zip(("wrapS", "wrapT"), wraps, strict=True)
        sampler = {key: WRAP_CODES[wrap] for key, wrap in keys if wrap is not Wrap.REPEAT}
        if texture.magnified is not None:
            sampler["magFilter"] = FILTER_CODES[texture.magnified]
        if texture.shrunk is not None:
            sampler["minFilter"] = FILTER_CODES[texture.shrunk]
        return sampler

    def _item(self, kind: str, item: Json) -> int:
        """Return the index of an item in a list, after adding it if necessary."""
        items = self.lists[kind]
        if item not in items:
            items.append(item)
        return items.index(item)

    def _clip(self, what: str, values: Sequence[float], look: Material) -> list[float]:
        clipped = [min(1.0, max(0.0, value)) for value in values]
        if clipped != list(values):
            self._note(f"{what} of material {look.name!r} is clipped to 0..1")
        return clipped

    def _note(self, note: str) -> None:
        if note not in self._notes:
            self._notes.append(note)


def _texture_label(look: Material, slot: str) -> str:
    return f"the {slot.replace('_', ' ')} texture of material {look.name!r}"


def omit_defaults(default: Any, **values: Any) -> Json:
    """Return the values that differ from the default."""
    return {key: value for key, value in values.items() if value != default}
