from dataclasses import replace

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.model.materials import Filter, Material, Texture, select_materials
from meshreel.model.surface import Surface
from samples.materials import look, png

TRIANGLE = np.array([[0, 1, 2]])
TEXTURED = Material("a", base_color_texture=Texture(0))


@pytest.mark.parametrize(
    ("material", "message"),
    [
        (replace(TEXTURED, base_color_texture=Texture(1)), "refers to image 1; there are 1"),
        (replace(TEXTURED, base_color_texture=Texture(0, channels="r")), "allowed are rgb, rgba"),
        (replace(TEXTURED, metallic_texture=Texture(0)), "allowed are r, g, b, a"),
        (replace(TEXTURED, base_color=(1.0, 1.0, 1.0)), "base_color of material 'a' must have 4"),
        (replace(TEXTURED, roughness=float("nan")), "roughness of material 'a' must be finite"),
        (replace(TEXTURED, roughness=None), "roughness of material 'a' must be finite; got None"),
        (replace(TEXTURED, alpha_mode="clear"), "must be one of opaque, mask, blend; got 'clear'"),
        (
            replace(TEXTURED, base_color_texture=Texture(0, magnified=Filter.LINEAR_MIPMAP_LINEAR)),
            "must be one of nearest, linear",
        ),
    ],
)
def test_surface_is_rejected_when_a_material_is_invalid(material, message):
    with pytest.raises(InvalidInputError) as error:
        Surface(materials=(material,), images=(png(),)).validated(3, TRIANGLE)
    assert message in str(error.value)


def test_surface_is_rejected_when_two_materials_have_the_same_name():
    with pytest.raises(InvalidInputError, match="2 materials have the name 'a'"):
        Surface(materials=(Material("a"), Material("a"))).validated(3, TRIANGLE)


def test_materials_keep_every_value_when_validated():
    materials, images = look()
    assert Surface(materials=materials, images=images).validated(3, TRIANGLE).materials == materials


def test_validated_converts_numpy_numbers():
    numpy_material = Material("a", roughness=np.float32(0.5), alpha_mode="mask")
    (material,) = Surface(materials=(numpy_material,)).validated(3, TRIANGLE).materials
    assert type(material.roughness) is float
    assert material.alpha_mode.name == "MASK"


def test_selected_materials_keep_only_their_images():
    materials, images = look()
    (material,), (image,) = select_materials(["gr\u00fcn", "none"], materials, images)
    assert material.name == "gr\u00fcn"
    assert (material.base_color_texture.image, image) == (0, images[1])


def test_size_of_a_surface_leaves_images_out():
    materials, images = look()
    assert Surface(materials=materials, images=images).size_bytes == 0


def test_without_materials_removes_materials_and_images():
    materials, images = look()
    assert Surface(materials=materials, images=images).without_materials().is_plain
