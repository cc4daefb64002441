"""The player as a user starts it: a process of its own, asked over the network."""

import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import replace
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
"""The program, with another page than that of the package, which needs Node to be built."""


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
    """What `meshreel ARGUMENTS` says, with this page."""
    with patch("meshreel.app.viewer.page.FOLDER", page):
        return run(*arguments)


@contextmanager
def viewing(page, *arguments):
    """A running `meshreel view`: the process, and the port it listens on."""
    process = subprocess.Popen(
        command(page, "view", *arguments, "--no-open"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    try:
        line = process.stdout.readline()
        found = re.search(r"plays at http://127\.0\.0\.1:(\d+)/ \(ctrl-C stops it\)", line)
        assert found, (line, process.stderr.read())
        yield process, int(found[1])
    finally:
        process.kill()
        process.communicate()


def get(port, path):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
    connection.request("GET", path)
    answer = connection.getresponse()
    found = answer.status, answer.read()
    connection.close()
    return found


def get_json(port, path):
    status, body = get(port, path)
    assert status == 200
    return json.loads(body)


@pytest.mark.parametrize("command", [["view"], ["export", "-o", "page.html"]])
@pytest.mark.parametrize("name", ["my walk.npz", "my walk"])
def test_player_says_how_to_encode_when_it_is_given_an_input(page, tmp_path, command, name):
    given = tmp_path / name
    if given.suffix:
        meshreel.save(waving_grid(2), given)
    else:
        given.mkdir()
    done = run_with(page, *command, given)
    assert_fails(done, f"encode it first: meshreel encode '{given}' -o 'my walk.reel'")


def test_view_serves_page_and_data_until_it_is_interrupted(page, reel):
    with viewing(page, reel) as (process, port):
        assert get(port, "/") == (200, PAGE.served.encode())
        told = get_json(port, "/api/facts")
        assert (told["name"], told["original"]) == ("grid", None)
        info = meshreel.info(reel.read_bytes())
        rows = dict(told["rows"])
        assert rows["ratio"] == f"{info.ratio:.1f} x smaller"
        assert rows["sequence"] == "12 frames, 99 vertices, 160 faces"
        assert get(port, "/stream.reel") == (200, reel.read_bytes())
        assert get(port, "/api/original/0")[0] == 404
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)
    assert (process.returncode, out, err) == (0, "stopped\n", "")


@pytest.mark.slow
def test_view_shows_errors_in_the_words_of_compare_when_the_original_is_given(page, reel, grid):
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
    for name, words in plots["rows"]:
        assert name in done.stdout
        assert words.removesuffix(" (spatial part)") in done.stdout


@pytest.mark.slow
def test_view_is_stopped_while_it_measures_when_it_is_interrupted(page, tmp_path):
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
def test_view_survives_when_requests_are_malformed_or_from_strangers(page, reel):
    with viewing(page, reel) as (process, port):
        for data in (
            b"\x00\xff\r\n\r\n",
            b"GET /../../../etc/passwd HTTP/1.1\r\nHost: localhost\r\n\r\n",
            b"GET /api/facts HTTP/1.1\r\nHost: evil.example\r\n\r\n",
            b"POST /api/facts HTTP/1.1\r\nHost: localhost\r\nContent-Length: 3\r\n\r\nabc",
            b"GET / HTTP/1.1",
        ):
            with socket.create_connection(("127.0.0.1", port), timeout=30) as client:
                client.sendall(data)
                client.shutdown(socket.SHUT_WR)
                received = b"".join(iter(lambda client=client: client.recv(4096), b""))
                assert b"200 OK" not in received
                assert b"root:" not in received
        assert get(port, "/api/facts")[0] == 200
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=30)
    assert (process.returncode, err) == (0, "")


@pytest.mark.slow
def test_two_viewers_work_when_they_run_at_once(page, reel):
    with viewing(page, reel) as (_, first), viewing(page, reel) as (_, second):
        assert first != second
        assert get(first, "/stream.reel") == get(second, "/stream.reel")


@pytest.mark.slow
def test_view_names_the_port_when_it_is_in_use(page, reel):
    with viewing(page, reel) as (_, port):
        done = run_with(page, "view", reel, "--no-open", "--port", port)
    assert_fails(done, f"port {port} is in use")


@pytest.mark.parametrize("name", ["view", "export"])
def test_player_says_how_to_get_the_page_when_it_is_missing(name, reel, tmp_path):
    output = ["-o", tmp_path / "p.html"] if name == "export" else ["--no-open"]
    done = run_with(tmp_path / "none", name, reel, *output)
    assert_fails(done, "the page of the player is missing", "reinstall", "web/README")


@pytest.mark.parametrize("name", ["view", "export"])
@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda data: None, "there is no file or folder"),
        (lambda data: b"", "the file ends"),
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
def test_player_names_the_original_when_it_is_another(name, page, reel, grid, tmp_path):
    meshreel.save(waving_grid(13), grid, overwrite=True)
    output = ["-o", tmp_path / "p.html"] if name == "export" else ["--no-open"]
    done = run_with(page, name, reel, "--original", grid, *output)
    assert_fails(done, "grid.npz: the original has 13 frames and the file 12")


def test_export_tells_its_size_when_it_is_done(page, reel, tmp_path):
    target = tmp_path / "p.html"
    done = run_with(page, "export", reel, "-o", target, "--json")
    assert (done.returncode, done.stderr) == (0, "")
    told, size_bytes = json.loads(done.stdout), target.stat().st_size
    assert (told["output"], told["size_bytes"]) == (str(target), size_bytes)
    assert list(told["parts"]) == ["player", "animation"]
    assert carried(target.read_text())["stream"] == reel.read_bytes()
    table = run_with(page, "export", reel, "-o", target, "--force").stdout
    assert "size" in table
    assert "of which animation" in table


