"""The house: rooms import downwards only, and rooms of one floor do not import each other."""

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import meshreel

ROOT = Path(meshreel.__file__).parent
FLOORS = [  # from the top
    {"__main__"},
    {"cli", "notebook"},
    {"evaluation", "batch", "viewer", "api"},
    {"formats"},
    {"paper", "reel"},
    {"codec", "rendering", "flag"},
    {"bitstream", "connectivity", "subspace", "metrics"},
    {"geometry", "entropy"},
    {"sequence", "surface_selection"},
    {"surface", "frame_choice"},
    {"materials"},
    {"runtime"},
    {"errors", "counting"},
]
SHOWN = {"sequence", "codec"}
"""Rooms that may import `notebook`: what they hold shows itself, once it is asked to."""
FLOOR_OF = {room: floor for floor, rooms in enumerate(FLOORS) for room in rooms}


def imported_rooms(source):
    """Rooms of meshreel that a module's text imports, wherever in it."""
    rooms = set()
    for node in ast.walk(ast.parse(source)):
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
        and FLOOR_OF[other] <= FLOOR_OF[room]
        and not (other == "notebook" and room in SHOWN)
    }


def room_of(path):
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


MODULES = sorted(path for path in ROOT.rglob("*.py") if path != ROOT / "__init__.py")


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_module_imports_only_downwards(path):
    assert forbidden(room_of(path), path.read_text(encoding="utf-8")) == set()


def test_every_room_has_a_floor_when_the_package_is_listed():
    assert {room_of(path) for path in MODULES} == set(FLOOR_OF)


def run_nodes(tree):
    """Nodes of a module but for what only type checkers see."""
    tree.body = [
        node
        for node in tree.body
        if not (isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING")
    ]
    return ast.walk(tree)


def test_modules_have_no_import_cycle_when_sorted():
    graph = {}
    for path in MODULES:
        name = ".".join(path.relative_to(ROOT.parent).with_suffix("").parts)
        graph[name] = {
            node.module
            for node in run_nodes(ast.parse(path.read_text(encoding="utf-8")))
            if isinstance(node, ast.ImportFrom)
            and (node.module or "").startswith("meshreel.")
            and not (node.module.startswith("meshreel.notebook.") and room_of(path) in SHOWN)
        }
    TopologicalSorter(graph).prepare()


@pytest.mark.parametrize(
    ("room", "line"),
    [
        ("geometry", "from meshreel.codec.encoder import encode"),
        ("subspace", "import meshreel.paper.quantization.uniform"),
        ("errors", "def f():\n    from meshreel.sequence import MeshSequence"),
    ],
)
def test_forbidden_import_is_found_when_it_is_planted(room, line):
    assert forbidden(room, line)
