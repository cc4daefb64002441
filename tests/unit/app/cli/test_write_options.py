"""Help panels of options for certain outputs."""

import pytest

from meshreel.app.cli.commands import command_named
from meshreel.formats.options import BOUNDS, GLTF, GLTF_AND_TEXTURES, RIGS, TEXTURES
from meshreel.formats.registry import FOLDER_FORMATS, FORMATS

USD = (".usd", ".usda", ".usdc", ".usdz")
PANELS = {
    frozenset({".glb", ".gltf"}): GLTF,
    frozenset({".glb", ".gltf", ".vat"}): GLTF_AND_TEXTURES,
    frozenset({".vat"}): TEXTURES,
    frozenset({".glb", ".gltf", *USD}): RIGS,
    frozenset({".glb", ".gltf", ".vat", *USD}): BOUNDS,
}
"""Panels by the extensions of outputs to which an option applies, except .reel."""


@pytest.mark.parametrize(
    ("command", "name"),
    [
        ("decode", "max_error"),
        ("decode", "kg"),
        *(
            (command, name)
            for command in ("decode", "convert")
            for name in (
                "targets",
                "normals",
                "compression",
                "meshopt",
                "layout",
                "textures",
                "rig",
            )
        ),
    ],
)
def test_option_is_in_the_panel_of_its_outputs(command, name):
    panels = {param.name: getattr(param, "panel", "") for param in command_named(command).params}
    every = (*FORMATS.values(), *FOLDER_FORMATS.values())
    extensions = {one.extension for one in every if name in getattr(one, "writes", ())} - {".reel"}
    assert panels[name] == PANELS[frozenset(extensions)]


def test_unit_is_in_the_panel_of_the_error_bound():
    for command in ("encode", "decode", "convert", "batch"):
        panels = {
            param.name: getattr(param, "panel", "") for param in command_named(command).params
        }
        assert panels["unit"] == panels["max_error"]
