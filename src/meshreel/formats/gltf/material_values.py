"""Reading values of materials, textures and samplers of a glTF file."""

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
MAX_MAG_FILTER = 9729
ALPHA_MODES = {"OPAQUE": AlphaMode.OPAQUE, "MASK": AlphaMode.MASK, "BLEND": AlphaMode.BLEND}

WRAP_CODES = {mode: code for code, mode in WRAPS.items()}
FILTER_CODES = {mode: code for code, mode in FILTERS.items()}
ALPHA_CODES = {mode: code for code, mode in ALPHA_MODES.items()}


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
