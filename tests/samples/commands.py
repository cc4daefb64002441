"""Runs of the program: arguments, exit code and output."""

import io
import json
import re
import subprocess
from contextlib import ExitStack, chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from unittest.mock import patch

from meshreel.app.cli import main

PROGRESS_LINE = re.compile(r"^meshreel: .* \((?:\d+:)+\d\d so far\)\n", re.MULTILINE)
"""Progress line, printed every few seconds; on a busy machine by any command."""


def run(*arguments, cwd=None):
    """Run `meshreel ARGUMENTS`; return exit code and output without progress lines.

    The program runs in this process, because a new one spends a second on imports; `finished`
    starts one. Errors that the program does not catch are raised.
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
    raise AssertionError("the program returned without sys.exit")


def _text_of(stream):
    stream.flush()
    return stream.buffer.getvalue().decode("utf-8")


def finished(command, **options):
    """Run a command in a new process; return it without its progress lines."""
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, **options)
    done.stderr = PROGRESS_LINE.sub("", done.stderr)
    return done


def run_ok(*arguments, cwd=None):
    """Run `meshreel ARGUMENTS`, which must succeed; return what `run` returns."""
    done = run(*arguments, cwd=cwd)
    assert done.returncode == 0, done.stderr
    return done


def run_json(*arguments, cwd=None):
    return json.loads(run_ok(*arguments, "--json", cwd=cwd).stdout)


def assert_fails(done, *words):
    """Assert that a command failed with a single line on stderr, except progress, with these words.

    The exit code is 1, and 2 for usage errors, whose message refers to the help.
    """
    stderr = PROGRESS_LINE.sub("", done.stderr)
    assert done.returncode == (2 if "--help lists the options)" in stderr else 1)
    assert len(stderr.strip().splitlines()) == 1, stderr
    assert stderr.startswith("meshreel: ")
    for word in words:
        assert word in stderr
