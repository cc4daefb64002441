"""`meshreel convert`, `encode --split` and `formats`; glTF and vertex textures as outputs."""

import json
import re
import sys

import pytest

import meshreel
from meshreel.formats.options import WriteOptions
from samples.commands import assert_fails, run, run_json, run_ok
from samples.materials import dressed_sheet
from samples.meshes import assert_same_surface, quad_sheet, waving_grid


@pytest.fixture
def sheet(tmp_path):
    path = tmp_path / "sheet.reel"
    path.write_bytes(meshreel.encode(quad_sheet(), max_error=0.01))
    return path


@pytest.fixture
def changing(tmp_path):
    """A folder of three frames of one mesh and two of another."""
    folder = tmp_path / "frames"
    folder.mkdir()
    meshreel.save(waving_grid(3), folder / "a_%02d.ply")
    meshreel.save(quad_sheet(2), folder / "b_%02d.ply")
    return folder


def test_convert_suggests_split_when_the_format_requires_constant_faces(changing, tmp_path):
    done = run("convert", changing, "-o", tmp_path / "a.mdd")
    assert_fails(done, "the faces change: 5 frames in 2 segments", "--split")


def test_encode_split_writes_a_stream_for_each_segment(changing, tmp_path):
    figures = run_json("encode", changing, "-o", tmp_path / "a.reel", "--split", "--fps", 10)
    assert [one["n_frames"] for one in figures["outputs"]] == [3, 2]
    first, second = (meshreel.load(tmp_path / f"a_{name}.reel") for name in ("0-2", "3-4"))
    assert (first.n_verts, second.n_verts, second.start_s) == (99, 30, 0.3)
    assert_same_surface(second.surface, meshreel.load(str(changing / "b_*.ply")).surface)


def test_encode_split_keeps_existing_files(changing, tmp_path):
    (tmp_path / "a_3-4.reel").write_bytes(b"mine")
    assert_fails(
        run("encode", changing, "-o", tmp_path / "a.reel", "--split"), "a_3-4.reel already exists"
    )
    assert not (tmp_path / "a_0-2.reel").exists()


@pytest.mark.parametrize("option", ["--object", "--topology", "--dataset"])
def test_encode_rejects_an_option_that_does_not_apply_to_the_format(changing, option, tmp_path):
    done = run("encode", changing, "-o", tmp_path / "a.reel", option, "x")
    assert_fails(done, f"{option} ", "has no effect on a .ply file")


def test_formats_lists_every_extension_as_json():
    listed = {one["extension"]: one for one in run_json("formats")["formats"]}
    assert {".reel", ".npz", ".obj", ".ply"} <= set(listed)
    assert all(one["is_installed"] == (one["extra"] is None) or one["extra"]
               for one in listed.values())  # fmt: skip
    assert run("formats").returncode == 0


