"""Modules import only modules below them, and includes of the core form no circle."""

import ast
import re
import runpy
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import meshreel
from samples.programs import output_of
from samples.sources import statements

PACKAGE = Path(meshreel.__file__).parent
DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "architecture.md").read_text(encoding="utf-8")
MODULES = re.findall(r"^\| (?:application|tools|codec|base) \| `([a-z_.]+)` \|", PAGE, re.MULTILINE)
PARTS = re.findall(r"^\| `([a-z]+)` \| `([a-z_.]+)` \|", PAGE, re.MULTILINE)

ABOVE_THEIR_MODULE = {"codec.reel", "app.cli", "app.notebook", "app.batch"}
"""Parts that import the rest of their module; the rest imports other parts."""

ROOT = "meshreel"
"""The package itself: it may import every module, and no module may import it."""

NAME = re.compile(r"meshreel\.([a-z_.]+)(:\w+)?")
"""A string that is the name of a module, or its beginning: an import by name."""


def ranks():
    """Rank of each module and part; 0 is the lowest."""
    order = []
    for module in MODULES:
        parts = [part for owner, part in PARTS if owner == module]
        upper = [part for part in parts if part in ABOVE_THEIR_MODULE]
        order += [*upper, module, *(part for part in parts if part not in upper)]
    return {name: rank for rank, name in enumerate([*reversed(order), ROOT])}


RANKS = ranks()


def unit_of(name):
    """Return the module or part of the tables that contains a Python module."""
    words = name.split(".")
    part = ".".join(words[:2])
    return part if part in RANKS else words[0]


def imported_modules(tree):
    """Names of the modules that a tree imports anywhere, or names in strings."""
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            named = NAME.fullmatch(node.value)
            names |= {named[1]} if named and named[1].split(".")[0] in RANKS else set()
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == ROOT:
            package = node.module.partition(".")[2]
            inner = {f"{package}.{alias.name}".removeprefix(".") for alias in node.names}
            modules = inner & NAMES
            names |= modules if modules == inner else {*modules, package or ROOT}
        elif isinstance(node, ast.Import):
            imported = [alias.name for alias in node.names if alias.name.split(".")[0] == ROOT]
            names |= {name.partition(".")[2] or ROOT for name in imported}
    return names


def forbidden(unit, source):
    """Imports of a module of this unit that do not point downward."""
    others = {unit_of(name) for name in imported_modules(ast.parse(source))}
    return {other for other in others if other != unit and RANKS[other] > RANKS[unit]}


def name_of(path):
    name = ".".join(path.relative_to(PACKAGE).with_suffix("").parts)
    return ROOT if name == "__init__" else name.removesuffix(".__init__")


FILES = sorted(PACKAGE.rglob("*.py"))
NAMES = {name_of(path) for path in FILES}


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_module_imports_point_downward(path):
    source = path.read_text(encoding="utf-8")
    assert forbidden(unit_of(name_of(path)), source) == set()


@pytest.mark.slow
@pytest.mark.parametrize(("unit", "other"), [("paper", "evaluation"), ("evaluation", "paper")])
def test_evaluation_and_paper_do_not_import_each_other(unit, other):
    for path in FILES:
        if name_of(path).startswith(unit):
            names = imported_modules(ast.parse(path.read_text(encoding="utf-8")))
            assert other not in {name.split(".")[0] for name in names}


def test_every_module_is_in_the_tables():
    assert {name.split(".")[0] for name in NAMES} == {
        ROOT, *(name.split(".")[0] for name in MODULES)
    }  # fmt: skip
    parts = [name for name in RANKS if "." in name]
    assert all((PACKAGE / part.replace(".", "/")).is_dir() for part in parts)


def test_normative_code_imports_nothing_of_the_encoder():
    nodes = [
        node
        for path in (PACKAGE / "codec/reel/normative").rglob("*.py")
        for node in statements(ast.parse(path.read_text(encoding="utf-8")))
    ]
    names = [node.module for node in nodes if isinstance(node, ast.ImportFrom) and node.module]
    own = {name for name in names if name.startswith("meshreel.codec.reel")}
    assert {name.split(".")[3] for name in own} == {"normative"}


def imported_libraries(source):
    """Top-level names of all imports of a module's text, also by name, anywhere in it."""
    names = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add(node.module or "")
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in ("import_module", "Extra"):
            names |= {arg.value for arg in node.args if isinstance(arg, ast.Constant)}
    return {name.partition(".")[0] for name in names}


