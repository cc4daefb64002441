"""Vertex animation textures written by `meshreel decode` and `convert`."""

import json

import pytest

import meshreel
from meshreel.formats.options import WriteOptions
from samples.commands import assert_fails, run, run_json, run_ok
from samples.meshes import waving_grid


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
