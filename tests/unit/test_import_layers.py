"""The house of `docs/house.md`: rooms import downwards only, and never their neighbours."""

import ast
import re
import runpy
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import meshreel
from samples.sources import statements

ROOT = Path(meshreel.__file__).parent
HOUSE = (Path(__file__).parents[2] / "docs" / "house.md").read_text(encoding="utf-8")
FLOOR_OF = {
    room: int(floor)
    for floor, room in re.findall(r"^\| (\d+) \| `([a-z_]+)` \|", HOUSE, re.MULTILINE)
}
"""The table of `docs/house.md`; 0 is the lowest floor."""

SHOWN = {"showing"}
"""May import `notebook`: sequences and files show themselves, once they are asked to."""


NAMED = re.compile(r"meshreel\.([a-z_]+)(\.[a-z_.]*)?")
"""Text that is the name of a module, or its beginning: what is imported by name at run time."""

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
from meshreel.flag import simulate_flag

sequence = simulate_flag(4, n_rows=5, n_columns=4)
for method in ("reel", "lossless", "pca-qp"):
    meshreel.decode(meshreel.encode(sequence, method))
meshreel.info(meshreel.encode(sequence, max_error=1.0))
"""


def imported_rooms(source):
    """Rooms of meshreel that a module's text imports, or names as modules, wherever in it."""
    tree = ast.parse(source)
    rooms = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            named = NAMED.fullmatch(node.value)
            rooms |= {named[1]} & FLOOR_OF.keys() if named else set()
    for node in statements(tree):
        names = []
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        rooms |= {name.split(".")[1] for name in names if name.startswith("meshreel.")}
    return rooms


def forbidden(room, source):
    """Imports of a module in this room that do not go down."""
    return {
        other
        for other in imported_rooms(source)
        if other != room
        and FLOOR_OF[other] >= FLOOR_OF[room]
        and not (other == "notebook" and room in SHOWN)
    }


def room_of(path):
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


MODULES = sorted(path for path in ROOT.rglob("*.py") if path != ROOT / "__init__.py")


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_module_imports_only_downwards(path):
    assert forbidden(room_of(path), path.read_text(encoding="utf-8")) == set()


def imported_modules(folder):
    """Modules that those of a folder import."""
    nodes = [
        node
        for path in (ROOT / folder).rglob("*.py")
        for node in statements(ast.parse(path.read_text(encoding="utf-8")))
    ]
    return {node.module for node in nodes if isinstance(node, ast.ImportFrom) and node.module}


def test_agreed_mathematics_knows_neither_side_when_both_call_it():
    found = {name for name in imported_modules("reel/agreed") if name.startswith("meshreel.reel")}
    assert {name.split(".")[2] for name in found} == {"agreed"}


def test_every_room_has_a_floor_when_the_package_is_listed():
    assert {room_of(path) for path in MODULES} == set(FLOOR_OF)


def run_statements(tree):
    """Statements of a module but for what only type checkers see."""
    tree.body = [
        node
        for node in tree.body
        if not (isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING")
    ]
    return statements(tree)


def test_picture_of_the_house_is_that_of_its_table():
    docs = Path(__file__).parents[2] / "docs"
    drawn = runpy.run_path(str(docs / "house_picture.py"))["picture"](HOUSE)
    assert drawn == (docs / "images" / "house.svg").read_text(encoding="utf-8")


def test_modules_have_no_import_cycle_when_sorted():
    graph = {}
    for path in MODULES:
        name = ".".join(path.relative_to(ROOT.parent).with_suffix("").parts)
        graph[name] = {
            node.module
            for node in run_statements(ast.parse(path.read_text(encoding="utf-8")))
            if isinstance(node, ast.ImportFrom)
            and (node.module or "").startswith("meshreel.")
            and not (node.module.startswith("meshreel.notebook.") and room_of(path) in SHOWN)
        }
    TopologicalSorter(graph).prepare()


@pytest.mark.parametrize(
    ("room", "line"),
    [
        ("geometry", "from meshreel.codec.encoder import encode"),
        ("subspace", "import meshreel.paper.quantization"),
        ("errors", "def f():\n    from meshreel.sequence import MeshSequence"),
        ("codec", 'import_module("meshreel.paper.method")'),
        ("codec", 'import_module(f"meshreel.paper.{name}")'),
        ("codec", 'ROOMS = ("meshreel.reel",)\nimport_module(f"{ROOMS[0]}.options")'),
    ],
)
def test_forbidden_import_is_found_when_it_is_planted(room, line):
    assert forbidden(room, line)


def test_modules_import_only_downwards_while_they_run():
    """Imports by name count as well, also of names that are computed."""
    done = subprocess.run(
        [sys.executable, "-c", RUN], capture_output=True, text=True, timeout=120, check=True
    )
    pairs = [line.split() for line in done.stdout.splitlines()]
    assert ["meshreel.methods", "meshreel.paper.method"] in pairs
    rooms = {
        (importer.split(".")[1], name.split(".")[1])
        for importer, name in pairs
        if importer.startswith("meshreel.")
    }
    upwards = {(one, other) for one, other in rooms if FLOOR_OF[other] >= FLOOR_OF[one]}
    assert {(one, other) for one, other in upwards if one != other} == set()