def test_only_the_paper_imports_its_solvers():
    sources = {name_of(path): path.read_text(encoding="utf-8") for path in FILES}
    users = {
        name
        for name, source in sources.items()
        if "scipy" in source  # parsing all modules takes seconds
        and "scipy" in imported_libraries(source)
    }
    assert {name for name in users if unit_of(name) != "paper"} == {"runtime.extras"}


def test_only_code_that_draws_or_bakes_imports_pillow():
    users = {
        name_of(path)
        for path in FILES
        if "PIL" in path.read_text(encoding="utf-8")
        and "PIL" in imported_libraries(path.read_text(encoding="utf-8"))
    }
    baking = {"registration.baking", "operations.textures"}
    others = {name for name in users if unit_of(name) != "rendering"} - baking
    assert others == {"runtime.extras", "operations.render"}


def test_picture_shows_the_table():
    drawn = runpy.run_path(str(DOCS / "architecture_picture.py"))["picture"](PAGE)
    assert drawn == (DOCS / "images" / "architecture.svg").read_text(encoding="utf-8")


def test_modules_have_no_import_cycle():
    """Imports for type checkers count as well."""
    sources = {path: path.read_text(encoding="utf-8") for path in FILES}
    graph = {path: imported_modules(ast.parse(source)) for path, source in sources.items()}
    names = {name_of(path): imported - {name_of(path)} for path, imported in graph.items()}
    TopologicalSorter(names).prepare()


@pytest.mark.parametrize(
    ("unit", "line"),
    [
        ("model", "from meshreel.codec.encoder import encode"),
        ("codec", "import meshreel.paper.quantization"),
        ("codec.entropy", "from meshreel.codec.encoder import encode"),
        ("paper", "from meshreel.paper.study.tables import tables"),
        ("errors", "def f():\n    from meshreel.model.sequence import MeshSequence"),
        ("codec", 'import_module("meshreel.paper.method")'),
        ("codec", 'import_module(f"meshreel.paper.{name}")'),
        ("registration", "from meshreel import __version__"),
        ("app", "def f():\n    import meshreel"),
        ("codec", "from meshreel import api"),
        ("codec", 'TABLE = {"meshreel.app.cli.encode:encode_command": 1}'),
        ("codec", 'PACKAGES = ("meshreel.codec.reel",)\nimport_module(f"{PACKAGES[0]}.options")'),
    ],
)
def test_upward_import_is_found(unit, line):
    assert forbidden(unit, line)


RUN = """
import sys
from importlib.abc import MetaPathFinder

import numpy as np


class Watch(MetaPathFinder):
    def find_spec(self, name, path, target=None):
        frame = sys._getframe(1)
        while "importlib" in frame.f_code.co_filename:
            frame = frame.f_back
        if name.startswith("meshreel."):
            print(frame.f_globals["__name__"], name)


sys.meta_path.insert(0, Watch())
import meshreel

sequence = meshreel.simulate_flag(4, n_rows=5, n_columns=4)
for method in ("reel", "lossless", "pca-qp"):
    meshreel.decode(meshreel.encode(sequence, method))
meshreel.info(meshreel.encode(sequence, max_error=1.0))
"""


def test_imports_at_run_time_point_downward():
    """Imports by computed names count as well."""
    pairs = [line.split() for line in output_of(sys.executable, "-c", RUN).splitlines()]
    assert ["meshreel.methods", "meshreel.paper.method"] in pairs
    units = {
        (unit_of(importer.removeprefix("meshreel.")), unit_of(name.removeprefix("meshreel.")))
        for importer, name in pairs
        if importer.startswith("meshreel.")
    }
    upward = {(one, other) for one, other in units if RANKS[other] > RANKS[one]}
    # A package is imported before its parts.
    assert {pair for pair in upward if not pair[1].startswith(f"{pair[0]}.")} == set()


CORE = Path(__file__).parents[2] / "core"
C_FILES = sorted(file for folder in (CORE, CORE / "reader") for file in folder.glob("*.[ch]"))
INCLUDE = re.compile(r'^#include "(.+)"', re.MULTILINE)
FUNCTION = re.compile(r"^(?!static)[\w ]+?[ *]+(reel_\w+)\([^;{]*\)", re.MULTILINE)


def test_includes_of_the_core_form_no_circle():
    """A unit is a header with its source file; `reel.h` and `meshreel.h` have none."""
    units: dict[str, set[str]] = {}
    for file in C_FILES:
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
