"""Commands of the program: output, files and errors."""

import numpy as np
import pytest

import meshreel
from meshreel.model.tracks import Track
from samples.commands import assert_fails, run, run_json, run_ok
from samples.meshes import waving_grid
from samples.streams import not_compact
from samples.tracks import quad_sheet_with


@pytest.fixture
def grid(tmp_path):
    path = tmp_path / "grid.npz"
    meshreel.save(waving_grid(), path)
    return path


@pytest.fixture
def reel(tmp_path):
    path = tmp_path / "made.reel"
    with not_compact():
        path.write_bytes(meshreel.encode(waving_grid()))
    return path


def test_encode_prints_the_sizes_of_the_file_as_json(grid, tmp_path):
    figures = run_json("encode", grid, "-o", tmp_path / "a.reel")
    size = (tmp_path / "a.reel").stat().st_size
    assert figures["size_bytes"] == size
    assert figures["rate_bpvf"] == pytest.approx(8 * size / (12 * 99))
    assert figures["raw_size_bytes"] == waving_grid().raw_size_bytes
    assert figures["ratio"] == pytest.approx(figures["raw_size_bytes"] / size)


def test_encode_prints_a_table_by_default(grid, tmp_path):
    done = run_ok("encode", grid, "-o", tmp_path / "a.reel")
    for word in (
        "x smaller than the input, ", "x smaller than the raw values, ", "12 frames, 99 vertices",
        "bits per vertex and frame", "of the diagonal, ", "order of vertices and faces",
    ):  # fmt: skip
        assert done.stdout.count(word) == 1


@pytest.mark.slow
def test_encode_prints_the_error_that_shading_shows(grid, tmp_path):
    output = tmp_path / "a.reel"
    printed = run_json("encode", grid, "-o", output, "--quality", "40")
    quality = run_json("compare", grid, tmp_path / "a.reel")
    for name in ("normal_angle_mean_deg", "sted_spatial"):
        assert printed[name] == pytest.approx(quality[name], rel=0.2) != 0
    shown = run("encode", grid, "-o", output, "--force").stdout
    assert "degrees, seen in shading; in 10 frames" in shown
    shape = next(line for line in shown.splitlines() if "shape of edges (STED)" in line)
    assert f" {100 * float(shape.split()[4][:-1]):.2f} %;" in shape


def test_encode_says_what_dropping_the_order_of_a_shuffled_mesh_saves(tmp_path):
    grid = waving_grid(2, 40, 40)
    moved = np.random.default_rng(3).permutation(grid.n_verts)
    shuffled = meshreel.MeshSequence(grid.vertices[:, np.argsort(moved)], moved[grid.faces], 25)
    meshreel.save(shuffled, tmp_path / "a.npz")
    notes = run("encode", "a.npz", cwd=tmp_path).stderr
    share = run_json("info", "a.reel", cwd=tmp_path)
    percent = 100 * share["part_bytes"]["order"] / share["size_bytes"]
    assert (
        f"note: {percent:.0f} % of the file is the order of vertices and faces; --order dro"
        in notes
    )
    for order in ("drop", "keep"):
        done = run("encode", "a.npz", "--force", "--order", order, cwd=tmp_path)
        assert "order" not in done.stderr


def test_the_note_on_the_order_names_what_is_lost_without_it(tmp_path, monkeypatch):
    monkeypatch.setattr("meshreel.operations.encoding.MIN_ORDER_BYTES", 1)
    monkeypatch.setattr("meshreel.operations.encoding.MAX_ORDER_SHARE", 0)
    meshreel.save(quad_sheet_with(), tmp_path / "a.npz")
    assert "no longer fit; polygons are lost\n" in run("encode", "a.npz", cwd=tmp_path).stderr


