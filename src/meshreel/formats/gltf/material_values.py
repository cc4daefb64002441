"""Values of materials, textures and samplers of a glTF file, checked."""

import math
from dataclasses import replace

from meshreel.errors import FormatError
from meshreel.formats.gltf.attributes import meaning
from meshreel.formats.gltf.json_object import JsonObject
from meshreel.formats.gltf.specular_glossiness import (
    MetallicRoughness,
    specular_glossiness,
    to_metallic_roughness,
)
from meshreel.model.materials import AlphaMode, Filter, Material, Texture, Wrap

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
LARGEST_MAGNIFIED = 9729
ALPHA_MODES = {"OPAQUE": AlphaMode.OPAQUE, "MASK": AlphaMode.MASK, "BLEND": AlphaMode.BLEND}

WRAP_CODES = {mode: code for code, mode in WRAPS.items()}
FILTER_CODES = {mode: code for code, mode in FILTERS.items()}
ALPHA_CODES = {mode: code for code, mode in ALPHA_MODES.items()}


def read_look(given: JsonObject) -> Material:
    """A material without its name and its textures.

    Raises
    ------
    FormatError
        If a value is not what it must be.
    """
    pbr = given.child("pbrMetallicRoughness") or JsonObject({}, given.place)
    other = specular_glossiness(given)
    mode = given.text("alphaMode", "OPAQUE")
    if mode not in ALPHA_MODES:
        raise given.error("alphaMode", "OPAQUE, MASK or BLEND")
    normal, occlusion = given.child("normalTexture"), given.child("occlusionTexture")
    model = _metallic_roughness(pbr) if other is None else to_metallic_roughness(other)
    return Material(
        "",
        base_color=model.base_color,
        metallic=model.metallic,
        roughness=model.roughness,
        emissive=_emissive(given),
        normal_scale=1.0 if normal is None else normal.number("scale", 1.0),
        occlusion_strength=1.0 if occlusion is None else occlusion.number("strength", 1.0),
        alpha_mode=ALPHA_MODES[mode],
        alpha_cutoff=given.number("alphaCutoff", 0.5) if mode == "MASK" else 0.5,
        double_sided=given.flag("doubleSided"),
        unlit=given.extension(UNLIT) is not None,
    )


def _metallic_roughness(pbr: JsonObject) -> MetallicRoughness:
    red, green, blue, opacity = pbr.numbers("baseColorFactor", 4, (1, 1, 1, 1)).tolist()
    metallic, roughness = pbr.number("metallicFactor", 1.0), pbr.number("roughnessFactor", 1.0)
    return MetallicRoughness((red, green, blue, opacity), metallic, roughness)


def _emissive(given: JsonObject) -> tuple[float, float, float]:
    extension = given.extension(STRENGTH)
    strength = 1.0 if extension is None else extension.number("emissiveStrength", 1.0)
    red, green, blue = (
        strength * one for one in given.numbers("emissiveFactor", 3, (0, 0, 0)).tolist()
    )
    if not all(map(math.isfinite, (red, green, blue))):
        raise FormatError(f"{given.place}: its emissive strength of {strength:g} is too large")
    return red, green, blue


def read_texture(told: JsonObject, image: int, channels: str) -> Texture:
    """A texture of this image, as a material tells of it."""
    moved = told.extension(TRANSFORM) or JsonObject({}, told.place)
    number = moved.whole("texCoord", told.whole("texCoord", 0))
    (label, _) = meaning(f"TEXCOORD_{min(number, 999)}") or ("", None)
    offset, scale = moved.numbers("offset", 2, (0, 0)), moved.numbers("scale", 2, (1, 1))
    return Texture(
        image,
        label,
        channels,
        offset=tuple(offset.tolist()),
        rotation=moved.number("rotation", 0.0),
        scale=tuple(scale.tolist()),
    )


def sampled(texture: Texture, sampler: JsonObject) -> Texture:
    """The texture with the wrap modes and filters of a sampler."""
    wrap_u, wrap_v = sampler.whole("wrapS", 10497), sampler.whole("wrapT", 10497)
    if wrap_u not in WRAPS or wrap_v not in WRAPS:
        raise FormatError(f"{sampler.place}: wraps by {wrap_u} and {wrap_v}, which glTF has not")
    magnified, shrunk = sampler.whole("magFilter", 0), sampler.whole("minFilter", 0)
    if not {magnified, shrunk} <= {0, *FILTERS} or magnified > LARGEST_MAGNIFIED:
        raise FormatError(
            f"{sampler.place}: filters by {magnified} and {shrunk}, which glTF has not"
        )
    return replace(
        texture,
        wrap_u=WRAPS[wrap_u],
        wrap_v=WRAPS[wrap_v],
        magnified=FILTERS.get(magnified),
        shrunk=FILTERS.get(shrunk),
    )
