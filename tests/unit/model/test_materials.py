from dataclasses import replace

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.model.materials import Filter, Material, Texture, select_materials
from meshreel.model.surface import Surface
from samples.materials import look, png

SHOWN = Material("a", base_color_texture=Texture(0))


@pytest.mark.parametrize(
    ("material", "message"),
    [
        (replace(SHOWN, base_color_texture=Texture(1)), "refers to image 1; there are 1"),
        (replace(SHOWN, base_color_texture=Texture(0, channels="r")), "allowed are rgb, rgba"),
        (replace(SHOWN, metallic_texture=Texture(0)), "allowed are r, g, b, a"),
        (replace(SHOWN, base_color=(1.0, 1.0, 1.0)), "base_color of material 'a' must have 4"),
        (replace(SHOWN, roughness=float("nan")), "roughness of material 'a' must be finite"),
        (replace(SHOWN, roughness=None), "roughness of material 'a' must be finite; got None"),
        (replace(SHOWN, alpha_mode="clear"), "must be one of opaque, mask, blend; got 'clear'"),
        (
            replace(SHOWN, base_color_texture=Texture(0, magnified=Filter.LINEAR_MIPMAP_LINEAR)),
            "must be one of nearest, linear",
        ),
    ],
)
def test_surface_is_refused_when_a_material_is_wrong(material, message):
    with pytest.raises(InvalidInputError) as error:
        Surface(materials=(material,), images=(png(),)).validated(3, 1)
    assert message in str(error.value)


def test_surface_is_refused_when_two_materials_have_one_name():
    with pytest.raises(InvalidInputError, match="2 materials are named 'a'"):
        Surface(materials=(Material("a"), Material("a"))).validated(3, 1)


def test_materials_keep_every_value_when_validated():
    materials, images = look()
    assert Surface(materials=materials, images=images).validated(3, 1).materials == materials


def test_numbers_of_numpy_become_plain_when_validated():
    given = Material("a", roughness=np.float32(0.5), alpha_mode="mask")
    (found,) = Surface(materials=(given,)).validated(3, 1).materials
    assert type(found.roughness) is float
    assert found.alpha_mode.name == "MASK"


def test_only_images_that_are_shown_stay_when_materials_are_chosen():
    materials, images = look()
    (found,), (image,) = select_materials(["gr\u00fcn", "none"], materials, images)
    assert found.name == "gr\u00fcn"
    assert (found.base_color_texture.image, image) == (0, images[1])


def test_size_counts_images_when_a_surface_has_some():
    materials, images = look()
    assert Surface(materials=materials, images=images).size_bytes == sum(
        len(one.data) for one in images
    )


def test_nothing_of_the_look_is_left_when_materials_are_taken_away():
    materials, images = look()
    assert Surface(materials=materials, images=images).without_materials().is_plain
