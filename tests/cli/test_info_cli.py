"""`meshreel info` on files of several formats, and notes on their ignored contents."""

import json
import subprocess
import sys

import numpy as np
import pytest

import meshreel
from meshreel.model.tracks import Track
from meshreel.operations.save import save
from samples.commands import assert_fails, run, run_json, run_ok
from samples.materials import dressed_sheet
from samples.meshes import quad_sheet, two_sheets, waving_grid


def test_info_prints_mesh_frame_rate_and_box_of_other_formats(tmp_path):
    meshreel.save(waving_grid(), tmp_path / "a.npz")
    shown = run("info", tmp_path / "a.npz").stdout
    for words in ("NumPy archive", "12 frames, 99 vertices, 160 faces", "fps", "float32", "x 0 to"):
        assert words in shown


def test_info_lists_the_meshes_when_there_are_several(tmp_path):
    meshreel.save(two_sheets(), tmp_path / "two.usda")
    done = run_ok("info", tmp_path / "two.usda")
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
    sizes = run_json("info", tmp_path / "a.bin")["budget_bytes"]
    assert sum(sizes.values()) == (tmp_path / "a.bin").stat().st_size
    shown = run("info", tmp_path / "a.bin").stdout.split("share\n")[1].splitlines()
    rows = [line.rsplit(maxsplit=3) for line in shown]
    assert {name.strip(): int(size) for name, size, *_ in rows} == sizes
    assert sum(float(share) for _, _, share, _ in rows) == pytest.approx(100, abs=0.5)


@pytest.mark.parametrize(
    "option", [["--merge"], ["--object", "a"], ["--fps", "24"], ["--skip-bad"]]
)
def test_info_rejects_input_options_for_a_stream(tmp_path, option):
    (tmp_path / "a.reel").write_bytes(meshreel.encode(waving_grid()))
    assert_fails(run("info", tmp_path / "a.reel", *option), "do not apply to a .reel")


def in_one_line(shown):
    """Return a printed table without borders and line breaks."""
    return " ".join(shown.split())


@pytest.fixture
def flickering(tmp_path):
    """Frames that alternate between two meshes: 15 segments, of two frames each except the last."""
    for number in range(29):
        rows = 5 if number // 2 % 2 else 6
        meshreel.save(waving_grid(1, rows, 6), tmp_path / f"frames_{number:02d}.ply")
    return str(tmp_path / "*.ply")


@pytest.mark.slow
def test_info_and_encode_describe_segments_and_distinct_meshes(flickering, tmp_path):
    text = "29 frames in 15 segments with 2 distinct meshes, up to 36 vertices and 50 faces"
    assert text in in_one_line(run("info", flickering).stdout)
    assert text in in_one_line(run("encode", flickering, "-o", tmp_path / "a.reel").stdout)
    [mesh] = run_json("info", flickering)["meshes"]
    assert (mesh["n_segments"], mesh["n_meshes"]) == (15, 2)
    assert mesh["raw_size_bytes"] == 12 * (15 * 36 + 14 * 30) + 12 * (8 * 50 + 7 * 40)
    figures = run_json("encode", flickering, "-o", tmp_path / "b.reel")
    assert (figures["n_segments"], figures["n_meshes"]) == (15, 2)


@pytest.mark.slow
def test_info_of_a_stream_lists_twelve_segments_and_json_all(flickering, tmp_path):
    run("encode", flickering, "-o", tmp_path / "a.reel")
    shown = run("info", tmp_path / "a.reel").stdout
    assert "29 frames in 15 segments, up to 36 vertices and 50 faces" in in_one_line(shown)
    assert "22 to 23" in shown
    assert "24 to 25" not in shown
    assert "and 3 more; --json lists all" in shown
    assert len(run_json("info", tmp_path / "a.reel")["segments"]) == 15


def test_info_lists_the_contents_of_several_segments_once(tmp_path):
    heats = [np.random.default_rng(1).random((1, 99)), np.arange(30.0).reshape(1, 30)]
    sheets = [waving_grid(1), quad_sheet(1), quad_sheet(1).replace(surface=waving_grid(1).surface)]
    tracked = [
        sheet.replace(fps=25.0, tracks={"heat": Track(heat, unit="K")})
        for sheet, heat in zip(sheets, [*heats, heats[1]], strict=True)
    ]
    data = meshreel.encode(meshreel.concatenate(tracked), tracks={"heat": 0.01})
    result, parts = (
        meshreel.info(data),
        [meshreel.info(data, segment=number) for number in range(3)],
    )
    assert [part.tracks[0].is_exact for part in parts] == [False, True, True]
    [track] = result.tracks
    assert not track.is_exact
    assert (track.name, track.unit, track.bound) == ("heat", "K", 0.01)
    assert track.size_bytes == sum(part.tracks[0].size_bytes for part in parts)
    assert track.raw_size_bytes == 8 * (99 + 30 + 30)
    assert result.attributes == parts[1].attributes
    (tmp_path / "a.reel").write_bytes(data)
    assert run("info", tmp_path / "a.reel").stdout.count("heat: scalar") == 1


