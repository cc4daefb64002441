"""Referenced files outside the folder are read only with `--allow-outside`."""

import pytest

import meshreel
from samples.commands import assert_fails, run
from samples.meshes import waving_grid

OUTPUTS = {
    "batch": ["out"],
    "encode": ["-o", "out.reel"],
    "render": ["-o", "out.png", "--size", "320x180"],
}


@pytest.fixture
def collection(tmp_path):
    """A ParaView collection whose only file is outside its folder."""
    folder = tmp_path / "in"
    folder.mkdir()
    meshreel.save(waving_grid(1), tmp_path / "frame.vtp")
    text = '<Collection><DataSet file="../frame.vtp"/></Collection>'
    (folder / "walk.pvd").write_text(f'<VTKFile type="Collection">{text}</VTKFile>')
    return folder / "walk.pvd"


@pytest.mark.slow
@pytest.mark.parametrize("command", OUTPUTS)
def test_file_outside_the_folder_is_read_only_with_allow_outside(collection, tmp_path, command):
    source = collection.parent if command == "batch" else collection
    arguments = (command, source, *OUTPUTS[command])
    assert_fails(run(*arguments, cwd=tmp_path), "outside its folder")
    assert run(*arguments, "--allow-outside", cwd=tmp_path).returncode == 0
