"""Options for encoding and writing on the command line."""

import json
import re
from typing import Annotated

import click
import pytest
from click.testing import CliRunner

from meshreel.app.cli.commands import command_named
from meshreel.app.cli.options import ENCODING
from meshreel.app.cli.parameters import with_parameters
from meshreel.codec.option import Option
from meshreel.codec.options import all_options
from meshreel.errors import InvalidInputError
from meshreel.formats.options import BOUNDS, GLTF, GLTF_AND_TEXTURES, RIGS, TEXTURES
from meshreel.formats.registry import FOLDER_FORMATS, FORMATS

PYTHON_ONLY = {
    "step",
    "energy",
    "bits",
    "allocation",
    "anchors",
    "choices",
    "laplacian",
    "n_iterations",
}
OPTIONS = {option.name: option for option in all_options() if option.name not in PYTHON_ONLY}
COMMANDS = ("encode", "convert", "batch")


def params(command):
    return {param.name: param for param in command_named(command).params}


@pytest.mark.parametrize("name", OPTIONS)
@pytest.mark.parametrize("command", COMMANDS)
def test_command_has_every_encoding_option(command, name):
    option, param = OPTIONS[name], params(command)[name]
    assert param.opts == [option.flag]
    assert param.panel == option.group
    if command != "convert" or name != "max_error":  # where it means more
        assert param.default == option.default


@pytest.mark.parametrize("name", [name for name, option in OPTIONS.items() if option.names])
@pytest.mark.parametrize("command", COMMANDS)
def test_names_are_completed(command, name):
    param = params(command)[name]
    assert param.shell_complete(None, "") != []
    begun = OPTIONS[name].names[-1]
    assert begun in [one.value for one in param.shell_complete(None, begun[:1])]


def received_by_command(*arguments):
    """Return the values that a command receives for these arguments."""

    def small(
        encoding: Annotated[dict, ENCODING], twice: Annotated[bool, Option("Again.")] = False
    ) -> None:
        click.echo(json.dumps([encoding, twice]))

    params, callback = with_parameters(small)
    command = click.Command("small", params=params, callback=callback)
    settings = {"catch_exceptions": False, "standalone_mode": False}
    return json.loads(CliRunner().invoke(command, arguments, **settings).output)


def test_command_receives_defaults():
    expected = {name: option.default for name, option in OPTIONS.items()}
    assert received_by_command() == [expected, False]


def test_command_receives_parsed_values():
    typed = ("--modes", "5", "--kg", "0.5", "--size", "1kB", "--order", "drop")
    encoding, twice = received_by_command(*typed, "--twice")
    assert twice is True
    changed = {name: value for name, value in encoding.items() if value != OPTIONS[name].default}
    assert changed == {"n_modes": 5, "kg": 0.5, "size": "1kB", "order": "drop"}


@pytest.mark.parametrize(
    ("flag", "typed", "message"),
    [
        ("--quality", "high", "--quality must be 1..100; got 'high'"),
        ("--kg", "much", "--kg must be above 0, in percent; got 'much'"),
        ("--modes", "2.5", "--modes must be a whole number of at least 1; got '2.5'"),
        ("--effort", "0", "--effort must be 1..9; got 0"),
    ],
)
def test_option_is_rejected_when_it_is_not_a_number_in_its_range(flag, typed, message):
    with pytest.raises(InvalidInputError, match=f"^{re.escape(message)}$"):
        received_by_command(flag, typed)


def test_help_contains_flags_instead_of_keywords():
    assert "if --max-error is a length" in params("encode")["unit"].help


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
            for name in ("normals", "meshopt", "layout", "textures", "rig")
        ),
    ],
)
def test_option_is_in_the_panel_of_its_outputs(command, name):
    panels = {param.name: getattr(param, "panel", "") for param in command_named(command).params}
    every = (*FORMATS.values(), *FOLDER_FORMATS.values())
    extensions = {one.extension for one in every if name in getattr(one, "write_options", ())}
    assert panels[name] == PANELS[frozenset(extensions - {".reel"})]


def test_unit_is_in_the_panel_of_the_error_bound():
    for command in ("encode", "decode", "convert", "batch"):
        panels = {
            param.name: getattr(param, "panel", "") for param in command_named(command).params
        }
        assert panels["unit"] == panels["max_error"]
