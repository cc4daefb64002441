"""Kill a batch at the n-th change of a file in its output folder, for every n.

    python -m samples.kill_moments INPUTS FOLDER STEP

Each run is a fork of this process, which has no threads yet; it kills itself. Then the batch runs
again undisturbed. Prints one line of JSON per moment: whether the run was killed, and the files
after the second run, with their bytes in hexadecimal.
"""

import json
import os
import signal
import sys
from pathlib import Path

from meshreel.app.batch.encode_input import EncodeOptions
from meshreel.app.batch.manifest import MANIFEST_NAME
from meshreel.app.batch.plan import plan_batch
from meshreel.app.batch.run import run_batch
from meshreel.codec.options import config_of
from samples.engines import InlineExecutor

CHANGES = {"os.rename", "os.mkdir", "os.rmdir", "os.remove", "open"}


def run(inputs, out):
    options = EncodeOptions(config_of(quality=40))
    return run_batch(plan_batch(inputs, out, options), InlineExecutor())


def kill_at(moment, out):
    """Kill this process at the given number of changes in a folder."""
    seen = 0

    def watch(event, args):
        nonlocal seen
        if event in CHANGES and str(args[0]).startswith(str(out)):
            seen += 1
            if seen == moment:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(watch)


def in_fork(work, *args):
    """Run a function in a fork; return whether it was killed."""
    child = os.fork()
    if child == 0:
        work(*args)
        os._exit(0)
    _, status = os.waitpid(child, 0)
    assert os.WIFSIGNALED(status) or os.WEXITSTATUS(status) == 0, status
    return os.WIFSIGNALED(status)


def killed_run(inputs, out, moment):
    kill_at(moment, out)
    run(inputs, out)


def main():
    inputs, folder, step = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
    moment, was_killed = 1, True
    while was_killed:
        out = folder / f"out{moment}"
        was_killed = in_fork(killed_run, inputs, out, moment)
        in_fork(run, inputs, out)
        states = json.loads((out / MANIFEST_NAME).read_text())["inputs"].values()
        files = {
            path.relative_to(out).as_posix(): path.read_bytes().hex()
            for path in out.rglob("*")
            if path.is_file() and path.suffix == ".reel"
        }
        print(json.dumps({
            "killed": was_killed,
            "states": [state["state"] for state in states],
            "streams": files,
            "others": sorted(one.name for one in out.iterdir() if one.suffix != ".reel"),
        }), flush=True)  # fmt: skip
        moment += step


if __name__ == "__main__":
    main()
