import sys

import pytest

from meshreel.errors import FormatError
from meshreel.formats.load import load
from meshreel.formats.registry import described_formats
from meshreel.operations.save import save
from meshreel.runtime.extras import HDF, USD, Extra, require
from samples.meshes import waving_grid

MISSING = Extra("hdf", "h5py", "surely_not_installed")


@pytest.fixture
def without(monkeypatch):
    """Hide a library, as if its extra were not installed."""

    def remove(module):
        for name in [name for name in sys.modules if name.startswith(f"{module}.")]:
            monkeypatch.delitem(sys.modules, name)
        monkeypatch.setitem(sys.modules, module, None)

    return remove


@pytest.mark.parametrize(
    ("module", "extension", "extra"), [("h5py", ".h5", HDF), ("pxr", ".usdc", USD)]
)
def test_save_names_a_missing_extra_before_any_work(tmp_path, without, module, extension, extra):
    without(module)
    with pytest.raises(FormatError) as error:
        save(waving_grid(), tmp_path / f"a{extension}")
    assert f"this needs {extra.library}" in str(error.value)
    assert f"pip install 'meshreel[{extra.name}]'" in str(error.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("module", "extension"), [("h5py", ".h5"), ("pxr", ".usdc"), ("vtkmodules", ".e")]
)
def test_load_names_the_file_and_a_missing_extra(tmp_path, without, module, extension):
    path = tmp_path / f"a{extension}"
    path.write_bytes(b"whatever")
    without(module)
    with pytest.raises(FormatError, match=r"pip install 'meshreel\["):
        load(path)


def test_require_lists_all_missing_libraries_and_one_command():
    other = Extra("surely", "another library", "surely_not_installed_either")
    same = Extra("also", "h5py", "surely_not_installed")
    with pytest.raises(FormatError) as error:
        require([MISSING, HDF, other, same])
    assert str(error.value) == (
        "this needs h5py (No module named 'surely_not_installed') and another library (No module "
        "named 'surely_not_installed_either'); install them with: "
        "pip install 'meshreel[hdf,surely,also]'"
    )


def test_require_raises_nothing_when_everything_is_installed():
    require([HDF, USD])


def test_extra_without_its_module_is_not_installed():
    assert not MISSING.is_installed


def test_described_formats_name_their_extra():
    extras = {one["extension"]: one["extra"] for one in described_formats()}
    assert extras[".usdz"] == "usd"
    assert extras[".abc"] == "alembic"
    assert extras[".h5"] == "hdf"
    assert extras[".glb"] is extras[".obj"] is None


def test_described_formats_name_those_that_are_read_without_their_extra():
    read = {one["extension"] for one in described_formats() if one["reads_without_extra"]}
    assert {".abc", ".obj"} <= read
    assert not {".usd", ".h5", ".drc", ".vat"} & read
