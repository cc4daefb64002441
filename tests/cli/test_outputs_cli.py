"""Outputs of commands: names, numbers, positions of `-o`, and refused outputs."""

import os
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

import meshreel
from samples.commands import assert_fails, run, run_json, run_ok
from samples.meshes import waving_grid


@pytest.fixture
def folder(tmp_path):
    """A folder with walk.npz, other.npz, the stream walk.reel, and frames."""
    grid = waving_grid()
    meshreel.save(grid, tmp_path / "walk.npz")
    meshreel.save(grid, tmp_path / "other.npz")
    (tmp_path / "walk.reel").write_bytes(meshreel.encode(grid))
    meshreel.save(grid, tmp_path / "frames" / "f_%04d.obj")
    return tmp_path


def contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("output", ["keep.glb", "keep.mp4", "keep.npz", "keep", "keep.reel.bak"])
@pytest.mark.parametrize("options", [[], ["--force"]])
def test_encode_suggests_convert_when_the_output_is_not_a_stream(folder, output, options):
    (folder / output).write_bytes(b"mine")
    before = contents(folder)
    done = run("encode", "walk.npz", "-o", output, *options, cwd=folder)
    assert_fails(done, output, "must end in .reel", "meshreel convert")
    assert contents(folder) == before


@pytest.mark.slow
@pytest.mark.every_case
@pytest.mark.parametrize("force", [[], ["--force"]])
@pytest.mark.parametrize(
    "arguments",
    [
        ["encode", "walk.reel", "-o", "walk.reel"],
        ["encode", "walk.reel"],
        ["convert", "walk.npz", "-o", "walk.npz"],
        ["convert", "walk.npz", "-o", "./frames/../walk.npz"],
        ["convert", "walk.reel", "-o", "walk.reel"],
        ["convert", "frames", "-o", "frames/f_%04d.obj"],
        ["convert", "frames/*.obj", "-o", "frames/f_%04d.obj", "--frames", "3:5"],
        ["convert", "frames", "-o", "frames/f_%04d.obj", "--start-number", "11"],
        ["convert", "frames/f_0003.obj", "frames/f_0002.obj", "-o", "frames/f_0003.pc2"],
        ["convert", "frames/f_0003.obj", "-o", "symbolic.obj"],
        ["decode", "walk.reel", "-o", "linked.npz"],
        ["decode", "walk.reel", "-o", "hard.npz"],
        ["export", "page.html", "-o", "page.html"],
        ["export", "walk.reel", "-o", "page.html", "--original", "page.html"],
        ["render", "picture.png", "-o", "picture.png"],
        ["render", "walk.npz", "-o", "linked.png"],
        ["render", "other.npz", "-o", "linked.png", "--original", "walk.npz"],
    ],
    ids=lambda arguments: " ".join(arguments),
)
def test_input_is_kept_when_it_is_also_the_output(folder, arguments, force):
    (folder / "linked.npz").symlink_to("walk.reel")
    (folder / "linked.png").symlink_to("walk.npz")
    (folder / "symbolic.obj").symlink_to("frames/f_0003.obj")
    (folder / "hard.npz").hardlink_to(folder / "walk.reel")
    before = contents(folder)
    done = run(*arguments, *force, cwd=folder)
    assert done.returncode == 1
    assert contents(folder) == before
    if "page.html" not in arguments[1:] and "picture.png" not in arguments:
        assert_fails(done, "is the input", "never replaced")


@pytest.mark.parametrize(
    ("arguments", "output"),
    [
        ("encode walk.npz -o x.reel", "x.reel"),
        ("decode walk.reel -o x.npz", "x.npz"),
        ("convert walk.npz -o x.glb", "x.glb"),
        ("render walk.reel -o x.png --frames 3 --size 160x120", "x.png"),
        ("export walk.reel -o x.html", "x.html"),
        ("demo --frames 2 --out new", "new/flag.reel"),
    ],
    ids=lambda value: value.split(" ")[0],
)
def test_existing_output_is_replaced_only_with_force(folder, arguments, output):
    path = folder / output
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(b"mine")
    done = run(*arguments.split(), cwd=folder)
    assert_fails(done, f"{path.name} already exists", "--force")
    assert path.read_bytes() == b"mine"
    run_ok(*arguments.split(), "--force", cwd=folder)
    assert path.read_bytes() != b"mine"


