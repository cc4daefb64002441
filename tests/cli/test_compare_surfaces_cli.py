"""`meshreel compare` of files whose faces differ: distances between surfaces."""

import pytest

import meshreel
from samples import commands
from samples.commands import assert_fails, run_json
from samples.meshes import waving_grid


@pytest.fixture
def files(tmp_path, monkeypatch, few_grid_lines):
    """Files of a sheet, of one with half as many rows, and of one with fewer frames."""
    monkeypatch.setenv("COLUMNS", "100")
    sheets = waving_grid(3, 9, 11), waving_grid(3, 5, 11), waving_grid(2, 5, 11)
    paths = [tmp_path / f"{name}.npz" for name in ("fine", "coarse", "short")]
    for path, sheet in zip(paths, sheets, strict=True):
        meshreel.save(sheet, path)
    return paths


def run(*words):
    """Run `meshreel compare ARGUMENTS`, and return the result."""
    return commands.run("compare", *words)


def test_compare_shows_surface_distances_and_why(files):
    text = run(*files[:2], "--samples", 400).stdout
    assert "surfaces: the vertex counts differ (99 and 55)" in text
    for name in ("surface PSNR", "D1 PSNR", "D2 PSNR", "95th percentile", "original to decoded"):
        assert name in text
    assert "400 points per surface and frame" in text
    assert "64 lines along the longest side" in text


def test_compare_says_that_equal_surfaces_have_no_psnr(files):
    text = run(files[0], files[0], "--surface", "--samples", 400).stdout
    assert "surfaces: requested" in text
    assert text.count("infinite: no difference") == 3


def test_compare_prints_surface_distances_as_json(files):
    figures = run_json("compare", *files[:2], "--samples", 400)
    assert figures["n_samples"] == 400
    assert figures["to_decoded"]["max_percent"] > figures["to_decoded"]["mean_percent"] > 0
    assert figures["notes"] == []


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([0, 2], "the original has 3 frames and the decoded 2"),
        (
            [0, 0, "--samples", "100"],
            "--samples has no effect where vertices are compared; --surface",
        ),
        ([0, 1, "--samples", "0"], "--samples must be a whole number of at least 1; got 0"),
    ],
)
def test_compare_refuses_what_it_cannot_compare(files, words, message):
    done = run(*[files[word] if isinstance(word, int) else word for word in words])
    assert_fails(done, message)


def test_compare_measures_the_frames_that_are_named(files, tmp_path):
    sheet = meshreel.load(files[0])
    vertices = sheet.vertices.copy()
    vertices[2] += 1
    moved = tmp_path / "moved.npz"
    meshreel.save(sheet.replace(vertices=vertices), moved)
    assert run_json("compare", files[0], moved)["max_error_percent"] > 1
    figures = run_json("compare", files[0], moved, "--frames", ":2")
    assert (figures["n_frames"], figures["max_error_percent"]) == (2, 0)
    done = run(files[1], files[2], "--frames", "0:3")
    assert_fails(done, "frames")
    assert run(files[1], files[2], "--frames", "1").stderr == ""


def test_compare_matches_the_vertices_of_a_stream_without_its_order(files, tmp_path):
    stream, sheet = tmp_path / "a.reel", meshreel.load(files[0])
    stream.write_bytes(meshreel.encode(sheet, max_error=0.5, order="drop"))
    figures = run_json("compare", files[0], stream)
    assert 0 < figures["max_error_percent"] <= 0.5
    assert [note[:32] for note in figures["notes"]] == ["the order of vertices differs; t"]
    assert "the order of vertices differs" in run(files[0], stream).stderr


@pytest.mark.slow
def test_compare_shows_errors_of_vertices_of_segments(files, tmp_path):
    folder, stream = tmp_path / "frames", tmp_path / "a.reel"
    for name, path in zip("ab", files[:2], strict=True):
        meshreel.save(meshreel.load(path), folder / f"{name}_%d.ply")
    sequence = meshreel.load(folder, fps=25)
    stream.write_bytes(meshreel.encode(sequence, max_error=0.5, order="drop"))
    text = run(folder, stream, "--samples", 400).stdout
    assert "surfaces: the faces change over time" in text
    assert "KG error of vertices" in text
    assert "largest error of a vertex" in text