def test_info_lists_materials_and_images_of_a_file(tmp_path):
    meshreel.save(dressed_sheet(), tmp_path / "a.glb")
    shown = " ".join(run("info", tmp_path / "a.glb").stdout.split())
    assert "'shade', image/png" in shown
    assert "gr\u00fcn: base color image" in shown
    (mesh,) = run_json("info", tmp_path / "a.glb")["meshes"]
    assert (len(mesh["materials"]), len(mesh["images"])) == (2, 2)


NOTE = (
    "left out: arrays: pressure; tracks are numbers of shape (12, N) or (12, N, C), C up to 256, "
    "for 99 vertices, 160 faces and 480 corners"
)


@pytest.fixture
def odd(tmp_path):
    """A file with an array that the reader ignores."""
    grid = waving_grid()
    path = tmp_path / "odd.npz"
    np.savez(path, vertices=grid.vertices, faces=grid.faces, fps=24.0, pressure=np.zeros(3))
    return path


@pytest.mark.parametrize(
    ("command", "options"),
    [
        ("encode", ["-o", "a.reel"]),
        ("convert", ["-o", "a.h5"]),
        ("compare", ["plain.npz"]),
        ("render", ["-o", "a.png", "--frames", "1", "--size", "160x120"]),
        pytest.param(
            "paper", ["--out", "report", "--quick", "--methods", "pca"], marks=pytest.mark.slow
        ),
        pytest.param(
            "evaluate",
            ["--out", "report", "--quick", "--methods", "reel", "--peers", "blosc2"],
            marks=pytest.mark.slow,
        ),
    ],
)
def test_json_notes_ignored_contents(odd, tmp_path, command, options):
    save(waving_grid(), tmp_path / "plain.npz")
    assert NOTE in run_json(command, odd, *options, cwd=tmp_path)["notes"]


def test_encode_notes_an_unknown_frame_rate(tmp_path):
    save(waving_grid(3), tmp_path / "f_%d.obj")
    arguments = ["encode", *sorted(tmp_path.glob("*.obj")), "--force", "-o", "a.reel"]
    [note] = run_json(*arguments, cwd=tmp_path)["notes"]
    assert note.endswith("players assume 24 frames per second; set it with --fps")
    assert run_json(*arguments, "--fps", "25", cwd=tmp_path)["notes"] == []


def test_json_of_export_notes_ignored_contents_of_the_original(odd, tmp_path):
    save(waving_grid(), tmp_path / "plain.reel")
    figures = run_json("export", "plain.reel", "--original", odd, "-o", "a.html", cwd=tmp_path)
    assert NOTE in figures["notes"]


@pytest.mark.slow
def test_manifest_notes_ignored_contents(odd, tmp_path):
    run_json("batch", tmp_path, tmp_path / "out", "--workers", "1")
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert manifest["inputs"]["odd.npz"]["notes"] == [NOTE]


@pytest.mark.slow
def test_report_notes_ignored_tracks(tmp_path):
    grid = waving_grid()
    arrays = {"vertices": grid.vertices, "faces": grid.faces, "heat": np.zeros((12, 99))}
    np.savez(tmp_path / "a.npz", **arrays)
    options = ["--out", "report", "--quick", "--methods", "pca"]
    figures = run_json("paper", tmp_path / "a.npz", *options, cwd=tmp_path)
    assert "left out: tracks, as the report covers positions: heat" in figures["notes"]
    assert "drop the tracks" not in (tmp_path / "report" / "report.md").read_text()


@pytest.mark.parametrize("name", ["a.obj", "a.npz"])
def test_all_commands_name_the_same_contents(name, tmp_path):
    source, grid = tmp_path / name, waving_grid(2)
    source.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\ncurv 0 1 1 2\n")
    if name == "a.npz":
        np.savez(source, vertices=grid.vertices, faces=grid.faces, labels=np.zeros(3))
    meshreel.load(source, notes=(notes := []))
    assert notes
    commands = (
        ("info", source),
        ("encode", source, "-o", tmp_path / "x.reel"),
        ("convert", source, "-o", tmp_path / "x.npz"),
    )
    for command in commands:
        assert not set(notes) - set(run_json(*command)["notes"]), command[0]


def test_standard_input_is_a_stream(tmp_path):
    data = meshreel.encode(meshreel.simulate_flag(2))
    (tmp_path / "a.reel").write_bytes(data)
    for arguments in (["info", "-"], ["compare", "a.reel", "-"], ["decode", "-", "-o", "a.npz"]):
        command = [sys.executable, "-m", "meshreel", *arguments]
        subprocess.run(command, input=data, cwd=tmp_path, check=True, timeout=60)
    assert meshreel.load(tmp_path / "a.npz").n_frames == 2