def test_frames_are_written_next_to_the_input_when_their_numbers_differ(folder):
    run_json("convert", "frames", "-o", "frames/f_%04d.obj", "--start-number", 12, cwd=folder)
    assert len(list((folder / "frames").iterdir())) == 24


def test_topology_is_kept_when_the_output_would_replace_it(folder):
    meshreel.save(waving_grid(), folder / "cache.pc2")
    before = contents(folder)
    done = run("convert", "cache.pc2", "-o", "cache.mdd", "--force", cwd=folder)
    assert_fails(done, "cache.obj is the input")
    assert contents(folder) == before


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="there is no such folder here")
@pytest.mark.parametrize(
    "arguments",
    [
        ["encode", "walk.npz", "-o", "/proc/x.reel"],
        ["convert", "walk.npz", "-o", "/proc/x.npz"],
        ["convert", "walk.npz", "-o", "/proc/new/f_%d.obj"],
        ["decode", "walk.reel", "-o", "/proc/x.npz"],
        ["export", "walk.reel", "-o", "/proc/x.html"],
        ["render", "walk.reel", "-o", "/proc/x.png"],
        ["batch", ".", "/proc/x"],
        ["demo", "--out", "/proc/x"],
        ["paper", "walk.npz", "--out", "/proc/x"],
        ["evaluate", "walk.npz", "--out", "/proc/x"],
    ],
    ids=lambda arguments: arguments[0] + " " + arguments[-1],
)
def test_error_names_a_folder_that_cannot_be_written(folder, arguments):
    assert_fails(run(*arguments, cwd=folder), "the folder /proc")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["export", "walk.reel", "-o", "x.txt"], ["x.txt must end in .html", "meshreel render"]),
        (["decode", "walk.reel", "-o", "x.reel"], ["re-encoded", "meshreel convert"]),
        (["paper", "walk.npz", "--out", "."], ["walk.npz is in"]),
        (["evaluate", "walk.npz", "--out", "."], ["walk.npz is in"]),
        (["decode", "walk.reel", "-o", "f_#####.obj"], ["##### is not", "use f_%05d.obj"]),
        (["decode", "walk.reel", "-o", "no/f.$F.obj"], ["$F is not", f"{Path('no/f.%04d.obj')}"]),
        (
            ["convert", "walk.npz", "-o", "f.$F3.ply"],
            ["$F3 is not a number field", "use f.%03d.ply"],
        ),
        (["convert", "walk.npz", "-o", "<frame>.ply"], ["<frame> is not", "use %04d.ply"]),
        (["encode", "walk.npz", "--tolerance", "1"], ["Did you mean '--max-error'?"]),
        (["register", "frames", "--eb=1"], ["Did you mean '--max-error'?"]),
        (["encode", "walk.npz", "--register"], ["(meshreel encode --help lists the options)"]),
        (["encode", "walk.npz", "--quality", "150"], ["must be 1..100; got 150\n"]),
        (["encode", "walk.npz", "--track", "a=drop,b=1"], ["'a=drop,b=1'; repeat it for each"]),
        (["decode", "walk.reel", "-o", "x.npz", "--normals"], ["--normals", ".glb, .gltf"]),
        (["decode", "walk.reel", "-o", "x.npz", "--start-number", "1"], ["--start-number"]),
        (
            ["convert", "walk.npz", "-o", "x.glb", "--kg", "1"],
            ["--kg is a bound of rigs; add --rig"],
        ),
        (["convert", "walk.npz", "-o", "x.glb", "--method", "reel"], ["--method", ".reel"]),
        (["convert", "walk.npz", "-o", "x.npz", "--block-frames", "9"], ["--block-frames"]),
        (["convert", "walk.npz", "-o", "f_%d.obj", "--start-number", "-3"], ["0 or more"]),
        (["convert", "walk.npz", "-o", "x.npz", "--frames", "12:20"], ["there are frames 0:12"]),
        (
            ["convert", "frames", "-o", "f.npz", "--split", "--frames", "1"],
            ["--split and --frames"],
        ),
    ],
    ids=lambda value: " ".join(value) if value[0].islower() else "",
)
def test_error_names_the_invalid_output_or_option(folder, arguments, words):
    before = contents(folder)
    assert_fails(run(*arguments, cwd=folder), *words)
    assert contents(folder) == before


