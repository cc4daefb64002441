"""Includes of the core form no circle, also through functions that a header declares."""

import re
from graphlib import TopologicalSorter
from pathlib import Path

CORE = Path(__file__).parents[2] / "core"
FILES = sorted(file for folder in (CORE, CORE / "reader") for file in folder.glob("*.[ch]"))
INCLUDE = re.compile(r'^#include "(.+)"', re.MULTILINE)
FUNCTION = re.compile(r"^(?!static)[\w ]+?[ *]+(reel_\w+)\([^;{]*\)", re.MULTILINE)


def test_includes_of_the_core_form_no_circle():
    """A unit is a header with its source file; `reel.h` and `meshreel.h` have none."""
    units: dict[str, set[str]] = {}
    for file in FILES:
        unit = str(file.relative_to(CORE).with_suffix(""))
        for path in INCLUDE.findall(file.read_text()):
            included = (file.parent / path).resolve().relative_to(CORE.resolve())
            units.setdefault(unit, set()).add(str(included.with_suffix("")))
        units.get(unit, set()).discard(unit)
    assert len(list(TopologicalSorter(units).static_order())) > 40


def test_functions_of_a_reader_header_are_defined_in_its_source_file():
    """Otherwise files could call each other in circles through one header."""
    n_functions = 0
    for header in (CORE / "reader").glob("*.h"):
        text = header.read_text()
        declared = set(FUNCTION.findall(text))
        inline = {name for name in declared if re.search(rf"\b{name}\([^;]*?\) {{", text)}
        source = header.with_suffix(".c")
        defined = set(FUNCTION.findall(source.read_text())) if source.exists() else set()
        assert declared - inline <= defined, header.name
        n_functions += len(declared - inline)
    assert n_functions > 40
