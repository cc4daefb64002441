"""Materials of `KHR_materials_pbrSpecularGlossiness` as metallic-roughness.

The conversion is that of the examples of the extension: the metalness is the one at which both
models reflect as much light, head on and diffusely.
"""

import math
from dataclasses import dataclass

import numpy as np

from meshreel.arrays import Floats
from meshreel.formats.gltf.json_object import JsonObject

SPECULAR_GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"
SPECULAR_TEXTURE = "specularGlossinessTexture"
DIELECTRIC = 0.04
"""Light that a surface without metal reflects head on."""
TYPICAL_GLOSSINESS = 0.5
"""In place of a texture of glossiness: images are not decoded."""
LUMA = np.array([0.299, 0.587, 0.114])
TINY = 1e-6


@dataclass(frozen=True)
class MetallicRoughness:
    """The numbers of a metallic-roughness material.

    Attributes
    ----------
    base_color : tuple of 4 floats
    """

    base_color: tuple[float, float, float, float]
    metallic: float
    roughness: float


def specular_glossiness(material: JsonObject) -> JsonObject | None:
    """The extension of a material that is described by it alone; None for any other."""
    if "pbrMetallicRoughness" in material:
        return None
    return material.extension(SPECULAR_GLOSSINESS)


def to_metallic_roughness(given: JsonObject) -> MetallicRoughness:
    """The metallic-roughness model of a specular-glossiness one.

    With a texture of specular colors and glossiness, which is not decoded, the material is taken to
    hold no metal, and to be half as glossy as without.

    Raises
    ------
    FormatError
        If a factor is not from 0 to 1.
    """
    red, green, blue, opacity = _factors(given, "diffuseFactor", 4)
    specular = _factors(given, "specularFactor", 3)
    glossiness = given.number("glossinessFactor", 1.0)
    if not 0 <= glossiness <= 1:
        raise given.error("glossinessFactor", "a number from 0 to 1")
    if SPECULAR_TEXTURE in given:
        roughness = 1 - TYPICAL_GLOSSINESS * glossiness
        return MetallicRoughness((red, green, blue, opacity), 0.0, roughness)
    color, metallic = _base_color(np.array([red, green, blue]), np.array(specular))
    return MetallicRoughness((*color, opacity), metallic, 1 - glossiness)


def _factors(given: JsonObject, key: str, length: int) -> list[float]:
    found = given.numbers(key, length, np.ones(length))
    if (found < 0).any() or (found > 1).any():
        raise given.error(key, f"a list of {length} numbers from 0 to 1")
    return [float(one) for one in found]


def _base_color(diffuse: Floats, specular: Floats) -> tuple[tuple[float, float, float], float]:
    """The base color, and the metalness."""
    left = 1 - float(specular.max())  # for diffuse light
    metallic = _metalness(_brightness(diffuse), _brightness(specular), left)
    of_diffuse = diffuse * left / (1 - DIELECTRIC) / max(1 - metallic, TINY)
    of_specular = (specular - DIELECTRIC * (1 - metallic)) / max(metallic, TINY)
    share = metallic**2
    red, green, blue = np.clip((1 - share) * of_diffuse + share * of_specular, 0, 1).tolist()
    return (red, green, blue), metallic


def _brightness(color: Floats) -> float:
    """As eyes see it."""
    return float(np.sqrt(LUMA @ color**2))


def _metalness(diffuse: float, specular: float, left: float) -> float:
    """The root of the quadratic equation that equates both models."""
    if specular < DIELECTRIC:
        return 0.0
    linear = diffuse * left / (1 - DIELECTRIC) + specular - 2 * DIELECTRIC
    root = math.sqrt(max(linear**2 - 4 * DIELECTRIC * (DIELECTRIC - specular), 0.0))
    return min(max((root - linear) / (2 * DIELECTRIC), 0.0), 1.0)