@pytest.mark.parametrize("options", [["--max-error", 0.1], ["--kg", 1, "--effort", 3], []])
def test_convert_writes_the_same_stream_as_encode(folder, options):
    encoded = run_json("encode", "walk.npz", "-o", "a.reel", *options, cwd=folder)
    converted = run_json("convert", "walk.npz", "-o", "b.reel", *options, cwd=folder)
    assert (folder / "a.reel").read_bytes() == (folder / "b.reel").read_bytes()
    for name in ("max_error_percent", "kg_error_percent", "size_bytes", "n_modes"):
        assert converted[name] == encoded[name]


@pytest.mark.parametrize("source", ["walk.npz", "walk.reel"])
def test_rig_is_shown_with_its_errors_and_parts(folder, source):
    command = "decode" if source.endswith(".reel") else "convert"
    options = ["-o", "rig.glb", "--rig", 4, "--max-error", 5, "--kg", 5]
    figures = run_json(command, source, *options, "--force", cwd=folder)
    size = (folder / "rig.glb").stat().st_size
    assert figures["size_bytes"] == sum(figures["sizes_bytes"].values()) == size
    assert {*figures["sizes_bytes"]} >= {"mesh", "weights", "bones and keys"}
    errors = meshreel.compare(meshreel.load(folder / source), meshreel.load(folder / "rig.glb"))
    assert figures["rig"]["kg_percent"] == pytest.approx(errors.kg_error_percent, abs=1e-3)
    assert figures["rig"]["n_bones"] <= 4
    done = run(command, source, *options, "--force", cwd=folder)
    for row in ("KG error", "largest error", "normal error"):
        assert row in done.stdout


def test_convert_prints_error_and_bound_of_a_stream(folder):
    done = run("convert", "walk.npz", "-o", "b.reel", "--max-error", 0.1, cwd=folder)
    shown = " ".join(done.stdout.split())
    assert re.search(r"positions 0\.1 %, [0-9.]+ u 0\.0[0-9]+ %, [0-9.]+ u [0-9]+ [0-9.]+ %", shown)


@pytest.mark.parametrize(("command", "source"), [("decode", "walk.reel"), ("convert", "walk.npz")])
@pytest.mark.parametrize(
    ("options", "numbers"),
    [
        (["--frames", "5:8"], [5, 6, 7]),
        (["--frames", "-2:"], [10, 11]),
        (["--frames", "5:7", "--start-number", 1001], [1001, 1002]),
        (["--start-number", 0, "--frames", 3], [0]),
    ],
)
def test_files_have_the_numbers_of_the_selected_frames(folder, command, source, options, numbers):
    run_json(command, source, "-o", "new/er/f_%04d.ply", *options, cwd=folder)
    names = sorted(path.name for path in (folder / "new" / "er").iterdir())
    assert names == [f"f_{number:04d}.ply" for number in numbers]
    first = 3 if len(numbers) == 1 else {5: 5, 10: 10, 1001: 5}[numbers[0]]
    np.testing.assert_array_equal(
        meshreel.load(folder / "new" / "er" / names[0]).vertices[0],
        meshreel.load(folder / source).vertices[first],
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "frames"),
    [
        (["decode", "walk.reel", "-o", "x.npz", "--frames", "8:20"], "8:12"),
        (["convert", "walk.npz", "-o", "x.npz", "--frames", "-20:3"], "0:3"),
        (["convert", "walk.npz", "-o", "x.reel", "--frames", ":13"], "0:12"),
        (["render", "walk.npz", "-o", "x.png", "--frames", "9:13", "--size", "640x480"], "9:12"),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else value,
)
def test_note_says_that_a_range_beyond_the_end_is_clamped(folder, arguments, frames):
    done = run_ok(*arguments, cwd=folder)
    assert f"exceeds the frames 0:12; using {frames}" in " ".join(done.stderr.split())


def test_ranges_within_the_frames_cause_no_note(folder):
    done = run("decode", "walk.reel", "-o", "x.npz", "--frames", "-12:12", cwd=folder)
    assert (done.returncode, done.stderr) == (0, "")


