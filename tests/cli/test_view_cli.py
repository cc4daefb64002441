"""`meshreel view` in a separate process with HTTP requests, and `meshreel export`."""

import http.client
import json
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from unittest.mock import patch

import numpy as np
import pytest

import meshreel
from samples.commands import assert_fails, run
from samples.meshes import waving_grid
from samples.players import PAGE, carried, write_page

WITH_PAGE = (
    "import sys; from pathlib import Path; from meshreel.app.viewer import page; "
    "page.FOLDER = Path(sys.argv.pop(1)); from meshreel.app.cli import main; main()"
)
"""The program with a stub page, because building the real one needs Node."""


@pytest.fixture
def page(tmp_path):
    return write_page(tmp_path / "page")


@pytest.fixture
def grid(tmp_path):
    path = tmp_path / "grid.npz"
    meshreel.save(waving_grid(), path)
    return path


@pytest.fixture
def reel(tmp_path):
    path = tmp_path / "made.reel"
    path.write_bytes(meshreel.encode(waving_grid(), quality=40))
    return path


def command(page, *arguments):
    return [sys.executable, "-c", WITH_PAGE, str(page), *map(str, arguments)]


def run_with(page, *arguments):
    """Run `meshreel ARGUMENTS` with this page, and return the result."""
    with patch("meshreel.app.viewer.page.FOLDER", page):
        return run(*arguments)


@contextmanager
def viewing(page, *arguments):
    """Run `meshreel view`, and return the process and its port."""
    process = subprocess.Popen(
        command(page, "view", *arguments, "--no-open"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    try:
        line = process.stdout.readline()
        match = re.search(r"plays at http://127\.0\.0\.1:(\d+)/ \(ctrl-C stops it\)", line)
        assert match, (line, process.stderr.read())
        yield process, int(match[1])
    finally:
        process.kill()
        process.communicate()


def get(port, path):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
    connection.request("GET", path)
    answer = connection.getresponse()
    result = answer.status, answer.read()
    connection.close()
    return result


def get_json(port, path):
    status, body = get(port, path)
    assert status == 200
    return json.loads(body)


@pytest.mark.parametrize("command", [["view"], ["export", "-o", "page.html"]])
@pytest.mark.parametrize("name", ["my walk.npz", "my walk"])
def test_player_says_how_to_encode_when_its_input_is_not_a_stream(page, tmp_path, command, name):
    path = tmp_path / name
    if path.suffix:
        meshreel.save(waving_grid(2), path)
    else:
        path.mkdir()
    done = run_with(page, *command, path)
    assert_fails(done, f"encode it first: meshreel encode '{path}' -o 'my walk.reel'")


def test_view_serves_page_and_data_until_it_is_interrupted(page, reel):
    with viewing(page, reel) as (process, port):
        assert get(port, "/") == (200, PAGE.served.encode())
        facts = get_json(port, "/api/facts")
        assert (facts["name"], facts["original"]) == ("grid", None)
        info = meshreel.info(reel.read_bytes())
        rows = dict(facts["rows"])
        assert rows["ratio"] == f"{info.ratio:.1f} x smaller"
        assert rows["sequence"] == "12 frames, 99 vertices, 160 faces"
        assert get(port, "/stream.reel") == (200, reel.read_bytes())
        assert get(port, "/api/original/0")[0] == 404
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)
    assert (process.returncode, out, err) == (0, "stopped\n", "")


@pytest.mark.slow
def test_view_shows_the_error_figures_of_compare_with_an_original(page, reel, grid):
    with viewing(page, reel, "--original", grid) as (process, port):
        for _ in range(300):
            plots = get_json(port, "/api/plots")
            if plots["ready"]:
                break
            time.sleep(0.1)
        assert len(get(port, "/api/original/7")[1]) == 99 * 12
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=30)
    assert process.returncode == 0
    done = run("compare", grid, reel)
    for name, text in plots["rows"]:
        abbreviation = re.sub(r".* \((.+)\)$", r"\1", name)  # compare has only this
        assert abbreviation in done.stdout
        assert text.removesuffix(" (spatial part)") in done.stdout


