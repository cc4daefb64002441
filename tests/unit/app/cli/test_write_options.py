"""Panels of the help name the outputs that their options are for."""

import pytest

from meshreel.app.cli.commands import command_named
from meshreel.app.cli.write_options import GLTF, GLTF_AND_TEXTURES, TEXTURES
from meshreel.formats.registry import FOLDER_FORMATS, FORMATS

PANELS = {
    frozenset({".glb", ".gltf"}): GLTF,
    frozenset({".glb", ".gltf", ".vat"}): GLTF_AND_TEXTURES,
    frozenset({".vat"}): TEXTURES,
}
"""By the extensions of outputs that an option has an effect on, beside .reel."""


@pytest.mark.parametrize(
    ("command", "name"),
    [
        *(("decode", name) for name in ("targets", "max_error", "normals", "layout", "textures")),
        *(("convert", name) for name in ("targets", "normals", "layout", "textures")),
    ],
)
def test_option_is_in_the_panel_of_the_outputs_it_is_for(command, name):
    panels = {param.name: getattr(param, "panel", "") for param in command_named(command).params}
    every = (*FORMATS.values(), *FOLDER_FORMATS.values())
    extensions = {one.extension for one in every if name in getattr(one, "writes", ())} - {".reel"}
    assert panels[name] == PANELS[frozenset(extensions)]


def test_unit_is_beside_the_bound_that_it_is_for():
    for command in ("encode", "decode", "convert", "batch"):
        panels = {one.name: getattr(one, "panel", "") for one in command_named(command).params}
        assert panels["unit"] == panels["max_error"]
