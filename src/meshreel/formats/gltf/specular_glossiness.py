"""Conversion of `KHR_materials_pbrSpecularGlossiness` to metallic-roughness.

It follows the examples of the extension: at the resulting metalness, both models reflect the same
specular and diffuse light.
"""

import math
from dataclasses import dataclass

import numpy as np

from meshreel.arrays import Floats
from meshreel.formats.gltf.json_object import JsonObject

SPECULAR_GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"
SPECULAR_TEXTURE = "specularGlossinessTexture"
DIELECTRIC = 0.04
"""Specular reflectance of dielectrics at normal incidence."""
TYPICAL_GLOSSINESS = 0.5
"""Assumed value of glossiness textures, since images are not decoded."""
LUMA = np.array([0.299, 0.587, 0.114])
TINY = 1e-6


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