@pytest.mark.slow
def test_view_stops_while_measuring_when_it_is_interrupted(page, tmp_path):
    sequence = waving_grid(400, 40, 40)
    meshreel.save(sequence, tmp_path / "long.npz")
    (tmp_path / "long.reel").write_bytes(meshreel.encode(sequence))
    with viewing(page, tmp_path / "long.reel", "--original", tmp_path / "long.npz") as (
        process,
        port,
    ):
        assert get_json(port, "/api/plots")["ready"] is False
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)
    assert (process.returncode, out, err) == (0, "stopped\n", "")


@pytest.mark.slow
def test_view_names_the_port_when_it_is_in_use(page, reel):
    with viewing(page, reel) as (_, port):
        done = run_with(page, "view", reel, "--no-open", "--port", port)
    assert_fails(done, f"port {port} is in use")


@pytest.mark.parametrize("name", ["view", "export"])
def test_player_says_how_to_get_the_page_when_it_is_missing(name, reel, tmp_path):
    output = ["-o", tmp_path / "p.html"] if name == "export" else ["--no-open"]
    done = run_with(tmp_path / "none", name, reel, *output)
    assert_fails(done, "the page of the player is missing", "reinstall", "CONTRIBUTING")


@pytest.mark.parametrize("name", ["view", "export"])
@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda data: None, "there is no file or folder"),
        (lambda data: b"", "is empty"),
        (lambda data: b"PK\3\4" + data, "not a .reel"),
        (lambda data: data[:300] + b"\0\0\0\0" + data[304:], "made.reel: "),
    ],
)
def test_player_fails_before_it_starts_when_the_file_is_missing_or_broken(
    name, damage, words, page, reel, tmp_path
):
    data = damage(reel.read_bytes())
    reel.unlink()
    if data is not None:
        reel.write_bytes(data)
    output = ["-o", tmp_path / "p.html"] if name == "export" else ["--no-open"]
    done = run_with(page, name, reel, *output)
    assert_fails(done, words, "made.reel")
    assert not (tmp_path / "p.html").exists()


@pytest.mark.parametrize("name", ["view", "export"])
def test_player_names_the_original_when_it_does_not_match(name, page, reel, grid, tmp_path):
    meshreel.save(waving_grid(13), grid, overwrite=True)
    output = ["-o", tmp_path / "p.html"] if name == "export" else ["--no-open"]
    done = run_with(page, name, reel, "--original", grid, *output)
    assert_fails(done, "grid.npz: the original has 13 frames and the file 12")


def test_export_prints_the_sizes_of_the_page(page, reel, tmp_path):
    target = tmp_path / "p.html"
    done = run_with(page, "export", reel, "-o", target, "--json")
    assert (done.returncode, done.stderr) == (0, "")
    figures, size_bytes = json.loads(done.stdout), target.stat().st_size
    assert (figures["output"], figures["size_bytes"]) == (str(target), size_bytes)
    assert list(figures["parts"]) == ["player", "animation"]
    assert carried(target.read_text())["stream"] == reel.read_bytes()
    table = run_with(page, "export", reel, "-o", target, "--force").stdout
    assert "size" in table
    assert "of which animation" in table


def test_exported_page_contains_the_original(page, reel, grid, tmp_path):
    target = tmp_path / "p.html"
    done = run_with(page, "export", reel, "-o", target, "--original", grid)
    assert (done.returncode, done.stderr) == (0, "")
    data = carried(target.read_text())
    original = data["facts"]["original"]
    assert dict(original["rows"])["overall error (KG error)"].endswith(" %")
    vertices = meshreel.decode(data["original"]).vertices
    assert abs(vertices - waving_grid().vertices).max() < 1e-3


