"""`--skip-bad` and `--allow-outside`."""

import pytest

import meshreel
from samples.commands import assert_fails, run, run_json
from samples.meshes import waving_grid

pytest.importorskip("pxr")

TRIANGLE = """def Mesh "{name}" {{
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, {corner}]
}}
"""


@pytest.fixture
def half_bad(tmp_path):
    path = tmp_path / "in" / "half.usda"
    path.parent.mkdir()
    meshes = [TRIANGLE.format(name="good", corner=2), TRIANGLE.format(name="bad", corner=9)]
    path.write_text("#usda 1.0\n" + "".join(meshes))
    return path


@pytest.mark.parametrize("command", ["encode", "convert"])
def test_command_skips_the_bad_mesh_with_skip_bad(half_bad, tmp_path, command):
    out = tmp_path / ("out.reel" if command == "encode" else "out.npz")
    assert_fails(run(command, half_bad, "-o", out, "--merge"), "uses vertex 9")
    figures = run_json(command, half_bad, "-o", out, "--skip-bad")
    assert any("meshes that cannot be read: /bad (" in note for note in figures["notes"])
    assert meshreel.load(out).n_verts == 3


@pytest.mark.slow
def test_compare_export_and_render_skip_the_bad_mesh_with_skip_bad(half_bad, tmp_path):
    reel, page, png = tmp_path / "out.reel", tmp_path / "out.html", tmp_path / "out.png"
    run_json("encode", half_bad, "-o", reel, "--skip-bad")
    assert run_json("compare", half_bad, reel, "--skip-bad")["max_error_percent"] <= 0.1
    run_json("export", reel, "-o", page, "--original", half_bad, "--skip-bad")
    run_json("render", reel, "-o", png, "--original", half_bad, "--skip-bad")
    assert page.stat().st_size > 0
    assert png.stat().st_size > 0


@pytest.mark.slow
def test_batch_skips_the_bad_mesh_with_skip_bad(half_bad, tmp_path):
    meshreel.save(waving_grid(2), half_bad.parent / "plain.npz")
    move_outside(half_bad)
    words = "batch", half_bad.parent, tmp_path / "out", "--skip-bad", "--workers", "1"
    assert_fails(run(*words), "outside its folder")
    done = run_json(*words, "--allow-outside")
    assert (done["encoded"], done["failed"]) == (2, 0)


def move_outside(path):
    """Move the contents of a file to a layer outside its folder."""
    (path.parents[1] / "layer.usda").write_text(path.read_text())
    path.write_text("#usda 1.0\n(\nsubLayers = [@../layer.usda@]\n)\n")


@pytest.mark.parametrize(
    ("command", "output"), [("encode", "a.reel"), ("convert", "a.npz"), ("render", "a.png")]
)
def test_command_reads_an_outside_layer_with_allow_outside(half_bad, tmp_path, command, output):
    move_outside(half_bad)
    arguments = (command, half_bad, "-o", tmp_path / output, "--object", "good")
    assert_fails(run(*arguments), "outside its folder", "--allow-outside")
    run_json(*arguments, "--allow-outside")
    assert command == "render" or meshreel.load(tmp_path / output).n_verts == 3


@pytest.mark.parametrize(
    ("command", "flag"),
    [
        ("encode", "--skip-bad"),
        ("compare", "--allow-outside"),
        ("render", "--skip-bad"),
        ("batch", "--allow-outside"),
        ("view", "--allow-outside"),
    ],
)
def test_command_rejects_the_option_when_it_does_not_apply(tmp_path, command, flag):
    folder = tmp_path / "in"
    folder.mkdir()
    meshreel.save(waving_grid(2), folder / "a.npz")
    meshreel.save(waving_grid(2), folder / "a.reel")
    arguments = {
        "encode": (folder / "a.npz", "-o", tmp_path / "b.reel"),
        "compare": (folder / "a.npz", folder / "a.reel"),
        "render": (folder / "a.reel", "-o", tmp_path / "b.png"),
        "batch": (folder, tmp_path / "out"),
        "view": (folder / "a.reel", "--no-open"),
    }[command]
    done = run(command, *arguments, flag)
    assert_fails(done, flag, "original" if command == "view" else "has no effect on")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--size 15 kB", "a space separates 15 from its unit; write --size 15kB"),
        ("--max-error 0.5 mm --unit m", "write --max-error 0.5mm"),
        ("--memory=1 GiB", "write --memory 1GiB"),
        ("--register .2 %", "write --register .2%"),
    ],
)
def test_space_before_a_unit_is_an_error_that_shows_how_to_write_it(tmp_path, words, message):
    meshreel.save(waving_grid(2), tmp_path / "a.npz")
    done = run("encode", "a.npz", *words.split(), "-o", "b.reel", cwd=tmp_path)
    assert_fails(done, message)


def test_file_named_like_a_unit_is_an_input(tmp_path):
    meshreel.save(waving_grid(2), tmp_path / "mm" / "f_%d.obj")
    run_json("encode", "--fps", 25, "mm", "-o", "b.reel", cwd=tmp_path)
    assert meshreel.load(tmp_path / "b.reel").fps == 25


def test_decode_of_another_format_is_an_error_with_the_commands_to_use(tmp_path):
    meshreel.save(waving_grid(2), tmp_path / "a.npz")
    done = run("decode", "a.npz", "-o", "b.glb", cwd=tmp_path)
    encode = "encode it first: meshreel encode a.npz -o a.reel"
    assert_fails(done, f"a.npz is not a .reel file; {encode}; `meshreel convert` writes it")


def test_frame_rates_are_numbers_or_fractions_up_to_a_million(tmp_path):
    meshreel.save(waving_grid(2), tmp_path / "a.npz")
    done = run("convert", "a.npz", "-o", "b.npz", "--fps", "30000/1001", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert meshreel.load(tmp_path / "b.npz").fps == 30000 / 1001
    for fps in ("1e9", "-1", "25/0", "1/2/3", "x/2"):
        done = run("convert", "a.npz", "-o", "c.npz", "--fps", fps, cwd=tmp_path)
        assert_fails(done, "--fps must be 0..1e+06")


def test_option_in_percent_accepts_the_sign(tmp_path):
    meshreel.save(waving_grid(2), tmp_path / "a.npz")
    sizes = [
        run_json("encode", "a.npz", "--kg", kg, "-o", f"{kg}.reel", cwd=tmp_path)["size_bytes"]
        for kg in ("0.5", "0.5%")
    ]
    assert sizes[0] == sizes[1]
