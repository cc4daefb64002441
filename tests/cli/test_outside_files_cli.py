"""Files that other files refer to are read from the same folder only, unless allowed otherwise."""

import pytest

import meshreel
from samples.commands import assert_fails, run
from samples.meshes import waving_grid

OUTPUTS = {"batch": ["out"], "encode": ["-o", "out.reel"], "render": ["-o", "out.png"]}


@pytest.fixture
def collection(tmp_path):
    """A collection of ParaView whose only file is outside its folder."""
    folder = tmp_path / "in"
    folder.mkdir()
    meshreel.save(waving_grid(1), tmp_path / "frame.vtp")
    text = '<Collection><DataSet file="../frame.vtp"/></Collection>'
    (folder / "walk.pvd").write_text(f'<VTKFile type="Collection">{text}</VTKFile>')
    return folder / "walk.pvd"


@pytest.mark.parametrize("command", OUTPUTS)
def test_file_outside_is_read_only_when_that_is_allowed(collection, tmp_path, command):
    given = collection.parent if command == "batch" else collection
    asked = (command, given, *OUTPUTS[command])
    assert_fails(run(*asked, cwd=tmp_path), "outside its folder")
    assert run(*asked, "--allow-outside", cwd=tmp_path).returncode == 0
