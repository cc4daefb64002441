"""`meshreel batch` with worker processes."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

import meshreel
from samples import commands
from samples.commands import assert_fails
from samples.meshes import waving_grid

PROGRAM = [sys.executable, "-c", "from meshreel.app.cli import main; main()", "batch"]


def run(*arguments, cwd=None):
    """Run `meshreel batch ARGUMENTS`, and return the result."""
    return commands.run("batch", *arguments, cwd=cwd)


@pytest.fixture
def inputs(tmp_path):
    folder = tmp_path / "in"
    (folder / "a").mkdir(parents=True)
    meshreel.save(waving_grid(), folder / "walk.npz")
    meshreel.save(waving_grid(4), f"{folder}/a/f_%03d.obj")
    return folder


@pytest.fixture
def out(tmp_path):
    return tmp_path / "out"


def states(out):
    records = json.loads((out / "manifest.json").read_text())["inputs"]
    return {name: record["state"] for name, record in records.items()}


@pytest.mark.slow
def test_batch_writes_streams_and_prints_a_summary(inputs, out):
    done = run(inputs, out, "--quality", 60, "--order", "drop", "--workers", 2)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "0 up to date, 2 encoded, 0 failed"
    assert "walk.npz" in done.stdout
    expected = meshreel.encode(meshreel.load(inputs / "walk.npz"), quality=60, order="drop")
    assert (out / "walk.reel").read_bytes() == expected
    assert sorted(path.name for path in out.iterdir()) == [
        "a.reel", "manifest.json", "walk.reel",
    ]  # fmt: skip


@pytest.mark.slow
def test_batch_exits_with_1_and_one_line_per_failure(inputs, out):
    (inputs / "bad.npz").write_bytes(b"no archive")
    done = run(inputs, out, "--workers", 1, "--fps", 25)
    assert done.returncode == 1
    assert done.stderr.startswith("meshreel: bad.npz: is not a numpy archive")
    assert len(done.stderr.splitlines()) == 1
    assert done.stdout.splitlines()[-1] == "0 up to date, 2 encoded, 1 failed"
    assert states(out) == {"bad.npz": "failed", "walk.npz": "done", "a": "done"}


@pytest.mark.slow
def test_batch_prints_only_the_summary_when_all_is_up_to_date_or_all_inputs_as_json(inputs, out):
    assert run(inputs, out).returncode == 0
    done = run(inputs, out)
    assert (done.returncode, done.stdout) == (0, "2 up to date, 0 encoded, 0 failed\n")
    (inputs / "bad.npz").write_bytes(b"no archive")
    done = run(inputs, out, "--json")
    printed = json.loads(done.stdout)
    assert (printed["up_to_date"], printed["encoded"], printed["failed"]) == (2, 0, 1)
    assert printed["manifest"] == str(out / "manifest.json")
    assert printed["inputs"]["bad.npz"]["outcome"] == "failed"
    size = (out / "walk.reel").stat().st_size
    assert printed["inputs"]["walk.npz"]["size_bytes"] == size


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--workers", 0], "--workers"),
        (["--workers", 2, "--scheduler", "tcp://127.0.0.1:9"], "cannot be combined"),
        (["--quality", 50, "--kg", 1], "give one"),
        (["--quality", 500], "quality"),
    ],
)
def test_batch_rejects_invalid_options_before_writing(inputs, out, options, words):
    done = run(inputs, out, *options)
    assert_fails(done, words)
    assert not out.exists()


def test_batch_rejects_an_address_as_output_folder(inputs):
    done = run(inputs, "s3://bucket/streams")
    assert_fails(done, "s3://bucket/streams: the output folder must be on this machine")


def test_batch_names_the_extra_when_dask_is_missing(inputs, out, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    done = run(inputs, out, "--scheduler", "tcp://127.0.0.1:9")
    assert_fails(done, "pip install 'meshreel[dask]'")


def wait_for(condition):
    """Return the first true value of the condition within a minute."""
    for _ in range(6000):
        if value := condition():
            return value
        time.sleep(0.01)
    raise AssertionError("the condition did not hold within a minute")


def has_finished_stream(out):
    return (out / "manifest.json").exists() and "done" in states(out).values()


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "killpg"), reason="ctrl-C goes to a group of processes")
def test_ctrl_c_leaves_complete_files_and_no_process(inputs, out):
    flag = meshreel.simulate_flag(100)
    for number in range(4):  # each takes seconds, unlike the first two
        meshreel.save(flag, inputs / f"z{number}.npz")
    process = subprocess.Popen(
        [*PROGRAM, inputs, out, "--workers", "2", "--kg", "0.1", "--effort", "9"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    wait_for(lambda: has_finished_stream(out))
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "stopped" in errors
    assert "Traceback" not in errors
    wait_for(lambda: group_is_gone(process.pid))

    final_states = states(out)
    assert set(final_states.values()) == {"done", "pending"}
    done = {name for name, state in final_states.items() if state == "done"}
    files = {path.name for path in out.iterdir()}
    assert files == {"manifest.json"} | {f"{name.split('.')[0]}.reel" for name in done}
    for name in done:
        meshreel.load(out / f"{name.split('.')[0]}.reel")


def group_is_gone(group):
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return True
    return False