def test_encode_names_the_output_after_the_input_by_default(grid, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    assert run("encode", grid, cwd=tmp_path / "elsewhere").returncode == 0
    assert (tmp_path / "elsewhere" / "grid.reel").exists()


def test_encode_uses_its_options(grid, tmp_path):
    options = ["--modes", 3, "--order", "drop", "--block-frames", 6, "--fps", 12,
               "--method", "blocks"]  # fmt: skip
    run_json("encode", grid, "-o", tmp_path / "a.reel", *options)
    expected = meshreel.encode(
        meshreel.load(grid, fps=12), "blocks", n_modes=3, order="drop", block_frames=6
    )
    assert (tmp_path / "a.reel").read_bytes() == expected


def test_globs_and_lists_give_the_same_stream_as_the_folder(tmp_path):
    frames = tmp_path / "frames"
    frames.mkdir()
    paths = meshreel.save(waving_grid(), frames / "f_%d.obj")
    decoded = []
    for number, given in enumerate(([frames], [frames / "*.obj"], paths)):
        run_json("encode", *given, "-o", tmp_path / f"{number}.reel")
        decoded.append(meshreel.decode(tmp_path / f"{number}.reel").vertices)
    np.testing.assert_array_equal(decoded[1:], [decoded[0]] * 2)


@pytest.mark.parametrize(("text", "frames"), [("2:5", slice(2, 5)), ("9:", slice(9, None)),
                                              (":1", slice(0, 1)), ("4", slice(4, 5))])  # fmt: skip
def test_decode_writes_the_selected_frames(reel, tmp_path, text, frames):
    run_json("decode", reel, "-o", tmp_path / "part.npz", "--frames", text)
    expected = meshreel.decode(reel.read_bytes(), frames=frames)
    np.testing.assert_array_equal(meshreel.load(tmp_path / "part.npz").vertices, expected.vertices)


def test_demo_writes_stream_and_picture(tmp_path):
    figures = run_json("demo", "--out", tmp_path / "demo", "--frames", 4)
    assert {path.name for path in (tmp_path / "demo").iterdir()} == {
        "flag.html", "flag.npz", "flag.png", "flag.reel",
    }  # fmt: skip
    assert "window.MESHREEL=" in (tmp_path / "demo" / "flag.html").read_text("utf-8")
    assert figures["kg_error_percent"] < 2
    assert figures["size_bytes"] == (tmp_path / "demo" / "flag.reel").stat().st_size
    original = meshreel.load(tmp_path / "demo" / "flag.npz").vertices
    decoded = meshreel.decode((tmp_path / "demo" / "flag.reel").read_bytes()).vertices
    farthest = np.linalg.norm(decoded - original, axis=2).max(axis=1)
    assert figures["max_error_frame"] == farthest.argmax()
    assert figures["max_error_frame"] in figures["picture_frames"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["encode", "{grid}", "--max-error", "0.5mm"], ["has no length unit", "--unit", "0.5u"]),
        (["encode", "{grid}", "--max-error", "500%"], ["at most 100%", "got 500%", "5u is"]),
        (["encode", "{grid}", "--unit", "mm"], ["--unit", "--max-error", "give both"]),
        (["decode", "{reel}", "-o", "a.glb", "--unit", "mm"], ["--unit", "--max-error"]),
        (["encode", "{grid}", "-o", "no/such/a.reel"], ["no/such", "does not exist"]),
        (["encode", "{grid}", "-o", "a.reel", "--bits", "9"], ["No such option", "--bits"]),
        (["encode", "{grid}", "-o", "a.reel", "--modes", "x"], ["--modes", "whole number"]),
        (["encode", "{grid}", "-o", "a.reel", "--modes", "0"], ["--modes", "0"]),
        (["demo", "--frames", "0"], ["--frames", "0"]),
        (["encode", "{grid}", "--kg", "1", "--size", "900"], ["--kg", "--size", "exclude"]),
        (
            ["encode", "{grid}", "--size", "9"],
            ["size 9 cannot be met", "smallest file", "order drop"],
        ),
        (["encode", "{grid}", "--method", "pca-qp", "--kg", "1"], ["pca-qp", "kg", "reel"]),
        (["encode"], ["INPUT"]),
        (["decode", "{reel}", "-o", "no/such/a.npz"], ["no/such"]),
        (["decode", "{reel}", "-o", "a.xyz"], [".xyz", ".npz"]),
        (["decode", "{reel}", "-o", "a.npz", "--frames", "90:99"], ["frames 0:12"]),
        (["decode", "{reel}", "-o", "a.npz", "--frames", "x"], ["A:B"]),
        (["compare", "{grid}", "missing.npz"], ["missing.npz"]),
        (["unknown"], ["unknown"]),
        (["inof", "a.npz"], ["No such command 'inof'", "Did you mean 'info'?"]),
    ],
)
def test_program_fails_with_one_line_for_invalid_arguments(grid, reel, tmp_path, arguments, words):
    filled = [text.format(grid=grid, reel=reel) for text in arguments]
    assert_fails(run(*filled, cwd=tmp_path), *words)


@pytest.mark.parametrize(
    "arguments",
    [["info"], ["decode", "-o", "a.npz"], ["view"], ["export", "-o", "a.html"], ["compare", "b"]],
)
def test_all_commands_print_the_same_error_when_a_file_is_missing(tmp_path, arguments):
    command, *others = arguments
    expected = run("encode", "nope.reel", cwd=tmp_path).stderr
    assert "there is no file or folder 'nope.reel'" in expected
    assert run(command, "nope.reel", *others, cwd=tmp_path).stderr == expected


