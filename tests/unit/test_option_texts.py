"""Texts that are written from the table of options are those of the table as it is."""

import importlib.util
from pathlib import Path

import pytest

from meshreel.codec.options import all_options

SCRIPT = Path(__file__).parents[2] / "docs" / "option_texts.py"


def loaded():
    spec = importlib.util.spec_from_file_location("option_texts", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


TEXTS = loaded()


@pytest.mark.parametrize("path", TEXTS.WRITTEN, ids=lambda path: path.name)
def test_source_is_what_the_table_says(path):
    source = path.read_text(encoding="utf-8")
    advice = "run `python docs/option_texts.py --write`"
    assert TEXTS.WRITTEN[path](source) == source, advice


@pytest.mark.parametrize("path", TEXTS.WRITTEN, ids=lambda path: path.name)
def test_source_is_brought_up_to_date_when_an_option_was_left_out(path):
    source = path.read_text(encoding="utf-8")
    older = "".join(line for line in source.splitlines(True) if "uv_bits: int" not in line)
    assert older != source
    assert TEXTS.WRITTEN[path](older) == source


def test_tables_have_a_row_for_every_option():
    rows = [line.split(" | ") for line in TEXTS.options_tables().splitlines() if "| `" in line]
    assert {row[0] for row in rows} == {f"| `{option.name}`" for option in all_options()}
    assert {row[1] for row in rows} == {f"`{option.flag}`" for option in all_options()}