def test_formats_says_when_an_extra_is_only_for_writing(monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    for module in ("alembic3d", "h5py"):
        monkeypatch.setitem(sys.modules, module, None)
    shown = run("formats").stdout
    rows = {line.split()[0]: line for line in shown.splitlines() if line.startswith("  .")}
    assert rows[".abc"].endswith(" [alembic], to write")
    assert rows[".h5"].endswith(" [hdf]")
    assert "pip install 'meshreel[alembic]'; 'meshreel[formats]' installs all" in shown


@pytest.fixture
def dressed(tmp_path):
    path = tmp_path / "dressed.reel"
    path.write_bytes(meshreel.encode(dressed_sheet(), max_error=0.01))
    return path


def test_convert_prints_the_folder_of_separate_images(dressed, tmp_path):
    pytest.importorskip("pxr")
    done = run("convert", dressed, "-o", tmp_path / "x.usda")
    assert "images in x_textures" in " ".join((done.stdout + done.stderr).split())
    figures = run_json("convert", dressed, "-o", tmp_path / "x.usda", "--force")
    folder = tmp_path / "x_textures"
    assert figures["outputs"][1:] == [str(folder / "shade.png"), str(folder / "photo.jpg")]


def test_decode_notes_when_the_format_has_no_images(dressed, tmp_path):
    figures = run_json("decode", dressed, "-o", tmp_path / "x.npz")
    looks = "material properties (red, gr\u00fcn) and 2 texture images"
    assert figures["notes"] == [f"left out, as .npz files cannot store it: {looks}"]


def test_info_lists_materials_and_images_of_a_stream(dressed):
    figures = run_json("info", dressed)
    n_bytes = len(dressed_sheet().surface.images[0].data)
    assert figures["images"][0] == f"0: 'shade', image/png, {n_bytes} bytes"
    assert figures["materials"][1] == "gr\u00fcn: base color image 1"
    assert figures["budget_bytes"]["image"] == figures["part_bytes"]["images"] > 200
    assert figures["budget_bytes"]["material"] < 400
    shown = " ".join(run("info", dressed).stdout.split())
    assert "0: 'shade', image/png" in shown


def test_convert_prints_the_frame_folder_of_a_collection(tmp_path):
    meshreel.save(waving_grid(3), tmp_path / "walk.npz")
    done = run_ok("convert", "walk.npz", "-o", "walk.pvd", cwd=tmp_path)
    assert "walk.pvd, frames in walk_frames" in " ".join(done.stdout.split())
    assert len(list((tmp_path / "walk_frames").iterdir())) == 3


@pytest.mark.slow
def test_decode_writes_the_folder_and_prints_the_achieved_error(tmp_path):
    stream = tmp_path / "walk.reel"
    meshreel.save(waving_grid(), stream, options=WriteOptions(max_error=0.05))
    done = run_ok("decode", stream, "-o", f"{tmp_path}/walk.vat/", "--max-error", "0.2")
    names = {path.name for path in (tmp_path / "walk.vat").iterdir()}
    assert names == {"walk.glb", "walk_vat.exr", "walk-remap_info.json"}
    for text in ("the largest error added is", "half-float EXR", "of video memory", "degrees"):
        assert text in done.stderr
    again = run("decode", stream, "-o", f"{tmp_path}/walk.vat/")
    assert_fails(again, "already exists")


def test_convert_uses_layout_and_textures(tmp_path):
    meshreel.save(waving_grid(), tmp_path / "walk.npz")
    figures = run_json(
        "convert", "walk.npz", "-o", "out.vat", "--layout", "openvat-unity", "--textures", "png",
        "--no-normals", cwd=tmp_path,
    )  # fmt: skip
    assert figures["outputs"] == [
        "out.vat/out.glb",
        "out.vat/out_vat.png",
        "out.vat/out-remap_info.json",
    ]
    files = (tmp_path / "out.vat").iterdir()
    assert figures["size_bytes"] == sum(file.stat().st_size for file in files)
    done = run("convert", "walk.npz", "-o", "out.glb", "--layout", "openvat", cwd=tmp_path)
    assert_fails(done, "--layout", "has no effect on a .glb file", ".vat")


def test_convert_writes_textures_of_each_segment_with_split(tmp_path):
    segments = [one.replace(fps=25.0) for one in (waving_grid(4), waving_grid(3, 5, 6))]
    data = meshreel.encode(meshreel.concatenate(segments), max_error=0.01)
    (tmp_path / "walk.reel").write_bytes(data)
    words = ("convert", "walk.reel", "-o", "walk.vat/")
    refused = run(*words, cwd=tmp_path)
    assert_fails(refused, "7 frames in 2 segments", "convert --split")
    assert [path.name for path in tmp_path.iterdir()] == ["walk.reel"]
    figures = run_json(*words, "--split", cwd=tmp_path)
    assert [one["n_frames"] for one in figures["outputs"]] == [4, 3]
    assert [one["n_verts"] for one in figures["outputs"]] == [99, 30]
    for name, segment in zip(("walk_0-3", "walk_4-6"), segments, strict=True):
        folder = tmp_path / f"{name}.vat"
        [description] = folder.glob("*.json")
        text = json.loads(description.read_text())
        assert text["os-remap"]["Frames"] == segment.n_frames
        rest = meshreel.load(folder / f"{name}.glb")
        assert rest.n_faces == len(segment.faces)
    errors = [note for note in figures["notes"] if "largest error is at most" in note]
    assert len(errors) == 2


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A sequence, its stream with an error bound of 0.05 %, and one without a bound."""
    folder = tmp_path_factory.mktemp("budget")
    meshreel.save(waving_grid(), folder / "grid.npz")
    (folder / "kept.reel").write_bytes(meshreel.encode(waving_grid(), max_error=0.05))
    (folder / "plain.reel").write_bytes(meshreel.encode(waving_grid()))
    return folder


@pytest.mark.parametrize("command", ["decode", "convert"])
@pytest.mark.parametrize("bound", [0.08, 0.3, None])
def test_glb_is_within_the_stated_error_when_the_stream_has_a_bound(
    folder, tmp_path, command, bound
):
    options = [] if bound is None else ["--max-error", bound]
    figures = run_json(command, folder / "kept.reel", "-o", tmp_path / "a.glb", *options)
    [note] = [note for note in figures["notes"] if note.startswith("against the original ")]
    total = float(re.search(r"at most ([\d.]+) %", note)[1])
    quality = run_json("compare", folder / "grid.npz", tmp_path / "a.glb")
    assert quality["max_error_percent"] <= total
    assert bound is None or total <= bound


@pytest.mark.parametrize("command", ["decode", "convert"])
def test_glb_is_rejected_when_its_bound_is_below_that_of_the_stream(folder, tmp_path, command):
    done = run(command, folder / "kept.reel", "-o", tmp_path / "a.glb", "--max-error", 0.04)
    assert_fails(done, "leaves nothing for morph targets", "itself has an error of up to 0.05")
    assert list(tmp_path.iterdir()) == []


def test_split_of_a_single_segment_is_compared_with_its_input(tmp_path):
    meshreel.save(meshreel.simulate_flag(2), path := tmp_path / "flag.npz")
    [whole] = run_json("encode", path, "-o", tmp_path / "a.reel", "--split")["outputs"]
    assert whole["input_size_bytes"] == path.stat().st_size
