"""Conversion of specular-glossiness materials to metallic-roughness."""

import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.gltf.document import JsonObject
from meshreel.formats.gltf.materials import to_metallic_roughness
from meshreel.formats.load import load
from meshreel.model.materials import Material
from samples.gltf import SQUARE, SQUARE_FACES, Gltf
from samples.materials import png

NAME = "KHR_materials_pbrSpecularGlossiness"
CONVERTED = "converted from specular-glossiness to metallic-roughness: skin"


def converted(**values):
    color, metallic, roughness = to_metallic_roughness(JsonObject(values, "material 0"))
    return Material("", base_color=color, metallic=metallic, roughness=roughness)


def reflected(model):
    """Return diffuse and specular light of a metallic-roughness material, as glTF defines it."""
    base, metallic = np.array(model.base_color[:3]), model.metallic
    return base * (1 - 0.04) * (1 - metallic), 0.04 + (base - 0.04) * metallic


@pytest.mark.parametrize("diffuse", [[0.8, 0.2, 0.1], [0.5, 0.5, 0.5]])
def test_dielectric_reflects_the_same_light(diffuse):
    result = converted(diffuseFactor=[*diffuse, 0.25], specularFactor=[0.04] * 3)
    assert (result.metallic, result.roughness) == (pytest.approx(0, abs=1e-9), 0)
    assert result.base_color == pytest.approx([*diffuse, 0.25])


def test_black_dielectric_reflects_the_same_light():
    diffuse, specular = reflected(converted(diffuseFactor=[0, 0, 0, 1], specularFactor=[0.04] * 3))
    np.testing.assert_allclose(diffuse, 0, atol=1e-12)
    np.testing.assert_allclose(specular, 0.04)


def test_metal_has_its_specular_color_as_base_color():
    gold = [1.0, 0.766, 0.336]
    result = converted(diffuseFactor=[0, 0, 0, 1], specularFactor=gold, glossinessFactor=0.9)
    assert result.metallic == pytest.approx(1)
    assert result.base_color == pytest.approx([*gold, 1])
    assert result.roughness == pytest.approx(0.1)


@pytest.mark.parametrize("metallic", [0.1, 0.5, 0.9])
@pytest.mark.parametrize("gray", [0.3, 0.7])
def test_conversion_of_gray_inverts_metallic_roughness(metallic, gray):
    diffuse, specular = 0.96 * gray * (1 - metallic), 0.04 + (gray - 0.04) * metallic
    factor = diffuse / (1 - specular)
    result = converted(diffuseFactor=[factor, factor, factor, 1], specularFactor=[specular] * 3)
    assert result.metallic == pytest.approx(metallic)
    for one, light in zip(reflected(result), (diffuse, specular), strict=True):
        np.testing.assert_allclose(one, light, rtol=1e-9)


@pytest.mark.parametrize(
    "values", [{"specularFactor": [0, 0, 2]}, {"glossinessFactor": -1}, {"diffuseFactor": [1]}]
)
def test_factors_out_of_range_are_rejected(values):
    with pytest.raises(FormatError, match="material 0: "):
        converted(**values)


def square(extension, **material):
    file = Gltf()
    uv = file.accessor(np.array(SQUARE)[:, :2])
    mesh = file.mesh(SQUARE, SQUARE_FACES, attributes={"TEXCOORD_0": uv})
    material = {"name": "skin", "extensions": {NAME: extension}, **material}
    file.json["meshes"][mesh]["primitives"][0]["material"] = file.add("materials", **material)
    file.node(mesh=mesh)
    file.add("images", bufferView=file.view(png().data), mimeType="image/png")
    file.add("textures", source=0)
    file.json["extensionsRequired"] = [NAME]
    return file


def read(tmp_path, *extensions, **material):
    notes = []
    loaded = load(square(*extensions, **material).save(tmp_path / "a.glb"), notes=notes)
    return loaded.surface.materials[0], notes


def test_load_converts_a_material_and_keeps_its_diffuse_texture(tmp_path):
    extension = {
        "specularFactor": [0.04] * 3,
        "glossinessFactor": 0.75,
        "diffuseTexture": {"index": 0},
    }
    result, notes = read(tmp_path, extension, doubleSided=True)
    assert (result.metallic, result.roughness) == (pytest.approx(0, abs=1e-9), 0.25)
    assert result.base_color_texture.channels == "rgba"
    assert result.double_sided
    assert notes == [CONVERTED]


def test_load_notes_a_specular_texture_that_is_left_out(tmp_path):
    texture = {"diffuseFactor": [0.1, 0.2, 0.3, 1], "specularGlossinessTexture": {"index": 0}}
    result, notes = read(tmp_path, texture)
    assert (result.metallic, result.roughness) == (0, 0.5)
    assert result.base_color == (0.1, 0.2, 0.3, 1)
    assert notes == [
        CONVERTED,
        "left out: specular-glossiness textures, replaced by metalness 0 and half the glossiness: "
        "skin",
    ]


def test_metallic_roughness_has_precedence_over_the_extension(tmp_path):
    result, notes = read(tmp_path, {}, pbrMetallicRoughness={"roughnessFactor": 0.7})
    assert (result.metallic, result.roughness) == (1, 0.7)
    assert notes == [f"left out: extensions of materials: {NAME} (skin)"]
