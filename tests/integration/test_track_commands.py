"""Tracks on the command line: bounds accepted, printed and refused."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

import meshreel
from meshreel.app.cli.app import app
from samples.meshes import waving_grid

GRID = waving_grid(12)
WAVES = np.sin(np.arange(12)[:, None] / 3 + np.arange(GRID.n_verts) / 20)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sequence = meshreel.MeshSequence(
        GRID.vertices,
        GRID.faces,
        25,
        tracks={
            "heat": meshreel.Track(300 + 20 * WAVES, unit="K"),
            "flow": meshreel.Track(WAVES * 3),
        },
    )
    (tmp_path / "a.reel").write_bytes(meshreel.encode(sequence, tracks={"heat": 1e-4}))
    return tmp_path


def run(*words):
    return CliRunner().invoke(app, [*map(str, words)])


def test_bounds_are_kept_and_printed(folder):
    done = run("convert", "a.reel", "-o", "b.reel", "--track", "heat=0.5K", "--track", "flow=drop")
    assert done.exit_code == 0, done.output
    rows = [line.split() for line in done.output.splitlines()]
    (row,) = [row for row in rows if row[:2] == ["track", "heat"]]
    assert " ".join(row[2:8]) == "0.5001 K, --track, plus the source's"
    assert 0.1 < float(row[8]) <= 0.5
    with meshreel.open("b.reel") as reel:
        assert list(reel.tracks) == ["heat"]
    said = run("info", "b.reel").output
    assert "heat: scalar of each vertex, float64 in K, within 0.5001 K," in said
    compared = json.loads(run("compare", "a.reel", "b.reel", "--json").stdout)
    assert 0.1 < compared["tracks"]["heat"]["largest"] <= 0.5
    assert "RMS" in run("compare", "a.reel", "b.reel").output


def test_unit_that_the_file_does_not_name_is_left_out_with_a_note(folder):
    done = run("convert", "a.reel", "-o", "b.reel", "--track", "flow=0.5m/s", "--json")
    assert done.exit_code == 0, done.output
    said = "track 'flow' has no unit in the file; its bound 0.5m/s is read as 0.5"
    assert said in json.loads(done.stdout)["notes"]
    with meshreel.open("b.reel") as reel:
        assert {track.name: track.bound for track in reel.info().tracks}["flow"] == pytest.approx(
            0.512
        )


def test_bytes_of_parts_and_tracks_sum_to_the_file_and_are_printed(folder):
    figures = json.loads(run("convert", "a.reel", "-o", "b.reel", "--json").stdout)
    parts = figures["part_bytes"]
    names = ["positions", "connectivity", "order", "track heat", "track flow", "container"]
    assert list(parts) == names
    assert sum(parts.values()) == (folder / "b.reel").stat().st_size
    printed = run("convert", "a.reel", "-o", "c.reel").stdout
    for name, size_bytes in parts.items():
        assert any(name in line and f" {size_bytes} " in line for line in printed.splitlines()), (
            name
        )


def test_encoding_prints_what_set_each_bound(folder):
    fractions = np.random.default_rng(0).integers(0, 1000, WAVES.shape) / np.float32(64)
    tracks = {"fractions": fractions, "number": (9 * WAVES).astype(int)}
    meshreel.save(GRID.replace(tracks={**tracks, "wave": WAVES}), "sim.npz")
    for words, wave in [
        (["--quality", 68], "0.4 %, quality 68"),
        (["--max-error", 1], "0.1 %, default"),
        (["--bound", 1], "1 %, --bound"),
    ]:
        words += ["--track", "fractions=1e-5"]
        done = run("encode", "sim.npz", "-o", "b.reel", "--force", *words)
        assert done.exit_code == 0, done.output
        assert " exact, for size or precision " in done.output
        assert " exact, integers " in done.output
        assert wave in done.output
    assert done.output.count("--bound") == 1


def test_encoding_notes_solver_state(folder):
    track = meshreel.Track(GRID.vertices, kind="vector")
    sequence = meshreel.MeshSequence(GRID.vertices, GRID.faces, 25, tracks={"vlast": track})
    meshreel.save(sequence, "sim.npz")
    [note] = json.loads(run("encode", "sim.npz", "-o", "b.reel", "--json").stdout)["notes"]
    assert "vlast; tracks by size: vlast (" in note
    dropped = run("encode", "sim.npz", "-o", "c.reel", "--track", "vlast=drop", "--json")
    assert json.loads(dropped.stdout)["notes"] == []


def test_advice_on_a_size_mentions_tracks(folder):
    words = ["convert", "a.reel", "-o", "b.reel", "--size", "50"]
    assert "or drop tracks or allow" in str(run(*words).exception)
    drop = ["--track", "heat=drop", "--track", "flow=drop"]
    assert "tracks" not in str(run(*words, *drop).exception)


def test_json_has_the_errors_of_tracks(folder):
    done = run("convert", "a.reel", "-o", "b.reel", "--track", "heat=1%", "--json")
    result = json.loads(done.stdout)["tracks"]
    assert result["heat"]["unit"] == "K"
    origins = {name: errors["bound_origin"] for name, errors in result.items()}
    flow = "0.2 %, quality 80, plus the source's"
    assert origins == {"heat": "--track, plus the source's", "flow": flow}
    assert len(result["flow"]["rms_of_frames"]) == 12
    [heat, _] = json.loads(run("info", "b.reel", "--json").stdout)["tracks"]
    assert heat["bound"] == pytest.approx(0.01 * np.ptp(300 + 20 * WAVES), rel=1e-3)
    assert 0 < heat["size_bytes"] < heat["raw_size_bytes"] / 8


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["b.reel", "--track", "heat"], "takes a name and a bound, as in stress=0.1%; got 'heat'"),
        (["b.reel", "--track", "heat=1", "--track", "heat=2"], "names 'heat' twice"),
        (["b.reel", "--track", "hat=1"], "did you mean 'heat'?"),
        (["b.npz", "--track", "heat=1"], "--track applies to .reel outputs, not to b.npz"),
    ],
)
def test_impossible_bounds_are_refused_with_a_message(folder, words, told):
    done = run("convert", "a.reel", "-o", *words)
    assert done.exit_code != 0
    assert told in " ".join(f"{done.output} {done.exception}".split())


def test_batch_accepts_bounds_and_reports_missing_tracks(folder):
    (folder / "in").mkdir()
    meshreel.save(GRID, "in/plain.npz")
    bounds = ["--track", "heat=1K", "--workers", "1"]
    done = run("batch", "in", "out", *bounds, "--json")
    assert done.exit_code == 0, done.output
    assert "has no track heat" in done.output