def test_export_keeps_a_page_when_it_is_there_already(page, reel, tmp_path):
    (tmp_path / "p.html").write_text("mine")
    assert_fails(run_with(page, "export", reel, "-o", tmp_path / "p.html"), "already exists")
    assert (tmp_path / "p.html").read_text() == "mine"


def test_export_carries_the_original_when_it_is_given(page, reel, grid, tmp_path):
    target = tmp_path / "p.html"
    done = run_with(page, "export", reel, "-o", target, "--original", grid)
    assert (done.returncode, done.stderr) == (0, "")
    data = carried(target.read_text())
    told = data["facts"]["original"]
    assert told["name"] == "grid"
    assert dict(told["rows"])["KG error"].endswith(" %")
    original = meshreel.decode(data["original"]).vertices
    assert abs(original - waving_grid().vertices).max() < 1e-3


def test_export_says_so_when_the_stream_is_of_another_method(page, tmp_path):
    (tmp_path / "old.reel").write_bytes(meshreel.encode(waving_grid(), method="pca-qp"))
    done = run_with(page, "export", tmp_path / "old.reel", "-o", tmp_path / "p.html")
    assert "old.reel holds pca-qp; it is encoded anew as reel" in done.stderr.replace("\n", " ")
    data = carried((tmp_path / "p.html").read_text())
    assert "encoded anew" in dict(data["facts"]["rows"])["shown"]
    assert meshreel.info(data["stream"]).method == "reel"
    before = meshreel.decode((tmp_path / "old.reel").read_bytes()).vertices
    after = meshreel.decode(data["stream"]).vertices
    assert abs(after - before).max() < 1.1e-5 * np.linalg.norm(np.ptp(before, axis=(0, 1)))


def test_export_writes_parts_beside_the_page_when_it_is_split(page, reel, tmp_path):
    site = tmp_path / "site"
    site.mkdir()
    done = run_with(page, "export", reel, "-o", site / "p.html", "--split", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert sorted(path.name for path in site.iterdir()) == ["p.html", "p.reel", "player.js"]
    assert (site / "p.reel").read_bytes() == reel.read_bytes()
    told = json.loads(done.stdout)
    assert told["size_bytes"] == sum(path.stat().st_size for path in site.iterdir())
    again = run_with(page, "export", reel, "-o", site / "q.html", "--split")
    assert again.returncode == 0  # the script is there already
    (site / "p.reel").write_bytes(b"mine")
    assert_fails(run_with(page, "export", reel, "-o", site / "p.html", "--split"), "already exists")


def test_export_refuses_a_texture_when_it_cannot_be_shown(page, reel, tmp_path):
    (tmp_path / "a.txt").write_text("no image")
    (tmp_path / "a.png").write_bytes(b"image")
    for name, words in [
        ("a.txt", "no image or video"),
        ("b.png", "is not there"),
        ("a.png", "has no texture coordinates"),
    ]:
        target = ["-o", tmp_path / "p.html", "--texture", tmp_path / name]
        assert_fails(run_with(page, "export", reel, *target), words)


@pytest.mark.slow
def test_view_plays_what_is_whole_when_the_file_is_cut_off(page, tmp_path):
    data = meshreel.encode(replace(waving_grid(12), name=""), block_frames=4)
    (tmp_path / "cut.reel").write_bytes(data[:-150])
    with viewing(page, tmp_path / "cut.reel") as (_, port):
        told = get_json(port, "/api/facts")
    assert (told["is_whole"], told["name"]) == (False, "cut")
    assert 0 < len(told["n_modes"]) < 3
    assert "cut off" in dict(told["rows"])["end"]


@pytest.fixture
def tracked(tmp_path):
    """A stream with a track of vertices."""
    grid = waving_grid()
    tracks = {"height": meshreel.Track(grid.vertices[:, :, 2].astype(np.float32), unit="m")}
    path = tmp_path / "tracked.reel"
    path.write_bytes(meshreel.encode(replace(grid, tracks=tracks)))
    return path


@pytest.mark.slow
def test_view_and_export_tell_the_page_the_track_that_is_named(page, tracked, tmp_path):
    options = ["--track", "height", "--range", "0:2", "--component", "0", "--colormap", "diverging"]
    wanted = {"track": "height", "component": "0", "range": "0:2", "colormap": "diverging"}
    with viewing(page, tracked, *options) as (_, port):
        assert get_json(port, "/api/facts")["colored_by"] == wanted
    output = tmp_path / "page.html"
    assert run_with(page, "export", tracked, "-o", output, *options).returncode == 0
    assert carried(output.read_text("utf-8"))["facts"]["colored_by"] == wanted


@pytest.mark.parametrize("command", ["view", "export"])
def test_track_that_is_not_there_is_refused_with_those_that_are(page, tracked, tmp_path, command):
    more = ["-o", tmp_path / "page.html"] if command == "export" else []
    done = run_with(page, command, tracked, *more, "--track", "hight")
    assert_fails(done, "tracked.reel: the file has no track 'hight'; choose height")
    done = run_with(page, command, tracked, *more, "--range", "0:1")
    assert_fails(done, "--range says how a track is shown; name it with --track")
    done = run_with(page, command, tracked, *more, "--track", "height", "--range", "1:0")
    assert_fails(done, "meshreel: a range is LOW:HIGH")
