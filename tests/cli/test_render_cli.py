"""`meshreel render`: pictures, films, plots and errors."""

import numpy as np
import pytest
from PIL import Image, ImageSequence

import meshreel
from conformance.sources import boxes, of_type
from meshreel.model.sequence import MeshSequence
from samples.commands import assert_fails, run, run_json, run_ok
from samples.meshes import waving_grid

SMALL = ("--size", "800x450")
"""Options for a small picture."""


@pytest.fixture(scope="module")
def flag(tmp_path_factory):
    """A folder with flag.npz, its stream flag.reel, and another mesh."""
    folder = tmp_path_factory.mktemp("flag")
    sequence = meshreel.simulate_flag(12, n_rows=16, n_columns=20)
    meshreel.save(sequence, folder / "flag.npz")
    (folder / "flag.reel").write_bytes(meshreel.encode(sequence, quality=40))
    meshreel.save(waving_grid(), folder / "grid.npz")
    return folder


def foreground_of(path):
    with Image.open(path) as image:
        return (np.asarray(image.convert("RGB")) != 255).any(axis=2)


@pytest.mark.slow
def test_render_draws_a_contact_sheet_by_default(flag, tmp_path):
    info = run_json("render", flag / "flag.reel", "-o", tmp_path / "a.png")
    assert info["frames"] == [0, 2, 3, 5, 6, 8, 9, 11]
    picture = foreground_of(tmp_path / "a.png")
    assert list(picture.shape[::-1]) == info["size_px"]
    assert 0.3 < picture.mean() < 0.9


@pytest.mark.slow
def test_render_fills_the_picture_with_a_single_frame(flag, tmp_path):
    options = ["--frames", 7, "--size", "320x240", "--view", "front", "--background", "#ffffff"]
    info = run_json("render", flag / "flag.reel", "-o", tmp_path / "a.png", *options)
    assert (info["frames"], info["size_px"]) == ([7], [320, 240])
    assert 0.3 < foreground_of(tmp_path / "a.png").mean() < 0.9


def test_render_writes_a_film_at_the_given_rate(flag, tmp_path):
    options = ["--frames", "1:6", "--size", "120x90", "--fps", 20]
    info = run_json("render", flag / "flag.npz", "-o", tmp_path / "a.gif", *options)
    assert (info["n_pictures"], info["fps"]) == (5, 20)
    with Image.open(tmp_path / "a.gif") as image:
        assert image.size == (120, 90)
        assert len(list(ImageSequence.Iterator(image))) == 5


@pytest.mark.slow
def test_render_prints_a_table_by_default(flag, tmp_path):
    done = run_ok("render", flag / "flag.reel", "-o", "a.png", "--frames", "0:4", cwd=tmp_path)
    for words in ("a.png", "pixels", "0, 1, 2, 3"):
        assert words in done.stdout


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["-o", "a.jpg"], [".png, .mp4, .gif", "got .jpg"]),
        (["-o", "a"], ["got no extension"]),
        (["-o", "a.png", "--heatmap", "angle"], ["--original"]),
        (["-o", "a.png", "--original", "flag.npz", "--heatmap", "heat"], ["'distance', 'angle'"]),
        (
            ["-o", "a.png", "--original", "grid.npz", "--heatmap", "sted"],
            ["vertex counts differ", "distance compares any surfaces"],
        ),
        (["-o", "a.png", "--frames", "12"], ["frames 0 to 11"]),
        (["-o", "a.png", "--frames", "9:9"], ["--frames 9:9 select no frame", "0:12"]),
        (["-o", "a.png", "--frames", "1;2"], ["A:B", "0,10,20"]),
        (["-o", "a.png", "--frames", "1:9:2"], ["A:B"]),
        (["-o", "a.png", "--view", "behind"], ["front, side, top"]),
        (["-o", "a.png", "--view", "0,91"], ["-90..90"]),
        (["-o", "a.png", "--up", "w"], ["'x', 'y', 'z'"]),
        (["-o", "a.png", "--size", "big"], ["1280x720"]),
        (["-o", "a.png", "--size", "20x20"], ["larger --size"]),
        (["-o", "a.png", "--background", "sky"], ["#rrggbb"]),
        (["-o", "a.png", "--cut", "x"], ["--cut shows the inside of cells"]),
        (["-o", "missing/a.png"], ["does not exist"]),
    ],
)
def test_error_says_what_is_allowed_when_an_option_is_invalid(flag, options, words):
    before = sorted(flag.iterdir())
    assert_fails(run("render", "flag.reel", *options, cwd=flag), *words)
    assert sorted(flag.iterdir()) == before


@pytest.fixture(scope="module")
def warm(flag):
    """The folder with warm.npz and warm.reel, whose tracks are a height and a velocity."""
    plain = meshreel.load(flag / "flag.npz")
    velocity = np.gradient(plain.vertices, axis=0)
    tracks = {
        "height": meshreel.Track(plain.vertices[..., 1], unit="m"),
        "speed": meshreel.Track(velocity, kind="velocity", unit="m/s"),
    }
    sequence = MeshSequence(plain.vertices, plain.faces, plain.fps, tracks=tracks)
    meshreel.save(sequence, flag / "warm.npz")
    (flag / "warm.reel").write_bytes(meshreel.encode(sequence, tracks={"height": "3%"}))
    return flag


