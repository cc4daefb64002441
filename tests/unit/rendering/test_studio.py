"""The light of pictures: a studio, as in the player."""

import re
from pathlib import Path

import numpy as np
import pytest

from meshreel.model.colors import to_linear
from meshreel.model.materials import CLAY_MATERIAL
from meshreel.rendering.studio import (
    AREA_LIGHTS,
    CEILING,
    DIFFUSE,
    FLOOR,
    GLOW,
    HORIZON,
    TOWARDS_LIGHT,
    diffuse_light,
    shade,
    studio_light,
)

PLAYER = Path(__file__).parents[3] / "npm" / "src"


def directions(n_rings):
    """Unit vectors, each for the same solid angle."""
    y = (np.arange(n_rings) + 0.5) * 2 / n_rings - 1
    turn = (np.arange(2 * n_rings) + 0.5) * np.pi / n_rings
    y, turn = (axis.ravel() for axis in np.meshgrid(y, turn))
    radius = np.sqrt(1 - y**2)
    return np.stack([radius * np.cos(turn), y, radius * np.sin(turn)], -1).astype(np.float32)


def color(direction, base=128, glow=0.0):
    normal = np.array([direction], np.float32)
    normal /= np.linalg.norm(normal)
    colors = np.broadcast_to(np.array(base, np.float32), (1, 3))
    return shade(normal, colors, np.array([glow], np.float32))[0]


def test_light_comes_from_above_the_left_shoulder():
    turns = np.radians(np.arange(0, 360, 5))
    around = [color((np.cos(turn), np.sin(turn), 0.8)).mean() for turn in turns]
    assert 95 < np.degrees(turns[np.argmax(around)]) < 145
    assert color((-0.5, 0.7, 0.75)).mean() > 1.5 * color((0.5, -0.7, 0.75)).mean()


def test_diffuse_light_is_that_of_the_studio():
    sources, normals = directions(120), directions(10)
    cosines = np.maximum(normals @ sources.T, 0)
    exact = 4 * (cosines @ studio_light(sources, 0)) / len(sources)
    np.testing.assert_allclose(diffuse_light(normals), exact, atol=0.13)
    assert np.sqrt(np.mean((diffuse_light(normals) - exact) ** 2)) < 0.05


@pytest.mark.parametrize(
    ("roughness", "allowed"), [(0.1, 0.13), (0.3, 0.21), (0.6, 0.16), (1, 0.06)]
)
def test_rough_surfaces_blur_the_studio_as_ggx_does(roughness, allowed):
    sources, normals = directions(120), directions(10)
    light = studio_light(sources, 0)
    alpha2, exact = roughness**4, []
    for normal in normals:
        half = sources + normal
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        facets = alpha2 / ((half @ normal) ** 2 * (alpha2 - 1) + 1) ** 2
        weights = np.maximum(sources @ normal, 0) * facets
        exact.append(weights @ light / weights.sum())
    error = studio_light(normals, roughness) - exact
    assert np.sqrt(np.mean(error**2)) < allowed


def test_colors_change_little_where_the_light_is_1():
    """The tone mapping keeps the colors of materials, unlike that of films."""
    normal = np.array([0.149, 0.3, 0.942], np.float32)  # no area light is mirrored there
    assert diffuse_light(normal[None])[0] == pytest.approx(1, abs=0.05)
    for base in ((200, 60, 40), (40, 90, 180), (120, 120, 120)):
        np.testing.assert_allclose(color(normal, base), base, atol=12)


def test_colors_of_values_are_exact_in_front_and_keep_their_hue():
    base = np.array([200, 60, 40])
    np.testing.assert_allclose(color((0, 0, 1), base, GLOW), base, atol=0.01)
    dark = to_linear(color((0.6, -0.8, 0.1), base, GLOW)[None] / 255)[0]
    np.testing.assert_allclose(dark / to_linear(base[None] / 255)[0], GLOW, rtol=0.01)


def numbers(text):
    return [float(number) for number in re.findall(r"-?\d+\.\d+", text)]


def test_player_has_the_same_studio():
    shader = (PLAYER / "webgl" / "surface_shader.ts").read_text("utf-8")
    diffuse = re.search(r"float diffuseLight.*?\}", shader, re.S)[0]
    assert numbers(diffuse) == [*DIFFUSE]
    walls = re.search(r"float light = .*", shader)[0]
    assert numbers(walls)[:4] == [FLOOR, CEILING, 0.5, 2.0]
    assert 2 * HORIZON == 0.5
    assert "max(2.0 * blur, 0.5)" in walls
    lights = re.findall(r"step\(0.0, d.(\w)\) \* (.*), blur\)", shader)
    for (wall, text), (light, (axis, along), center, half_size) in zip(
        lights, AREA_LIGHTS, strict=True
    ):
        assert wall == "xyz"[axis]
        assert f"areaLight(d.{''.join('xyz'[i] for i in along)} * toWall.{wall}" in text
        assert numbers(text) == [light, *center, *half_size]
    relief = re.search(r"float relief = .*", shader)[0]
    assert numbers(relief)[:5] == [GLOW, round(1 - GLOW, 2), *TOWARDS_LIGHT]


def test_player_has_the_same_material():
    text = (PLAYER / "three" / "materials.ts").read_text("utf-8")
    level, roughness = re.search(r"color: 0x(\w\w)\1\1, roughness: ([\d.]+)", text).groups()
    assert float(roughness) == CLAY_MATERIAL.roughness
    linear = to_linear(np.array([[int(level, 16)]], np.uint8))[0, 0]
    np.testing.assert_allclose(CLAY_MATERIAL.base_color[:3], linear, atol=0.001)
