"""When the driver of a batch is killed, its workers end, and another run completes it."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import meshreel
from samples.meshes import waving_grid
from samples.programs import output_of
from samples.waiting import wait_until

TESTS = Path(__file__).parents[3]


def python_path():
    return {**os.environ, "PYTHONPATH": os.pathsep.join([*sys.path, str(TESTS)])}


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="the driver is a fork, for many moments")
def test_rerun_completes_a_batch_killed_at_any_moment(tmp_path):
    inputs = tmp_path / "in"
    inputs.mkdir()
    sequences = {"a": waving_grid(3), "b": waving_grid(2)}
    for name, sequence in sequences.items():
        meshreel.save(sequence, inputs / f"{name}.npz")
    command = [sys.executable, "-m", "samples.kill_moments", inputs, tmp_path, "7"]
    printed = output_of(*command, timeout_s=140, environment=python_path())
    seen = [json.loads(line) for line in printed.splitlines()]
    assert [one["killed"] for one in seen] == [True] * (len(seen) - 1) + [False]
    assert len(seen) > 4
    expected = {
        f"{name}.reel": meshreel.encode(meshreel.load(inputs / f"{name}.npz"), quality=40).hex()
        for name in sequences
    }
    for one in seen:
        assert one["states"] == ["done", "done"]
        assert one["streams"] == expected
        assert one["others"] == ["manifest.json"]


WORKING = """
import os, sys, time
from meshreel.runtime.workers.executors import ProcessExecutor
from samples.tasks import slow_square, process_id
if __name__ == "__main__":
    executor = ProcessExecutor(1)
    print(executor.submit(process_id).result(), flush=True)
    executor.submit(slow_square, 1, 600)
    time.sleep(600)
"""


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc").is_dir(), reason="processes are looked for in /proc")
def test_worker_ends_during_a_call_when_the_driver_is_killed(tmp_path):
    program = tmp_path / "working.py"
    program.write_text(WORKING)
    with subprocess.Popen(
        [sys.executable, program], stdout=subprocess.PIPE, text=True, env=python_path()
    ) as driver:
        worker = int(driver.stdout.readline())
        assert is_running(worker)
        driver.kill()
        driver.wait()
        wait_until(lambda: not is_running(worker), "the worker to end")


def is_running(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
