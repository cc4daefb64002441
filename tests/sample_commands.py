"""The program as a user runs it, in a process of its own."""

import json
import subprocess
import sys


def run(*arguments, cwd=None):
    """The finished process of `meshreel ARGUMENTS`."""
    return subprocess.run(
        [sys.executable, "-c", "from meshreel.cli import main; main()", *map(str, arguments)],
        capture_output=True,
        text=True,
        cwd=cwd,
        timeout=120,
    )


def run_json(*arguments, cwd=None):
    done = run(*arguments, "--json", cwd=cwd)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def assert_fails(done, *words):
    """One line on stderr that holds the words, exit code 1, no traceback."""
    assert done.returncode == 1
    assert len(done.stderr.strip().splitlines()) == 1
    assert done.stderr.startswith("meshreel: ")
    for word in words:
        assert word in done.stderr
