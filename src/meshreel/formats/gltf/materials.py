"""Materials of a glTF file with their textures, samplers and images: read and written."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache, cached_property
from pathlib import PurePosixPath
from typing import Any

from meshreel.errors import FormatError, InvalidInputError, Keyword, Message
from meshreel.formats.gltf.container import BufferWriter, Json
from meshreel.formats.gltf.document import Document, JsonObject, unique_names
from meshreel.formats.surfaces.images import UNKNOWN, image_type
from meshreel.model.materials import (
    CLAY_MATERIAL,
    DEFAULT_MATERIAL,
    AlphaMode,
    Filter,
    Image,
    Material,
    Texture,
    Wrap,
    select_materials,
)
from meshreel.model.notes import NoteKind, Notes
from meshreel.model.surface import Kind, Surface

SPECULAR_GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"
SPECULAR_TEXTURE = "specularGlossinessTexture"

UNLIT, STRENGTH = "KHR_materials_unlit", "KHR_materials_emissive_strength"
TRANSFORM = "KHR_texture_transform"

WRAPS = {10497: Wrap.REPEAT, 33648: Wrap.MIRROR, 33071: Wrap.CLAMP}
FILTERS = {
    9728: Filter.NEAREST,
    9729: Filter.LINEAR,
    9984: Filter.NEAREST_MIPMAP_NEAREST,
    9985: Filter.LINEAR_MIPMAP_NEAREST,
    9986: Filter.NEAREST_MIPMAP_LINEAR,
    9987: Filter.LINEAR_MIPMAP_LINEAR,
}
MAX_MAG_FILTER = 9729

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

WEBP = "EXT_texture_webp"
IMAGE_EXTENSIONS = {
    WEBP: "image/webp",
    "EXT_texture_avif": "image/avif",
    "KHR_texture_basisu": "image/ktx2",
    "MSFT_texture_dds": "image/vnd-ms.dds",
}
"""Extensions with images of types other than PNG and JPEG, and their media types."""

CONVERTED = "converted from specular-glossiness to metallic-roughness, without specular colors"
"""Subject of the note on materials of an older extension."""

WRAP_CODES = {mode: code for code, mode in WRAPS.items()}
FILTER_CODES = {mode: code for code, mode in FILTERS.items()}
EXTENSION_OF = {mime_type: name for name, mime_type in IMAGE_EXTENSIONS.items()}

CORE_TYPES = ("image/png", "image/jpeg")
NEAREST_WRAPS = {Wrap.BLACK: Wrap.CLAMP, Wrap.METADATA: Wrap.REPEAT}
"""Replacements for wrap modes that glTF does not support."""


def set_label(kind: Kind, number: int) -> str:
    """Return the name of a set of UVs or colors: "uv", "uv1", and so on."""
    return kind.value + (str(number) if number else "")


class MaterialReader:
    """The materials of a file and their images, read on demand.

    Parameters
    ----------
    notes : Notes
        Gains a sentence for each material or image that is left out as invalid or missing.
    """

    def __init__(self, document: Document, notes: Notes) -> None:
        self._document, self._lists = document, document.lists
        self._notes = notes
        self._image_indices: dict[str, int] = {}
        self._images: list[Image] = []
        self._read = cache(self._read_material)
        self._image = cache(self._read_image)

    @cached_property
    def labels(self) -> list[str]:
        """Unique names of the materials; empty for one without name and properties."""
        names = [material.text("name", "") for material in self._lists["materials"]]
        # A single unnamed material with default values carries no information; several do, since
        # they group the faces.
        has_labels = names.count("") > 1
        if names.count("") == 1:
            look = self._read(names.index(""))
            has_labels = look not in (None, Material(""), DEFAULT_MATERIAL, CLAY_MATERIAL)
        named = [name or f"material_{i}" for i, name in enumerate(names) if name or has_labels]
        unique = iter(unique_names(named))
        return [next(unique) if name or has_labels else "" for name in names]

    def look(self, numbers: Iterable[int]) -> tuple[tuple[Material, ...], tuple[Image, ...]]:
        """Return the materials of these indices that have labels, and the images they use."""
        materials = {number: self._read(number) for number in numbers}
        labeled = [
            replace(material, name=self.labels[number])
            for number, material in materials.items()
            if material is not None and self.labels[number]
        ]
        return select_materials([material.name for material in labeled], labeled, self._images)

    def _read_material(self, number: int) -> Material | None:
        """Return a material without its name, or None if a value is invalid."""
        material = self._lists["materials"][number]
        try:
            look, specular = read_look(material), _specular_glossiness(material)
            if specular is not None:
                name = material.text("name", "") or material.place
                self._notes.list_names(NoteKind.CHANGED, CONVERTED, [name])
            parents = (
                (material.child("pbrMetallicRoughness"), PBR_TEXTURES),
                (specular, DIFFUSE_TEXTURES),
                (material, LIT_TEXTURES),
            )
            textures = {}
            for parent, keys in parents:
                for slot, (key, channels) in keys.items():
                    info = None if parent is None else parent.child(key)
                    if info is not None and (texture := self._texture(info, channels)) is not None:
                        textures[slot] = texture
            return look.with_textures(textures)
        except FormatError as error:
            self._notes.left_out("appearance of materials", [str(error)])
            material.dismiss()
            return None

    def _texture(self, info: JsonObject, channels: str) -> Texture | None:
        """Return a texture, whose image is read if necessary; None if the image is unreadable."""
        texture = info.item("index", "textures")
        sampler = texture.index("sampler", "samplers")
        image = self._image(_image_index(texture))
        if image is None:
            return None
        transform = info.extension(TRANSFORM) or JsonObject({}, info.place)
        number = transform.integer("texCoord", info.integer("texCoord", 0))
        offset_u, offset_v = transform.numbers("offset", 2, (0, 0)).tolist()
        scale_u, scale_v = transform.numbers("scale", 2, (1, 1)).tolist()
        base = Texture(
            image,
            set_label(Kind.UV, min(number, 999)),
            channels,
            offset=(offset_u, offset_v),
            rotation=transform.number("rotation", 0.0),
            scale=(scale_u, scale_v),
        )
        return base if sampler is None else _with_sampler(base, self._lists["samplers"][sampler])

    def _read_image(self, number: int) -> int | None:
        """Return the index of an image among those read so far, after reading it if necessary."""
        image = self._lists["images"][number]
        source = repr((image.values.get("bufferView"), image.values.get("uri")))
        if source not in self._image_indices:
            try:
                self._images.append(self._decode_image(image))
            except (FormatError, InvalidInputError) as error:
                self._notes.left_out("texture images", [str(error)])
                image.dismiss()
                return None
            self._image_indices[source] = len(self._images) - 1
        return self._image_indices[source]

    def _decode_image(self, image: JsonObject) -> Image:
        name, declared_type = image.text("name", ""), image.text("mimeType", "")
        if image.index("bufferView", "bufferViews") is not None:
            view, _ = self._document.view(image)
            self._document.reserve(len(view), image.place)
            return Image(name, declared_type or image_type(bytes(view)), bytes(view))
        data, mime_type, file_name = self._document.read_uri(image)
        detected_type = image_type(data, file_name)
        mime_type = mime_type if mime_type and detected_type == UNKNOWN else detected_type
        return Image(name or PurePosixPath(file_name).stem, declared_type or mime_type, data)


def _image_index(texture: JsonObject) -> int:
    """Return the image index of a texture, from its core property or else from an extension."""
    sources = [texture, *map(texture.extension, IMAGE_EXTENSIONS)]
    for source in sources:
        if source is not None and (index := source.index("source", "images")) is not None:
            return index
    raise FormatError(f"{texture.place}: has no supported image")


def read_look(material: JsonObject) -> Material:
    """Return a material without its name and textures."""
    specular = _specular_glossiness(material)
    mode = material.text("alphaMode", "OPAQUE")
    if mode not in AlphaMode.__members__:
        raise material.error("alphaMode", "OPAQUE, MASK or BLEND")
    normal, occlusion = material.child("normalTexture"), material.child("occlusionTexture")
    if specular is None:
        pbr = material.child("pbrMetallicRoughness") or JsonObject({}, material.place)
        factor = pbr.numbers("baseColorFactor", 4, (1, 1, 1, 1))
        metallic, roughness = pbr.number("metallicFactor", 1.0), pbr.number("roughnessFactor", 1.0)
    else:
        factor, metallic = specular.numbers("diffuseFactor", 4, (1, 1, 1, 1)), 0.0
        roughness = 1.0 - specular.number("glossinessFactor", 1.0)
        if SPECULAR_TEXTURE in specular:
            roughness = 1.0  # the glossiness is in an image, which is not decoded
    red, green, blue, opacity = factor.tolist()
    return Material(
        "",
        base_color=(red, green, blue, opacity),
        metallic=metallic,
        roughness=roughness,
        emissive=_emissive(material),
        normal_scale=1.0 if normal is None else normal.number("scale", 1.0),
        occlusion_strength=1.0 if occlusion is None else occlusion.number("strength", 1.0),
        alpha_mode=AlphaMode[mode],
        alpha_cutoff=material.number("alphaCutoff", 0.5) if mode == "MASK" else 0.5,
        double_sided=material.flag("doubleSided"),
        unlit=material.extension(UNLIT) is not None,
    )


def _emissive(material: JsonObject) -> tuple[float, float, float]:
    extension = material.extension(STRENGTH)
    strength = 1.0 if extension is None else extension.number("emissiveStrength", 1.0)
    factor = material.numbers("emissiveFactor", 3, (0, 0, 0)).tolist()
    red, green, blue = (strength * component for component in factor)
    if not all(map(math.isfinite, (red, green, blue))):
        raise FormatError(f"{material.place}: its emissive strength of {strength:g} is too large")
    return red, green, blue


def _with_sampler(texture: Texture, sampler: JsonObject) -> Texture:
    """Return the texture with wrap modes and filters of a sampler."""
    wrap_u, wrap_v = sampler.integer("wrapS", 10497), sampler.integer("wrapT", 10497)
    if wrap_u not in WRAPS or wrap_v not in WRAPS:
        raise FormatError(f"{sampler.place}: has invalid wrap modes {wrap_u} and {wrap_v}")
    mag_filter, min_filter = sampler.integer("magFilter", 0), sampler.integer("minFilter", 0)
    if not {mag_filter, min_filter} <= {0, *FILTERS} or mag_filter > MAX_MAG_FILTER:
        raise FormatError(f"{sampler.place}: has invalid filters {mag_filter} and {min_filter}")
    return replace(
        texture,
        wrap_u=WRAPS[wrap_u],
        wrap_v=WRAPS[wrap_v],
        magnified=FILTERS.get(mag_filter),
        shrunk=FILTERS.get(min_filter),
    )


def _specular_glossiness(material: JsonObject) -> JsonObject | None:
    """Return the extension of a material that has no metallic-roughness fallback, or None."""
    if "pbrMetallicRoughness" in material:
        return None
    return material.extension(SPECULAR_GLOSSINESS)


class Materials:
    """Materials by label with their textures, samplers and images, each written once.

    Parameters
    ----------
    buffer : BufferWriter
        Gains the images.
    notes : Notes
        Gains a sentence for every property that glTF cannot store.

    Attributes
    ----------
    lists : dict of lists of dict
        The lists of the JSON.
    used_extensions, required_extensions : set of str
        Names of extensions; required ones count as used.
    """

    def __init__(self, surface: Surface, buffer: BufferWriter, notes: Notes) -> None:
        self.lists: dict[str, list[Json]] = {
            "materials": [],
            "textures": [],
            "samplers": [],
            "images": [],
        }
        self.used_extensions: set[str] = set()
        self.required_extensions: set[str] = set()
        self._surface, self._buffer, self._notes = surface, buffer, notes
        self._looks = {material.name: material for material in surface.materials}
        self._default = DEFAULT_MATERIAL if surface.of_kind(Kind.COLOR) else CLAY_MATERIAL
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
            look = self._default if label is None else self._looks.get(label, self._default)
            materials.append(({"name": label} if label else {}) | self._material(look))
        return self._indices[label]

    def note_unused(self) -> None:
        """Note the materials that no face uses."""
        if unused := [name for name in self._looks if name not in self._indices]:
            self._notes.left_out(f"materials that no face uses: {', '.join(unused)}")

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
            material["alphaMode"] = look.alpha_mode.name
        if look.alpha_mode is AlphaMode.MASK:
            material |= omit_defaults(0.5, alphaCutoff=look.alpha_cutoff)
        if look.unlit:
            self.used_extensions.add(UNLIT)
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
        """Return the texture with metallic and roughness, if one texture can replace both.

        It can if they share it, or if one of the two factors is 0.
        """
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
        self._notes.left_out(
            f"the metallic and roughness textures of material {look.name!r}: glTF stores them in "
            "the blue and green channels of one image",
        )
        return None

    def _emissive(self, look: Material) -> Json:
        strength = max(1.0, *look.emissive)
        scaled = [component / strength for component in look.emissive]
        emissive = omit_defaults([0.0] * 3, emissiveFactor=self._clip("emissive", scaled, look))
        if strength > 1:
            self.used_extensions.add(STRENGTH)
            emissive["extensions"] = {STRENGTH: {"emissiveStrength": strength}}
        return emissive

    def _texture(self, look: Material, slot: str, *channels: str) -> Json | None:
        texture, label = look.textures.get(slot), _texture_label(look, slot)
        if texture is None:
            return None
        if texture.channels not in channels:
            if slot != "base_color":
                self._notes.left_out(
                    f"{label}: glTF uses channel {channels[0]}, not {texture.channels}",
                )
                return None
            self._notes.changed(label, f"{label} keeps its alpha channel, as glTF requires")
        return self._texture_info(texture, label)

    def _texture_info(self, texture: Texture, label: str) -> Json | None:
        """Return the texture info for a material, after writing the texture, or None."""
        image = self._surface.images[texture.image]
        if image.mime_type not in (*CORE_TYPES, *EXTENSION_OF):
            self._notes.left_out(f"{label}: glTF does not support images of type {image.mime_type}")
            return None
        if texture.uv not in self._uv_indices:
            self._notes.left_out(f"{label}: there are no UVs {texture.uv!r}")
            return None
        texture_json: Json = {"source": self._image(texture.image)}
        if extension := EXTENSION_OF.get(image.mime_type):
            self.required_extensions.add(extension)
            if extension == WEBP:
                programs = "which browsers, Blender and Godot read; for other programs use "
                parts = f"WebP images need {WEBP}, {programs}", Keyword("images", "png")
                self._notes.result(WEBP, Message(*parts))
            texture_json = {"extensions": {extension: texture_json}}
        if sampler := self._sampler(texture, label):
            texture_json["sampler"] = self._item("samplers", sampler)
        texture_info: Json = {"index": self._item("textures", texture_json)}
        if number := self._uv_indices[texture.uv]:
            texture_info["texCoord"] = number
        if texture.is_placed:
            self.used_extensions.add(TRANSFORM)
            transform = omit_defaults([0.0, 0.0], offset=list(texture.offset))
            transform |= omit_defaults(0.0, rotation=texture.rotation)
            transform |= omit_defaults([1.0, 1.0], scale=list(texture.scale))
            texture_info["extensions"] = {TRANSFORM: transform}
        return texture_info

    def _image(self, source: int) -> int:
        if source not in self._image_indices:
            image, images = self._surface.images[source], self.lists["images"]
            name_entry = {"name": image.name} if image.name else {}
            view = self._buffer.add_view(image.data)
            images.append({**name_entry, "mimeType": image.mime_type, "bufferView": view})
            self._image_indices[source] = len(images) - 1
        return self._image_indices[source]

    def _sampler(self, texture: Texture, label: str) -> Json:
        wraps = [NEAREST_WRAPS.get(wrap, wrap) for wrap in (texture.wrap_u, texture.wrap_v)]
        if wraps != [texture.wrap_u, texture.wrap_v]:
            replacement = f"{wraps[0]} and {wraps[1]}, not {texture.wrap_u} and {texture.wrap_v}"
            self._notes.changed(f"{label} wraps by {replacement}, which glTF does not support")
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

    def _clip(self, noun: str, values: Sequence[float], look: Material) -> list[float]:
        clipped = [min(1.0, max(0.0, value)) for value in values]
        if clipped != list(values):
            self._notes.changed(look.name, f"{noun} of material {look.name!r} is clipped to 0..1")
        return clipped


def _texture_label(look: Material, slot: str) -> str:
    return f"the {slot.replace('_', ' ')} texture of material {look.name!r}"


def omit_defaults(default: Any, **values: Any) -> Json:
    """Return the values that differ from the default."""
    return {key: value for key, value in values.items() if value != default}