def test_no_file_is_left_when_encoding_fails(tmp_path):
    (tmp_path / "bad.npz").write_bytes(b"PK\x03\x04 not really")
    assert_fails(run("encode", "bad.npz", "-o", "a.reel", cwd=tmp_path), "bad.npz")
    assert [path.name for path in tmp_path.iterdir()] == ["bad.npz"]


def test_complete_blocks_are_decoded_when_the_end_of_a_stream_is_missing(reel, tmp_path):
    cut = tmp_path / "cut.reel"
    cut.write_bytes(reel.read_bytes()[:-6])
    done = run_ok("decode", cut, "-o", tmp_path / "a.npz")
    assert "truncated: these are the frames" in done.stderr
    np.testing.assert_array_equal(
        meshreel.load(tmp_path / "a.npz").vertices, meshreel.load(reel).vertices
    )
    assert "truncated" in run("info", cut).stdout


@pytest.mark.slow
def test_encode_streams_frame_files_when_memory_is_small(tmp_path):
    sequence = meshreel.simulate_flag(12)
    meshreel.save(sequence, tmp_path / "flag_%03d.obj")
    run_ok("encode", tmp_path / "flag_*.obj", "-o", tmp_path / "f.reel", "--memory", "117MB")
    with meshreel.open(tmp_path / "f.reel") as reel:
        assert max(reel.info().block_frames) < 12
        expected = meshreel.encode(meshreel.load(str(tmp_path / "flag_*.obj")), memory="117MB")
        np.testing.assert_array_equal(reel[:].vertices, meshreel.decode(expected).vertices)


@pytest.mark.parametrize(
    ("memory", "words"), [("20MB", "is too little for"), ("lots", "such as 100kB or 1GiB")]
)
def test_memory_is_rejected_when_it_is_too_small_or_invalid(grid, tmp_path, memory, words):
    assert_fails(run("encode", grid, "-o", tmp_path / "a.reel", "--memory", memory), words)


def test_version_is_that_of_the_package():
    for flag in ("--version", "-V"):
        assert run(flag).stdout.strip() == f"meshreel {meshreel.__version__}"


def test_help_is_shown_when_no_command_is_given():
    done = run_ok()
    assert "encode" in done.stdout


def test_compare_notes_rotated_axes(grid, tmp_path):
    sequence = meshreel.load(grid)
    turned = sequence.vertices[..., [0, 2, 1]] * np.float32([1, -1, 1])
    meshreel.save(sequence.replace(vertices=turned), tmp_path / "turned.npz")
    words = "check that axes (y-up, z-up), unit and position are equal"
    assert words in " ".join(run("compare", grid, tmp_path / "turned.npz").stderr.split())
    [note] = run_json("compare", grid, tmp_path / "turned.npz")["notes"]
    assert words in note
    assert run_json("compare", grid, grid)["notes"] == []


def test_encode_compares_the_output_with_the_input_files_first(tmp_path):
    sequence = waving_grid(12)
    meshreel.save(sequence, tmp_path / "a_%02d.obj")
    n_bytes = sum(path.stat().st_size for path in tmp_path.glob("*.obj"))
    figures = run_json("encode", ".", "-o", "a.reel", cwd=tmp_path)
    assert figures["input_size_bytes"] == n_bytes
    ratio = n_bytes / (tmp_path / "a.reel").stat().st_size
    lines = run("encode", ".", "-o", "b.reel", cwd=tmp_path).stdout.splitlines()
    assert lines[1].split()[0] == "size"
    assert lines[2].strip().startswith(f"{ratio:.1f} x smaller than the input")
    part = run_json("convert", ".", "-o", "c.reel", "--frames", "0:3", cwd=tmp_path)
    assert part["input_size_bytes"] is None


def test_size_of_an_index_includes_the_files_that_it_refers_to(tmp_path):
    meshreel.save(waving_grid(12), tmp_path / "a.pvd")
    n_bytes = sum(path.stat().st_size for path in tmp_path.rglob("*") if path.is_file())
    assert run_json("encode", "a.pvd", cwd=tmp_path)["input_size_bytes"] == n_bytes


def test_convert_says_that_a_file_is_compact_and_grows(reel, tmp_path):
    shown = run("convert", reel, "-o", "b.reel", "--lossless", cwd=tmp_path).stdout
    assert " x larger than the input" in shown.splitlines()[2]
    assert "compact already: smaller than the raw values of all frames" in shown


def test_encode_says_that_only_tracks_have_a_bound(tmp_path):
    heat = np.random.default_rng(0).random((12, 30), np.float32)
    meshreel.save(quad_sheet_with(heat=Track(heat)), tmp_path / "a.npz")
    text = " none, see --bound"
    assert text in run("encode", "a.npz", cwd=tmp_path).stdout
    done = run("encode", "a.npz", "--max-error", "0.1", "-o", "b.reel", cwd=tmp_path)
    assert text not in done.stdout
