"""Tables of options are generated from the fields of the options."""

import importlib.util
from pathlib import Path

from meshreel.app.cli.options import ENCODING_OPTIONS
from meshreel.codec.options import all_options

SCRIPT = Path(__file__).parents[2] / "docs" / "option_texts.py"


def loaded():
    spec = importlib.util.spec_from_file_location("option_texts", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_tables_have_a_row_for_every_option():
    rows = [line.split(" | ") for line in loaded().options_tables().splitlines() if "| `" in line]
    assert {row[0] for row in rows} == {f"| `{option.name}`" for option in all_options()}
    assert {row[1] for row in rows} == {"", *(f"`{option.flag}`" for option in ENCODING_OPTIONS)}
