"""The program as a user runs it: its words, its exit code and what it says."""

import io
import json
import re
import subprocess
from contextlib import ExitStack, chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from unittest.mock import patch

from meshreel.app.cli import main

PROGRESS_LINE = re.compile(r"^meshreel: .* \((?:\d+:)+\d\d so far\)\n", re.MULTILINE)
"""What slow work says every few seconds, on a machine that is busy any work."""


def run(*arguments, cwd=None):
    """The exit code and output of `meshreel ARGUMENTS`, without its lines of progress.

    The program runs in this process, for a new one spends a second on imports; `finished` starts
    one. An error that the program lets through is raised here.
    """
    words = ["meshreel", *map(str, arguments)]
    streams = [io.TextIOWrapper(io.BytesIO(), encoding="utf-8") for _ in range(2)]
    with ExitStack() as stack:
        stack.enter_context(chdir(cwd or Path.cwd()))
        stack.enter_context(patch("sys.argv", words))
        stack.enter_context(redirect_stdout(streams[0]))
        stack.enter_context(redirect_stderr(streams[1]))
        code = _exit_code()
    stdout, stderr = map(_text_of, streams)
    return subprocess.CompletedProcess(words, code, stdout, PROGRESS_LINE.sub("", stderr))


def _exit_code():
    try:
        main()
    except SystemExit as end:
        return end.code
    raise AssertionError("the program returned; it ends by sys.exit")


def _text_of(stream):
    stream.flush()
    return stream.buffer.getvalue().decode("utf-8")


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
    """One line on stderr, beside those of progress, that holds the words; exit code 1."""
    assert done.returncode == 1
    stderr = PROGRESS_LINE.sub("", done.stderr)
    assert len(stderr.strip().splitlines()) == 1, stderr
    assert stderr.startswith("meshreel: ")
    for word in words:
        assert word in stderr
