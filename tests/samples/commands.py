"""The program as a user runs it, in a process of its own."""

import json
import re
import subprocess
import sys

PROGRESS_LINE = re.compile(r"^meshreel: .* \((?:\d+:)+\d\d so far\)\n", re.MULTILINE)
"""What slow work says every few seconds, on a machine that is busy any work."""


def run(*arguments, cwd=None):
    """The finished process of `meshreel ARGUMENTS`, without its lines of progress."""
    return finished(
        [sys.executable, "-c", "from meshreel.cli import main; main()", *map(str, arguments)],
        cwd=cwd,
    )


def finished(command, **options):
    """The finished process of a command, without its lines of progress."""
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, **options)
    done.stderr = PROGRESS_LINE.sub("", done.stderr)
    return done


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
