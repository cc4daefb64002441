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

import pytest

import meshreel
from samples.commands import assert_fails, run
from samples.meshes import waving_grid
from samples.packets import inlined, read_packet
from samples.players import PAGE

WITH_PAGE = (
    "import sys; from pathlib import Path; from meshreel.viewer import page; "
    "page.PAGE = Path(sys.argv.pop(1)); from meshreel.cli import main; main()"
)
"""The program, with another page than that of the package, which needs Node to be built."""


@pytest.fixture
def page(tmp_path):
    path = tmp_path / "page.html"
    path.write_text(PAGE)
    return path


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
    with patch("meshreel.viewer.page.PAGE", page):
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


def test_view_serves_page_and_data_until_it_is_interrupted(page, reel):
    with viewing(page, reel) as (process, port):
        assert get(port, "/") == (200, PAGE.encode())
        told = get_json(port, "/api/reel")
        assert (told["name"], told["n_frames"], told["original"]) == ("grid", 12, None)
        info = meshreel.info(reel.read_bytes())
        rows = dict(told["rows"])
        assert rows["ratio"] == f"{info.ratio:.1f} x smaller"
        assert rows["sequence"] == "12 frames, 99 vertices, 160 faces"
        assert read_packet(get(port, "/api/block/0")[1])[0]["n_frames"] == 12
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
        heat = read_packet(get(port, "/api/heat/angle/7")[1])[1]["values"]
        assert heat.shape == (99,)
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
            b"GET /api/reel HTTP/1.1\r\nHost: evil.example\r\n\r\n",
            b"POST /api/reel HTTP/1.1\r\nHost: localhost\r\nContent-Length: 3\r\n\r\nabc",
            b"GET / HTTP/1.1",
        ):
            with socket.create_connection(("127.0.0.1", port), timeout=30) as client:
                client.sendall(data)
                client.shutdown(socket.SHUT_WR)
                received = b"".join(iter(lambda client=client: client.recv(4096), b""))
                assert b"200 OK" not in received
                assert b"root:" not in received
        assert get(port, "/api/reel")[0] == 200
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=30)
    assert (process.returncode, err) == (0, "")


@pytest.mark.slow
def test_two_viewers_work_when_they_run_at_once(page, reel):
    with viewing(page, reel) as (_, first), viewing(page, reel) as (_, second):
        assert first != second
        assert get(first, "/api/block/0") == get(second, "/api/block/0")


@pytest.mark.slow
def test_view_names_the_port_when_it_is_in_use(page, reel):
    with viewing(page, reel) as (_, port):
        done = run_with(page, "view", reel, "--no-open", "--port", port)
    assert_fails(done, f"port {port} is in use")


@pytest.mark.parametrize("name", ["view", "export"])
def test_player_says_how_to_get_the_page_when_it_is_not_built(name, reel, tmp_path):
    output = ["-o", tmp_path / "p.html"] if name == "export" else ["--no-open"]
    done = run_with(tmp_path / "none.html", name, reel, *output)
    assert_fails(done, "the page of the player is not built", "npm ci", "wheel")


@pytest.mark.parametrize("name", ["view", "export"])
@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda data: None, "there is no file or folder"),
        (lambda data: b"", "the stream"),
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
    assert inlined(target.read_text())["api/reel"]["n_frames"] == 12
    table = run_with(page, "export", reel, "-o", target, "--force").stdout
    assert "size" in table
    assert "of which animation" in table


def test_export_keeps_a_page_when_it_is_there_already(page, reel, tmp_path):
    (tmp_path / "p.html").write_text("mine")
    assert_fails(run_with(page, "export", reel, "-o", tmp_path / "p.html"), "exists and is kept")
    assert (tmp_path / "p.html").read_text() == "mine"


def test_export_carries_the_original_when_it_is_given(page, reel, grid, tmp_path):
    target = tmp_path / "p.html"
    done = run_with(page, "export", reel, "-o", target, "--original", grid)
    assert (done.returncode, done.stderr) == (0, "")
    data = inlined(target.read_text())
    assert data["api/reel"]["original"]["name"] == "grid"
    assert dict(data["api/plots"]["rows"])["KG error"].endswith(" %")
    assert "api/heat/sted/11" in data


@pytest.mark.slow
def test_view_plays_what_is_whole_when_the_file_is_cut_off(page, tmp_path):
    data = meshreel.encode(replace(waving_grid(12), name=""), block_frames=4)
    (tmp_path / "cut.reel").write_bytes(data[:-150])
    with viewing(page, tmp_path / "cut.reel") as (_, port):
        told = get_json(port, "/api/reel")
    assert (told["is_whole"], told["name"]) == (False, "cut")
    assert 0 < told["n_frames"] < 12
    assert "cut off" in dict(told["rows"])["end"]
