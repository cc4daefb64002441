"""Conversion of specular-glossiness materials to metallic-roughness."""

import numpy as np

from meshreel.formats.load import load
from samples.gltf import SQUARE, SQUARE_FACES, Gltf
from samples.materials import png

NAME = "KHR_materials_pbrSpecularGlossiness"
CONVERTED = (
    "converted from specular-glossiness to metallic-roughness, without specular colors: skin"
)


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
        "diffuseFactor": [0.1, 0.2, 0.3, 1],
        "specularFactor": [1.0, 0.766, 0.336],
        "glossinessFactor": 0.75,
        "diffuseTexture": {"index": 0},
    }
    result, notes = read(tmp_path, extension, doubleSided=True)
    assert (result.metallic, result.roughness) == (0, 0.25)
    assert result.base_color == (0.1, 0.2, 0.3, 1)
    assert result.base_color_texture.channels == "rgba"
    assert result.double_sided
    assert notes == [CONVERTED]


def test_material_with_a_texture_of_glossiness_is_matte(tmp_path):
    result, notes = read(tmp_path, {"specularGlossinessTexture": {"index": 0}})
    assert (result.metallic, result.roughness) == (0, 1)
    assert notes == [CONVERTED]


def test_metallic_roughness_has_precedence_over_the_extension(tmp_path):
    result, notes = read(tmp_path, {}, pbrMetallicRoughness={"roughnessFactor": 0.7})
    assert (result.metallic, result.roughness) == (1, 0.7)
    assert notes == [f"left out: extensions of materials: {NAME} (skin)"]
