"""Light of a neutral studio around the camera, as in the player (npm/src/webgl/surface_shader.ts).

Directions are unit vectors of shape (N, 3) in the axes of the camera: to the right, up, towards the
viewer. Light has shape (N,); a white surface without gloss reflects 1 of uniform light 1.
"""

import numpy as np

from meshreel.arrays import Singles
from meshreel.model.colors import to_linear, to_srgb
from meshreel.model.materials import CLAY_MATERIAL

FLOOR, CEILING, HORIZON = 0.14, 0.44, 0.25
"""Light of the floor, what the upper half adds, and half the height of the transition."""

AREA_LIGHTS = (
    (5.0, (1, (0, 2)), (-0.8, 1.0), (0.7, 0.6)),
    (6.0, (0, (1, 2)), (0.3, -0.6), (0.8, 0.3)),
    (3.2, (2, (0, 1)), (-1.0, 0.25), (0.3, 0.8)),
)
"""Light, axis of the wall and those along it, center and half the size; the walls are at 1."""

DIFFUSE = (0.829, 0.124, 0.525, 0.091, -0.098, 0.201, -0.567, 0.073)
"""Factors of 1, x, y, z, xy, yz, xz and xx - zz in the diffuse light, fitted to the studio."""

TOWARDS_LIGHT = (-0.36, 0.54, 1.0)
"""Direction of the light on colors of values, so long that those that face the camera are exact."""

GLOW = 0.62
"""Share of the color of values that is not shaded: the form is visible, and colors that face the
camera match the color bar.
"""


def studio_light(directions: Singles, roughness: float) -> Singles:
    """Return the light from directions, blurred as a surface of a roughness reflects it."""
    blur = max(1.33 * roughness - 0.085, 0.01)
    up = 0.5 + directions[:, 1] / max(2 * blur, 2 * HORIZON)
    light = FLOOR + CEILING * up.clip(0, 1)
    for intensity, (axis, along), center, half_size in AREA_LIGHTS:
        distance = directions[:, axis]
        away = directions[:, along] / np.maximum(distance, 0.001)[:, None] - np.array(
            center, np.float32
        )
        size = np.array(half_size, np.float32)
        covered = (size + blur - np.abs(away)) / (2 * blur)
        covered = np.clip(covered, 0, np.minimum(size / blur, 1))
        light += intensity * (distance >= 0) * covered[:, 0] * covered[:, 1]
    share = np.float32(min(1.47 * roughness**2, 1.0))
    return np.asarray(light + share * (diffuse_light(directions) - light), np.float32)


def diffuse_light(normals: Singles) -> Singles:
    """Return the light that a white surface without gloss reflects."""
    x, y, z = normals.T
    c = np.array(DIFFUSE, np.float32)
    linear = c[0] + c[1] * x + c[2] * y + c[3] * z
    return np.asarray(linear + c[4] * x * y + c[5] * y * z + c[6] * x * z + c[7] * (x * x - z * z))


def shade(normals: Singles, colors: Singles, glow: Singles) -> Singles:
    """Return the colors of surface points, float32 of shape (N, 3), sRGB in 0..255.

    Parameters
    ----------
    normals : float32 array of shape (N, 3)
        Unit normals of the visible side in the axes of the camera.
    colors : float32 array of shape (N, 3)
        Surface colors, sRGB in 0..255.
    glow : float32 array of shape (N,)
        0 for surfaces in the studio; else as in `meshreel.rendering.rasterizer.render`.
    """
    base = to_linear(colors / 255).astype(np.float32)
    relief = np.clip(normals @ np.array(TOWARDS_LIGHT, np.float32), 0, 1)
    light = base * (glow + (1 - glow) * relief)[:, None]
    is_lit = glow == 0
    if is_lit.any():
        light[is_lit] = _tone_mapped(_reflected(normals[is_lit], base[is_lit]))
    return np.asarray(255 * to_srgb(light.clip(0, 1)), np.float32)


def _reflected(normals: Singles, base: Singles) -> Singles:
    """Return the light that surfaces of the default gloss reflect to the viewer.

    The factors are those of https://www.unrealengine.com/en-US/blog/physically-based-shading-on-mobile
    """
    rough = CLAY_MATERIAL.roughness
    facing = np.maximum(normals[:, 2], 0)
    mirrored = 2 * facing[:, None] * normals
    mirrored[:, 2] -= 1
    mirrored += np.float32(rough**4) * (normals - mirrored)
    mirrored /= np.sqrt(np.einsum("nc,nc->n", mirrored, mirrored))[:, None]
    edge = np.minimum((1 - rough) ** 2, np.exp2(-9.28 * facing)) * (1 - rough)
    edge += 0.0425 - 0.0275 * rough
    gloss = 0.04 * (1.04 - 0.572 * rough - 1.04 * edge) + 1.04 * edge + 0.022 * rough - 0.04
    shine = gloss * studio_light(mirrored, rough)
    light = base * ((1 - gloss) * diffuse_light(normals))[:, None] + shine[:, None]
    return np.asarray(light, np.float32)


def _tone_mapped(light: Singles) -> Singles:
    """Compress highlights and keep other colors: the tone mapping "PBR Neutral" of Khronos."""
    least = light.min(axis=1, keepdims=True)
    light = light - np.where(least < 0.08, least - 6.25 * least**2, 0.04)
    peak = light.max(axis=1, keepdims=True)
    mapped = np.where(peak < 0.76, peak, 1 - 0.0576 / np.maximum(peak - 0.52, 0.24))
    saturation = 1 / (0.15 * (peak - mapped) + 1)
    toned = mapped + saturation * (light * mapped / np.maximum(peak, 1e-6) - mapped)
    return np.asarray(toned, np.float32)
