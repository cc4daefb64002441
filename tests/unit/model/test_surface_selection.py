import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Surface
from meshreel.model.surface_selection import missing_names, select
from samples.materials import dressed_sheet
from samples.meshes import two_sheets


def names_of(surface):
    return [one.name for one in (*surface.attributes, *surface.groups)]


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
def test_selected_has_what_is_named_when_names_or_kinds_are(names, kept):
    assert names_of(select(two_sheets().surface, names)) == kept


def test_selected_keeps_polygons_and_parts_when_nothing_else_is_kept():
    surface = two_sheets().surface
    left = select(surface, "none")
    assert left.face_sizes is surface.face_sizes
    assert left.parts == surface.parts


def test_selected_is_the_surface_itself_when_all_is_kept():
    surface = two_sheets().surface
    assert select(surface, "all") is surface


def test_selected_lists_what_there_is_when_a_name_is_not_there():
    with pytest.raises(InvalidInputError) as error:
        select(two_sheets().surface, "uv,colour")
    said = "has no attribute or group 'colour'; it has 'st', 'color', 'material'"
    assert str(error.value) == said


@pytest.mark.parametrize("names", ["", "uv,,color", "uv,"])
def test_selected_refuses_names_when_one_is_empty(names):
    with pytest.raises(InvalidInputError, match="all, none, or names"):
        select(two_sheets().surface, names)


def test_other_is_no_name_when_it_is_only_a_kind():
    attribute = Attribute("heat", Kind.OTHER, Domain.VERTEX, np.zeros((3, 1), np.float32))
    groups = FaceGroups("material", ("red",), np.zeros(1, np.int32))
    assert missing_names(Surface(None, (attribute,), (groups,)), "other,heat") == ["other"]


@pytest.mark.parametrize(("names", "n_left"), [("none", 0), ("uv", 0), ("uv,material", 2)])
def test_materials_and_images_stay_when_their_groups_do(names, n_left):
    found = select(dressed_sheet().surface, names)
    assert (len(found.materials), len(found.images)) == (n_left, n_left)
