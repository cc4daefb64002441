"""`meshreel info` on files of several formats."""

import pytest

import meshreel
from samples.commands import assert_fails, run, run_json
from samples.materials import dressed_sheet
from samples.meshes import two_sheets, waving_grid


def test_info_prints_mesh_frame_rate_and_box_of_other_formats(tmp_path):
    meshreel.save(waving_grid(), tmp_path / "a.npz")
    shown = run("info", tmp_path / "a.npz").stdout
    for words in ("NumPy archive", "12 frames, 99 vertices, 160 faces", "fps", "float32", "x 0 to"):
        assert words in shown


def test_info_lists_the_meshes_when_there_are_several(tmp_path):
    meshreel.save(two_sheets(), tmp_path / "two.usda")
    done = run("info", tmp_path / "two.usda")
    assert done.returncode == 0
    for words in ("/root/a", "/root/b", "select one with --object"):
        assert words in done.stdout
    printed = run_json("info", tmp_path / "two.usda")
    assert [mesh["name"] for mesh in printed["meshes"]] == ["/root/a", "/root/b"]
    assert printed["meshes"][0]["n_frames"] == 6


def test_info_skips_bad_meshes_with_skip_bad(tmp_path):
    good = 'def Mesh "{}" {{\npoint3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\n'
    good += "int[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0, 1, {}]\n}}\n"
    text = "#usda 1.0\n" + good.format("fine", 2) + good.format("bad", 7)
    (tmp_path / "a.usda").write_text(text)
    listed = run_json("info", tmp_path / "a.usda")["meshes"]
    assert [mesh["problem"] is None for mesh in listed] == [True, False]
    assert_fails(run("info", tmp_path / "a.usda", "--merge"), "/bad")
    printed = run_json("info", tmp_path / "a.usda", "--merge", "--skip-bad")
    assert [mesh["name"] for mesh in printed["meshes"]] == ["/fine"]
    assert any("/bad" in one for one in printed["left_out"])


def test_info_detects_a_stream_with_another_extension(tmp_path):
    (tmp_path / "a.bin").write_bytes(meshreel.encode(waving_grid()))
    assert "budget_bytes" in run_json("info", tmp_path / "a.bin")


@pytest.mark.parametrize(
    "option", [["--merge"], ["--object", "a"], ["--fps", "24"], ["--skip-bad"]]
)
def test_info_rejects_input_options_for_a_stream(tmp_path, option):
    (tmp_path / "a.reel").write_bytes(meshreel.encode(waving_grid()))
    assert_fails(run("info", tmp_path / "a.reel", *option), "do not apply to a .reel")


def test_info_lists_materials_and_images_of_a_file(tmp_path):
    meshreel.save(dressed_sheet(), tmp_path / "a.glb")
    shown = " ".join(run("info", tmp_path / "a.glb").stdout.split())
    assert "'shade', image/png" in shown
    assert "gr\u00fcn: base color image" in shown
    (mesh,) = run_json("info", tmp_path / "a.glb")["meshes"]
    assert (len(mesh["materials"]), len(mesh["images"])) == (2, 2)