@pytest.mark.slow
def test_render_colors_the_mesh_by_a_track(warm, tmp_path):
    options = ["--track", "speed", "--component", "y", "--range", "5%:95%", "--frames", 6, *SMALL]
    info = run_json("render", warm / "warm.reel", "-o", tmp_path / "a.png", *options)
    run_json("render", warm / "warm.reel", "-o", tmp_path / "plain.png", *SMALL, "--frames", 6)
    assert info["frames"] == [6]
    vivid_shares = []
    for name in ("a.png", "plain.png"):
        with Image.open(tmp_path / name) as image:
            vivid_shares.append(
                (np.ptp(np.asarray(image.convert("RGB")).astype(int), axis=2) > 60).mean()
            )
    assert vivid_shares[0] > 0.2 > vivid_shares[1]


@pytest.mark.slow
def test_film_of_uneven_times_notes_its_rate(warm, tmp_path):
    sequence = meshreel.load(warm / "warm.npz")[:4].replace(times=[0, 1, 2, 2.5])
    meshreel.save(sequence, tmp_path / "uneven.npz")
    result = run_json("render", tmp_path / "uneven.npz", "-o", tmp_path / "a.gif", *SMALL)
    assert "frame times are uneven; the film has 1.2 pictures per second" in result["notes"][0]


@pytest.mark.slow
def test_render_shows_the_error_of_a_track_with_an_original(warm, tmp_path):
    run_json(
        "render", warm / "warm.reel", "-o", tmp_path / "a.gif", "--frames", "2:4",
        "--original", warm / "warm.npz", "--track", "height", "--heatmap", "track", *SMALL,
    )  # fmt: skip
    with Image.open(tmp_path / "a.gif") as image:
        assert len(list(ImageSequence.Iterator(image))) == 2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--track", "hight"], "there is no track 'hight'; did you mean 'height'?"),
        (["--component", "x"], "--component applies to a track; name it with --track"),
        (["--range", "0:1"], "--range applies to a track; name it with --track"),
        (["--colormap", "diverging"], "--colormap applies to a track; name it with"),
        (
            ["--track", "height", "--colormap", "jet"],
            "is not one of 'sequential'",
        ),
        (["--track", "height", "--range", "1:0"], "a range is LOW:HIGH, low first"),
        (["--track", "speed", "--component", "w"], "--component is 0 to 2, x, y, z, magnitude"),
        (["--track", "height", "--heatmap", "track"], "original; name it with --original"),
        (["--original", "warm.npz", "--heatmap", "track"], "needs its name: add --track"),
    ],
)
def test_error_says_why_a_track_cannot_be_shown(warm, tmp_path, options, message):
    done = run("render", warm / "warm.reel", "-o", tmp_path / "a.png", *options, cwd=warm)
    assert_fails(done, message)
    assert not (tmp_path / "a.png").exists()


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """A folder with frame files whose faces change, and their streams with and without order."""
    folder = tmp_path_factory.mktemp("capture")
    grid = waving_grid(6)
    meshreel.save(MeshSequence(grid.vertices[:2], grid.faces[::2]), folder / "frames/a_%d.ply")
    meshreel.save(MeshSequence(grid.vertices[2:], grid.faces), folder / "frames/b_%d.ply")
    sequence = meshreel.load(folder / "frames", fps=10)
    for order in ("keep", "drop"):
        data = meshreel.encode(sequence, quality=40, order=order)
        (folder / f"{order}.reel").write_bytes(data)
    return folder


@pytest.mark.parametrize("source", ["frames", "keep.reel", "drop.reel"])
def test_render_draws_frames_whose_faces_change(capture, tmp_path, source):
    views = []
    for frame in (1, 2):
        options = ["--frames", frame, *SMALL, "--view", "top", "--up", "z"]
        run_json("render", capture / source, "-o", tmp_path / f"{frame}.png", *options)
        views.append(foreground_of(tmp_path / f"{frame}.png"))
    assert 0.35 < views[0].sum() / views[1].sum() < 0.65


def test_render_films_frames_whose_faces_change(capture, tmp_path):
    info = run_json("render", capture / "keep.reel", "-o", tmp_path / "a.gif", "--size", "120x90")
    assert (info["n_pictures"], info["fps"]) == (6, 10)
    with Image.open(tmp_path / "a.gif") as image:
        assert len(list(ImageSequence.Iterator(image))) == 6


def test_render_cuts_a_volume_mesh_open(tmp_path):
    points, cells = boxes(3, 3, 3)
    heat = np.abs(points - 1.5).max(axis=1)[None]
    block = MeshSequence(points[None], cells=of_type(12, cells), tracks={"heat": heat})
    meshreel.save(block, tmp_path / "a.npz")
    size = ["--size", "320x240", "--track", "heat"]
    run_ok("render", tmp_path / "a.npz", "-o", tmp_path / "whole.png", *size)
    run_ok("render", tmp_path / "a.npz", "-o", tmp_path / "half.png", *size, "--cut", "z=50%")
    whole, half = (Image.open(tmp_path / name).tobytes() for name in ("whole.png", "half.png"))
    assert whole != half
    done = run("render", tmp_path / "a.npz", "-o", tmp_path / "b.png", "--cut", "z=-1")
    assert_fails(done, "no cell is below z = -1", "--cut")
