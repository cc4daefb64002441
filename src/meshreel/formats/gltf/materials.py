"""Reading materials of a glTF file with their textures, samplers and images."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache, cached_property
from pathlib import PurePosixPath

import numpy as np

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.gltf.document import Document, JsonObject, unique_names
from meshreel.formats.gltf.geometry import set_label, triangle_primitives
from meshreel.formats.notes import NoteKind, list_in_note, listed, note_kinds, note_left_out
from meshreel.formats.surfaces.images import UNKNOWN, image_type
from meshreel.model.materials import (
    DEFAULT_MATERIAL,
    AlphaMode,
    Filter,
    Image,
    Material,
    Texture,
    Wrap,
    select_materials,
)
from meshreel.model.surface import Kind

Color = tuple[float, float, float, float]

SPECULAR_GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"
SPECULAR_TEXTURE = "specularGlossinessTexture"
DROPPED_TEXTURE = "specular-glossiness textures, replaced by metalness 0 and half the glossiness"
DIELECTRIC = 0.04
"""Specular reflectance of dielectrics at normal incidence."""
TYPICAL_GLOSSINESS = 0.5
"""Assumed value of glossiness textures, since images are not decoded."""
LUMA = np.array([0.299, 0.587, 0.114])
TINY = 1e-6

UNLIT, STRENGTH = "KHR_materials_unlit", "KHR_materials_emissive_strength"
TRANSFORM, VARIANTS = "KHR_texture_transform", "KHR_materials_variants"

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
ALPHA_MODES = {"OPAQUE": AlphaMode.OPAQUE, "MASK": AlphaMode.MASK, "BLEND": AlphaMode.BLEND}

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
    notes : list of str
        Gains a sentence for each material or image that is left out as invalid or missing.
    """

    def __init__(self, document: Document, notes: list[str]) -> None:
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
            has_labels = look not in (None, Material(""), DEFAULT_MATERIAL)
        named = [name or f"material_{i}" for i, name in enumerate(names) if name or has_labels]
        unique = iter(unique_names(named))
        return [next(unique) if name or has_labels else "" for name in names]

    def look(self, numbers: Iterable[int]) -> tuple[tuple[Material, ...], tuple[Image, ...]]:
        """Return the materials of these indices that have labels, and the images they use."""
        materials = {number: self._read(number) for number in numbers}
        named = [
            replace(material, name=self.labels[number])
            for number, material in materials.items()
            if material is not None and self.labels[number]
        ]
        return select_materials([material.name for material in named], named, self._images)

    def _read_material(self, number: int) -> Material | None:
        """Return a material without its name, or None if a value is invalid."""
        material = self._lists["materials"][number]
        try:
            look, specular = read_look(material), _specular_glossiness(material)
            if specular is not None:
                name = material.text("name", "") or material.place
                list_in_note(self._notes, NoteKind.CHANGED, CONVERTED, [name])
                if SPECULAR_TEXTURE in specular:
                    note_kinds(self._notes, DROPPED_TEXTURE, [name])
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
            note_kinds(self._notes, "appearance of materials", [str(error)])
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
        read = Texture(
            image,
            set_label(Kind.UV, min(number, 999)),
            channels,
            offset=(offset_u, offset_v),
            rotation=transform.number("rotation", 0.0),
            scale=(scale_u, scale_v),
        )
        return read if sampler is None else _with_sampler(read, self._lists["samplers"][sampler])

    def _read_image(self, number: int) -> int | None:
        """Return the index of an image among those read so far, after reading it if necessary."""
        image = self._lists["images"][number]
        source = repr((image.values.get("bufferView"), image.values.get("uri")))
        if source not in self._image_indices:
            try:
                self._images.append(self._decode_image(image))
            except (FormatError, InvalidInputError) as error:
                note_kinds(self._notes, "texture images", [str(error)])
                return None
            self._image_indices[source] = len(self._images) - 1
        return self._image_indices[source]

    def _decode_image(self, image: JsonObject) -> Image:
        name, declared = image.text("name", ""), image.text("mimeType", "")
        if image.index("bufferView", "bufferViews") is not None:
            view, _ = self._document.view(image)
            self._document.reserve(len(view), image.place)
            return Image(name, declared or image_type(bytes(view)), bytes(view))
        data, mime_type, file_name = self._document.read_uri(image)
        detected = image_type(data, file_name)
        mime_type = mime_type if mime_type and detected == UNKNOWN else detected
        return Image(name or PurePosixPath(file_name).stem, declared or mime_type, data)