def test_files_of_segments_have_the_frame_numbers_of_the_sequence(folder):
    meshreel.save(waving_grid(2, 3, 3), folder / "frames" / "g_%d.obj")
    run_json("convert", "frames", "-o", "out/f_%02d.ply", "--split", cwd=folder)
    names = sorted(path.name for path in (folder / "out").iterdir())
    assert names[0] == "f_00_0-11.ply"
    assert names[-2:] == ["f_12_12-13.ply", "f_13_12-13.ply"]


@pytest.fixture
def single_folder(tmp_path):
    """A folder with the sequences a.npz and a.reel, the files b.reel and b.glb, and frames."""
    grid = waving_grid(2)
    meshreel.save(grid, tmp_path / "a.npz")
    meshreel.save(grid, tmp_path / "frames" / "f_%d.obj")
    for name in ("a.reel", "b.reel"):
        (tmp_path / name).write_bytes(meshreel.encode(grid))
    (tmp_path / "b.glb").write_bytes(b"")
    return tmp_path


@pytest.mark.parametrize(
    ("words", "corrected"),
    [
        ("decode a.reel new.npz", "decode a.reel -o new.npz"),
        ("decode a.reel b.glb", "decode a.reel -o b.glb"),
        ("decode a.reel 'my walk.abc'", "decode a.reel -o 'my walk.abc'"),
        ("decode a.reel frames/", "decode a.reel -o frames/"),
        ("export a.reel page.html --split", "export a.reel -o page.html"),
        ("render a.reel film.mp4", "render a.reel -o film.mp4"),
        ("convert a.npz new.abc", "convert a.npz -o new.abc"),
        ("convert a.npz s3://bucket/new.abc", "convert a.npz -o s3://bucket/new.abc"),
        ("convert frames/f_0.obj frames/f_1.obj b.glb", "convert frames/f_0.obj ... -o b.glb"),
        ("encode a.npz new.reel --max-error 0.1", "encode a.npz -o new.reel"),
        ("encode a.npz b.reel", "encode a.npz -o b.reel"),
        ("register frames/ new.reel", "register frames/ -o new.reel"),
        ("evaluate a.npz report", "evaluate a.npz -o report"),
        ("paper a.npz report", "paper a.npz -o report"),
        ("demo flag", "demo -o flag"),
    ],
)
def test_output_as_an_argument_is_an_error_with_the_correct_command(
    single_folder, words, corrected
):
    done = run(*shlex.split(words), cwd=single_folder)
    assert_fails(done, f"the output is given with -o: meshreel {corrected} (meshreel")


@pytest.mark.parametrize("option", ["-o", "--output", "--out"])
def test_output_of_batch_as_an_option_is_an_error_with_the_correct_usage(single_folder, option):
    done = run("batch", "frames", option, "streams", cwd=single_folder)
    assert_fails(done, "an argument, not an option: meshreel batch INPUT_DIR OUT_DIR (")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("decode a.reel b.reel", "Missing option '--output' / '-o'"),
        ("decode a.reel new.abc new.glb", "Missing option '--output' / '-o'"),
        ("decode a.reel new.abc -o new.glb", "unexpected extra argument (new.abc)"),
        ("convert frames/f_0.obj frames/f_1.obj", "Missing option '--output' / '-o'"),
        ("convert s3://bucket/1.obj s3://bucket/2.obj", "Missing option '--output' / '-o'"),
        ("encode a.npz c.npz", "no file or folder 'c.npz'; did you mean 'a.npz'?"),
        ("evaluate a.npz c.reel", "no file or folder 'c.reel'"),
        ("info a.npz c.reel", "no file or folder 'c.reel'"),
        ("compare a.npz -o b.reel", "No such option '-o'"),
    ],
)
def test_other_arguments_are_not_taken_for_the_output(single_folder, words, message):
    done = run(*words.split(), cwd=single_folder)
    assert_fails(done, message)
    assert "the output is" not in done.stderr


def test_help_is_shown_when_the_output_is_an_argument(single_folder):
    done = run_ok("export", "a.reel", "page.html", "--help", cwd=single_folder)
    assert "PAGE.html" in done.stdout
