"""Reading values of materials, textures and samplers of a glTF file."""

import math
from dataclasses import dataclass, replace

import numpy as np

from meshreel.arrays import Floats
from meshreel.errors import FormatError
from meshreel.formats.gltf.json_object import JsonObject
from meshreel.formats.gltf.primitives import meaning
from meshreel.model.materials import AlphaMode, Filter, Material, Texture, Wrap

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
