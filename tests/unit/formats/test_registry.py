"""The registry: its functions exist and are imported lazily; options that formats support."""

import ast
import inspect
import sys
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import meshreel.formats
from meshreel.formats.kinds import FolderFormat
from meshreel.formats.options import Reading
from meshreel.formats.registry import FOLDER_FORMATS, FORMATS
from meshreel.formats.supported_options import supported_only
from meshreel.operations.save import save
from samples.costs import slow_but
from samples.meshes import waving_grid
from samples.programs import output_of
from samples.sources import statements

N_ARGUMENTS = {
    "read": 1,
    "encoder": 1,
    "open": 2,
    "write": 3,
    "read_meshes": 2,
    "data_files": 2,
    "other_files": 1,
    "list_animations": 2,
    "files": 2,
}
"""Number of arguments of each function of a row."""

ROOT = Path(meshreel.formats.__file__).parent
ALLOWED = {("vtk", "arrays"), ("vat", "gltf")}
"""Allowed imports between formats: VTKHDF stores our surface datasets, and the mesh of vertex
animation textures is a glTF file."""

LOADING = """
import sys
import meshreel
meshreel.load(sys.argv[1])
print(*sys.modules)
"""


def functions():
    """Yield the functions of all rows with their number of arguments."""
    for result in (*FORMATS.values(), *FOLDER_FORMATS.values()):
        for field in fields(result):
            function: Any = getattr(result, field.name)
            n_arguments = N_ARGUMENTS.get(field.name)
            if isinstance(result, FolderFormat) and field.name == "write":
                n_arguments += 1  # the stem of the file names
            if isinstance(function, partial):
                n_arguments += len(function.args)
                function = function.func
            if n_arguments and function is not None:
                name = f"{result.extension} {field.name} {function.__name__}"
                yield pytest.param(function, n_arguments, id=name)


FOLDERS = {"meshes", "vtk", "arrays", "alembic", "usd", "gltf", "solvers", "vat"}
"""Folders of `meshreel.formats` that belong to single formats."""


@pytest.mark.parametrize(("function", "n_arguments"), [*functions()])
def test_registry_functions_have_the_expected_signature(function, n_arguments):
    inspect.signature(function).bind(*range(n_arguments))


def loaded_modules(path):
    """Names of the modules that a process has imported after loading a file."""
    return output_of(sys.executable, "-c", LOADING, path).split()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("extension", "own"),
    slow_but(
        [(".pc2", {"meshes"})], [(".npz", {"arrays"}), (".stl", {"meshes"}), (".pc2", {"meshes"})]
    ),
)
def test_load_imports_only_what_a_format_needs(tmp_path, extension, own):
    save(waving_grid(n_frames=1), tmp_path / f"a{extension}")
    result = loaded_modules(tmp_path / f"a{extension}")
    folders = {name.split(".")[2] for name in result if name.startswith("meshreel.formats.")}
    assert folders & FOLDERS == own
    assert not {"scipy", "DracoPy", "h5py", "pxr"} & set(result)
    assert sum(name.split(".")[0] == "meshreel" for name in result) <= 90


def test_formats_are_imported_through_the_registry_only():
    result = set()
    for path in ROOT.rglob("*.py"):
        room = path.relative_to(ROOT).parts[0]
        for node in statements(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module.startswith("meshreel.formats."):
                other = node.module.split(".")[2]
                if other in FOLDERS - {room}:
                    result.add((room, other))
    assert result == ALLOWED


GIVEN = Reading(
    fps=24.0, object="body", merge=True, skip_bad=True, allow_outside=True, animation="run"
)
KEPT = {
    "a.npz": Reading(fps=24.0, merge=True),
    "a.h5": Reading(fps=24.0, object="body", merge=True, skip_bad=True),
    "a.glb": GIVEN,
}


@pytest.mark.parametrize("source", KEPT)
@pytest.mark.parametrize("kind", [str, Path])
def test_options_without_effect_are_left_out(source, kind):
    assert supported_only(GIVEN, kind(source)) == KEPT[source]