def test_export_prints_a_note_when_it_reencodes_the_stream(page, tmp_path):
    (tmp_path / "old.reel").write_bytes(meshreel.encode(waving_grid(), method="pca-qp"))
    done = run_with(page, "export", tmp_path / "old.reel", "-o", tmp_path / "p.html")
    note = "old.reel uses method pca-qp; the player shows it re-encoded as reel"
    assert note in done.stderr.replace("\n", " ")


def test_export_writes_separate_files_with_split(page, reel, tmp_path):
    site = tmp_path / "site"
    site.mkdir()
    done = run_with(page, "export", reel, "-o", site / "p.html", "--split", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert {path.name for path in site.iterdir()} == {"p.html", "p.reel", "player.js"}
    assert (site / "p.reel").read_bytes() == reel.read_bytes()
    figures = json.loads(done.stdout)
    assert figures["size_bytes"] == sum(path.stat().st_size for path in site.iterdir())
    again = run_with(page, "export", reel, "-o", site / "q.html", "--split")
    assert again.returncode == 0  # an identical script exists
    (site / "p.reel").write_bytes(b"mine")
    assert_fails(run_with(page, "export", reel, "-o", site / "p.html", "--split"), "already exists")


def test_export_rejects_a_texture_that_cannot_be_shown(page, reel, tmp_path):
    (tmp_path / "a.txt").write_text("no image")
    (tmp_path / "a.png").write_bytes(b"image")
    for name, words in [
        ("a.txt", "not an image or video"),
        ("b.png", "there is no file"),
        ("a.png", "has no texture coordinates"),
    ]:
        target = ["-o", tmp_path / "p.html", "--texture", tmp_path / name]
        assert_fails(run_with(page, "export", reel, *target), words)


@pytest.mark.slow
def test_view_plays_the_complete_blocks_when_the_file_is_truncated(page, tmp_path):
    data = meshreel.encode(waving_grid(12).replace(name=""), block_frames=4)
    (tmp_path / "cut.reel").write_bytes(data[:-150])
    with viewing(page, tmp_path / "cut.reel") as (_, port):
        facts = get_json(port, "/api/facts")
    assert facts["name"] == "cut"
    rows = dict(facts["rows"])
    assert rows["sequence"].startswith("8 frames, ")  # two of three blocks are complete
    assert "truncated" in rows["end"]


@pytest.fixture
def tracked(tmp_path):
    """A stream with a vertex track."""
    grid = waving_grid()
    tracks = {"height": meshreel.Track(grid.vertices[:, :, 2].astype(np.float32), unit="m")}
    path = tmp_path / "tracked.reel"
    path.write_bytes(meshreel.encode(grid.replace(tracks=tracks)))
    return path


@pytest.mark.slow
def test_view_and_export_pass_the_look_of_the_track_to_the_page(page, tracked, tmp_path):
    options = ["--track", "height", "--range", "0:2", "--component", "0", "--colormap", "diverging"]
    expected = {"track": "height", "component": "0", "range": "0:2", "colormap": "diverging"}
    with viewing(page, tracked, *options) as (_, port):
        assert get_json(port, "/api/facts")["colored_by"] == expected
    output = tmp_path / "page.html"
    assert run_with(page, "export", tracked, "-o", output, *options).returncode == 0
    assert carried(output.read_text("utf-8"))["facts"]["colored_by"] == expected


@pytest.mark.parametrize("command", ["view", "export"])
def test_error_lists_the_tracks_when_one_does_not_exist(page, tracked, tmp_path, command):
    more = ["-o", tmp_path / "page.html"] if command == "export" else []
    done = run_with(page, command, tracked, *more, "--track", "hight")
    assert_fails(done, "tracked.reel: there is no track 'hight'; did you mean 'height'?")
    done = run_with(page, command, tracked, *more, "--range", "0:1")
    assert_fails(done, "--range applies to a track; name it with --track")
    done = run_with(page, command, tracked, *more, "--track", "height", "--range", "1:0")
    assert_fails(done, "meshreel: a range is LOW:HIGH")
