"""Blender in a separate process, isolated from the tests."""

import json
import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np

ADD_ON_FOLDER = Path(__file__).parents[2] / "integrations" / "blender"
ANSWER = "scenario answered: "

PYTHON = os.environ.get("MESHREEL_BPY_PYTHON", sys.executable)
"""Python interpreter with bpy and meshreel: this one, or that of the tested Blender."""


class BlenderError(Exception):
    """A scenario failed or Blender died; the message is its output."""


@cache
def why_not():
    """Return why tests in Blender are skipped; empty if Blender is available."""
    check = [PYTHON, "-c", "import bpy, meshreel"]
    done = subprocess.run(check, capture_output=True, text=True, check=False)
    reason = done.stderr.strip().rpartition("\n")[2]
    return f"no Blender in {PYTHON}: {reason}; pip install '.[verify]'" if done.returncode else ""


def environment():
    """Return environment variables with which Python finds the extension."""
    paths = [str(ADD_ON_FOLDER), os.environ.get("PYTHONPATH", "")]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))}


def run_python(script, *arguments, **variables):
    """Run a script in Blender's Python; return its output."""
    command = [PYTHON, str(script), *map(str, arguments)]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, env={**os.environ, **variables}
    )
    if done.returncode:
        raise BlenderError(done.stdout + done.stderr)
    return done.stdout


class Blender:
    """Runs scenarios of `blender_scenarios`, each on an empty scene with factory settings."""

    def __init__(self):
        self._process = subprocess.Popen(
            [PYTHON, "-X", "faulthandler", str(Path(__file__).with_name("blender_worker.py"))],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=environment(),
        )

    def run(self, name, arguments, result):
        """Run a scenario; return its arrays, passed through a file."""
        print(json.dumps([name, arguments, result], default=str), file=self._process.stdin)
        self._process.stdin.flush()
        printed = []
        for line in self._process.stdout:
            if line.startswith(ANSWER):
                break
            printed.append(line)
        else:
            raise BlenderError("".join(printed))
        failure = json.loads(line.removeprefix(ANSWER))
        if failure:
            raise BlenderError("".join(printed) + failure)
        with np.load(result) as opened:
            return {key: opened[key] for key in opened.files}

    @property
    def is_alive(self):
        return self._process.poll() is None

    def close(self):
        self._process.stdin.close()
        self._process.wait(timeout=60)
        self._process.stdout.close()