def note_extensions(document: Document, meshes: Sequence[JsonObject], notes: list[str]) -> None:
    """Note the unsupported extensions in the materials of some meshes."""
    lists = document.lists
    primitives = [primitive for mesh in meshes for primitive in triangle_primitives(mesh)]
    numbers = {primitive.index("material", "materials") for primitive in primitives}
    users: dict[str, list[str]] = {}
    for number in sorted(number for number in numbers if number is not None):
        material = lists["materials"][number]
        supported = {UNLIT, STRENGTH}
        if "pbrMetallicRoughness" not in material:
            supported.add(SPECULAR_GLOSSINESS)
        for name in _extensions(material) - supported:
            users.setdefault(name, []).append(material.label())
    if any(primitive.extension(VARIANTS) is not None for primitive in primitives):
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


def _image_index(texture: JsonObject) -> int:
    """Return the image of a texture: that of the core specification, or else of an extension."""
    sources = [texture, *map(texture.extension, IMAGE_EXTENSIONS)]
    for source in sources:
        if source is not None and (index := source.index("source", "images")) is not None:
            return index
    raise FormatError(f"{texture.place}: has no supported image")


def read_look(material: JsonObject) -> Material:
    """Return a material without its name and textures.

    Raises
    ------
    FormatError
        If a value is invalid.
    """
    specular = _specular_glossiness(material)
    mode = material.text("alphaMode", "OPAQUE")
    if mode not in ALPHA_MODES:
        raise material.error("alphaMode", "OPAQUE, MASK or BLEND")
    normal, occlusion = material.child("normalTexture"), material.child("occlusionTexture")
    if specular is None:
        pbr = material.child("pbrMetallicRoughness") or JsonObject({}, material.place)
        red, green, blue, opacity = pbr.numbers("baseColorFactor", 4, (1, 1, 1, 1)).tolist()
        color: Color = red, green, blue, opacity
        metallic, roughness = pbr.number("metallicFactor", 1.0), pbr.number("roughnessFactor", 1.0)
    else:
        color, metallic, roughness = to_metallic_roughness(specular)
    return Material(
        "",
        base_color=color,
        metallic=metallic,
        roughness=roughness,
        emissive=_emissive(material),
        normal_scale=1.0 if normal is None else normal.number("scale", 1.0),
        occlusion_strength=1.0 if occlusion is None else occlusion.number("strength", 1.0),
        alpha_mode=ALPHA_MODES[mode],
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


def to_metallic_roughness(specular_glossiness: JsonObject) -> tuple[Color, float, float]:
    """Return base color, metalness and roughness that look like specular and glossiness.

    Textures of specular colors and glossiness are not decoded: such a material is assumed to be
    dielectric and half as glossy as declared.

    Raises
    ------
    FormatError
        If a factor is outside of 0 to 1.
    """
    factors = {}
    for key, length in (("diffuseFactor", 4), ("specularFactor", 3)):
        factors[key] = specular_glossiness.numbers(key, length, np.ones(length))
        if (factors[key] < 0).any() or (factors[key] > 1).any():
            raise specular_glossiness.error(key, f"a list of {length} numbers from 0 to 1")
    diffuse, specular = factors["diffuseFactor"][:3], factors["specularFactor"]
    opacity = float(factors["diffuseFactor"][3])
    glossiness = specular_glossiness.number("glossinessFactor", 1.0)
    if not 0 <= glossiness <= 1:
        raise specular_glossiness.error("glossinessFactor", "a number from 0 to 1")
    if SPECULAR_TEXTURE in specular_glossiness:
        red, green, blue = diffuse.tolist()
        return (red, green, blue, opacity), 0.0, 1 - TYPICAL_GLOSSINESS * glossiness
    diffuse_share = 1 - float(specular.max())
    # Perceived brightness. The metalness is the root of the equation that equates both models.
    bright_diffuse, bright_specular = (
        float(np.sqrt(LUMA @ color**2)) for color in (diffuse, specular)
    )
    metallic = 0.0
    if bright_specular >= DIELECTRIC:
        scaled_diffuse = bright_diffuse * diffuse_share / (1 - DIELECTRIC)
        linear = scaled_diffuse + bright_specular - 2 * DIELECTRIC
        root = math.sqrt(max(linear**2 - 4 * DIELECTRIC * (DIELECTRIC - bright_specular), 0.0))
        metallic = min(max((root - linear) / (2 * DIELECTRIC), 0.0), 1.0)
    from_diffuse = diffuse * diffuse_share / (1 - DIELECTRIC) / max(1 - metallic, TINY)
    from_specular = (specular - DIELECTRIC * (1 - metallic)) / max(metallic, TINY)
    weight = metallic**2
    color = np.clip((1 - weight) * from_diffuse + weight * from_specular, 0, 1)
    red, green, blue = color.tolist()
    return (red, green, blue, opacity), metallic, 1 - glossiness
