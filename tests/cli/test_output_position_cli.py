"""Advice when the output is given as an argument instead of an option, or vice versa."""

import pytest

import meshreel
from samples.commands import assert_fails, run, run_ok
from samples.meshes import waving_grid


@pytest.fixture
def folder(tmp_path):
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
def test_output_as_an_argument_is_an_error_with_the_correct_command(folder, words, corrected):
    done = run(*words.split(), cwd=folder)
    assert_fails(done, f"the output is given with -o: meshreel {corrected} (meshreel")


def test_names_with_spaces_are_quoted_in_the_correct_command(folder):
    done = run("decode", "a.reel", "my walk.abc", cwd=folder)
    assert_fails(done, "meshreel decode a.reel -o 'my walk.abc' (")


@pytest.mark.parametrize("option", ["-o", "--output", "--out"])
def test_output_of_batch_as_an_option_is_an_error_with_the_correct_usage(folder, option):
    done = run("batch", "frames", option, "streams", cwd=folder)
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
def test_other_arguments_are_not_taken_for_the_output(folder, words, message):
    done = run(*words.split(), cwd=folder)
    assert_fails(done, message)
    assert "the output is" not in done.stderr


def test_help_is_shown_when_the_output_is_an_argument(folder):
    done = run_ok("export", "a.reel", "page.html", "--help", cwd=folder)
    assert "PAGE.html" in done.stdout
