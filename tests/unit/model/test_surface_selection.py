import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Surface
from meshreel.model.surface_selection import missing_names, select
from samples.materials import dressed_sheet
from samples.meshes import two_sheets


def names_of(surface):
    return [attribute.name for attribute in (*surface.attributes, *surface.groups)]


@pytest.mark.parametrize(
    ("names", "kept"),
    [
        ("all", ["st", "color", "material"]),
        ("none", []),
        ("st", ["st"]),
        ("uv", ["st"]),
        ("material, color", ["color", "material"]),
        (["color", "st"], ["st", "color"]),
        ([], []),
    ],
)
def test_select_keeps_named_attributes_and_kinds(names, kept):
    assert names_of(select(two_sheets().surface, names)) == kept


def test_select_always_keeps_polygons_and_parts():
    surface = two_sheets().surface
    selected = select(surface, "none")
    assert selected.face_sizes is surface.face_sizes
    assert selected.parts == surface.parts


def test_select_all_returns_the_surface_itself():
    surface = two_sheets().surface
    assert select(surface, "all") is surface


def test_error_lists_the_attributes_when_a_name_does_not_exist():
    with pytest.raises(InvalidInputError) as error:
        select(two_sheets().surface, "uv,colour")
    message = "has no attribute or group 'colour'; it has 'st', 'color', 'material'"
    assert str(error.value) == message


@pytest.mark.parametrize("names", ["", "uv,,color", "uv,"])
def test_select_rejects_empty_names(names):
    with pytest.raises(InvalidInputError, match="all, none, or names"):
        select(two_sheets().surface, names)


def test_kind_other_is_not_a_name():
    attribute = Attribute("heat", Kind.OTHER, Domain.VERTEX, np.zeros((3, 1), np.float32))
    groups = FaceGroups("material", ("red",), np.zeros(1, np.int32))
    assert missing_names(Surface(None, (attribute,), (groups,)), "other,heat") == ["other"]


@pytest.mark.parametrize(("names", "n_left"), [("none", 0), ("uv", 0), ("uv,material", 2)])
def test_materials_and_images_are_kept_with_their_groups(names, n_left):
    selected = select(dressed_sheet().surface, names)
    assert (len(selected.materials), len(selected.images)) == (n_left, n_left)
