"""Reading materials of a glTF file with their textures, samplers and images."""

import base64
import binascii
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import PurePosixPath
from urllib.parse import unquote

import numpy as np

from meshreel.arrays import Floats
from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.file_errors import os_errors_naming
from meshreel.formats.gltf.accessors import (
    MAX_EXPANSION,
    MIN_EXPANDED_BYTES,
    Buffers,
    referenced_file,
)
from meshreel.formats.gltf.document import Document, JsonObject
from meshreel.formats.gltf.nodes import unique_names
from meshreel.formats.gltf.primitives import meaning, triangle_primitives
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

SPECULAR_GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"
SPECULAR_TEXTURE = "specularGlossinessTexture"
DIELECTRIC = 0.04
"""Specular reflectance of dielectrics at normal incidence."""
TYPICAL_GLOSSINESS = 0.5
"""Assumed value of glossiness textures, since images are not decoded."""
LUMA = np.array([0.299, 0.587, 0.114])
TINY = 1e-6

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
ALPHA_MODES = {"OPAQUE": AlphaMode.OPAQUE, "MASK": AlphaMode.MASK, "BLEND": AlphaMode.BLEND}

WRAP_CODES = {mode: code for code, mode in WRAPS.items()}
FILTER_CODES = {mode: code for code, mode in FILTERS.items()}
ALPHA_CODES = {mode: code for code, mode in ALPHA_MODES.items()}


@dataclass(frozen=True)
class MetallicRoughness:
    """Factors of a metallic-roughness material.

    Attributes
    ----------
    base_color : tuple of 4 floats
    metallic, roughness : float
    """

    base_color: tuple[float, float, float, float]
    metallic: float
    roughness: float


def specular_glossiness(material: JsonObject) -> JsonObject | None:
    """Return the extension of a material that has no metallic-roughness fallback, or None."""
    if "pbrMetallicRoughness" in material:
        return None
    return material.extension(SPECULAR_GLOSSINESS)


def to_metallic_roughness(specular_glossiness: JsonObject) -> MetallicRoughness:
    """Return the metallic-roughness model of a specular-glossiness one.

    Textures of specular colors and glossiness are not decoded: such a material is assumed to be
    dielectric and half as glossy as declared.

    Raises
    ------
    FormatError
        If a factor is outside of 0 to 1.
    """
    red, green, blue, opacity = _factors(specular_glossiness, "diffuseFactor", 4)
    specular = _factors(specular_glossiness, "specularFactor", 3)
    glossiness = specular_glossiness.number("glossinessFactor", 1.0)
    if not 0 <= glossiness <= 1:
        raise specular_glossiness.error("glossinessFactor", "a number from 0 to 1")
    if SPECULAR_TEXTURE in specular_glossiness:
        roughness = 1 - TYPICAL_GLOSSINESS * glossiness
        return MetallicRoughness((red, green, blue, opacity), 0.0, roughness)
    color, metallic = _base_color(np.array([red, green, blue]), np.array(specular))
    return MetallicRoughness((*color, opacity), metallic, 1 - glossiness)


def _factors(json: JsonObject, key: str, length: int) -> list[float]:
    factors = json.numbers(key, length, np.ones(length))
    if (factors < 0).any() or (factors > 1).any():
        raise json.error(key, f"a list of {length} numbers from 0 to 1")
    return [float(one) for one in factors]


def _base_color(diffuse: Floats, specular: Floats) -> tuple[tuple[float, float, float], float]:
    """Return the base color and the metalness."""
    diffuse_share = 1 - float(specular.max())
    metallic = _metalness(_brightness(diffuse), _brightness(specular), diffuse_share)
    from_diffuse = diffuse * diffuse_share / (1 - DIELECTRIC) / max(1 - metallic, TINY)
    from_specular = (specular - DIELECTRIC * (1 - metallic)) / max(metallic, TINY)
    weight = metallic**2
    red, green, blue = np.clip((1 - weight) * from_diffuse + weight * from_specular, 0, 1).tolist()
    return (red, green, blue), metallic


def _brightness(color: Floats) -> float:
    """Return the perceived brightness of a color."""
    return float(np.sqrt(LUMA @ color**2))


def _metalness(diffuse: float, specular: float, diffuse_share: float) -> float:
    """Return the root of the quadratic equation that equates both models."""
    if specular < DIELECTRIC:
        return 0.0
    linear = diffuse * diffuse_share / (1 - DIELECTRIC) + specular - 2 * DIELECTRIC
    root = math.sqrt(max(linear**2 - 4 * DIELECTRIC * (DIELECTRIC - specular), 0.0))
    return min(max((root - linear) / (2 * DIELECTRIC), 0.0), 1.0)


def read_look(material: JsonObject) -> Material:
    """Return a material without its name and textures.

    Raises
    ------
    FormatError
        If a value is invalid.
    """
    pbr = material.child("pbrMetallicRoughness") or JsonObject({}, material.place)
    specular = specular_glossiness(material)
    mode = material.text("alphaMode", "OPAQUE")
    if mode not in ALPHA_MODES:
        raise material.error("alphaMode", "OPAQUE, MASK or BLEND")
    normal, occlusion = material.child("normalTexture"), material.child("occlusionTexture")
    model = _metallic_roughness(pbr) if specular is None else to_metallic_roughness(specular)
    return Material(
        "",
        base_color=model.base_color,
        metallic=model.metallic,
        roughness=model.roughness,
        emissive=_emissive(material),
        normal_scale=1.0 if normal is None else normal.number("scale", 1.0),
        occlusion_strength=1.0 if occlusion is None else occlusion.number("strength", 1.0),
        alpha_mode=ALPHA_MODES[mode],
        alpha_cutoff=material.number("alphaCutoff", 0.5) if mode == "MASK" else 0.5,
        double_sided=material.flag("doubleSided"),
        unlit=material.extension(UNLIT) is not None,
    )


def _metallic_roughness(pbr: JsonObject) -> MetallicRoughness:
    red, green, blue, opacity = pbr.numbers("baseColorFactor", 4, (1, 1, 1, 1)).tolist()
    metallic, roughness = pbr.number("metallicFactor", 1.0), pbr.number("roughnessFactor", 1.0)
    return MetallicRoughness((red, green, blue, opacity), metallic, roughness)


def _emissive(material: JsonObject) -> tuple[float, float, float]:
    extension = material.extension(STRENGTH)
    strength = 1.0 if extension is None else extension.number("emissiveStrength", 1.0)
    red, green, blue = (
        strength * one for one in material.numbers("emissiveFactor", 3, (0, 0, 0)).tolist()
    )
    if not all(map(math.isfinite, (red, green, blue))):
        raise FormatError(f"{material.place}: its emissive strength of {strength:g} is too large")
    return red, green, blue


def read_texture(info: JsonObject, image: int, channels: str) -> Texture:
    """Return a texture of an image, from the texture info of a material."""
    transform = info.extension(TRANSFORM) or JsonObject({}, info.place)
    number = transform.integer("texCoord", info.integer("texCoord", 0))
    (label, _) = meaning(f"TEXCOORD_{min(number, 999)}") or ("", None)
    offset = transform.numbers("offset", 2, (0, 0))
    scale = transform.numbers("scale", 2, (1, 1))
    return Texture(
        image,
        label,
        channels,
        offset=tuple(offset.tolist()),
        rotation=transform.number("rotation", 0.0),
        scale=tuple(scale.tolist()),
    )


def with_sampler(texture: Texture, sampler: JsonObject) -> Texture:
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
