"""The README: its examples run as they stand, in order, after `meshreel demo`."""

import os
import re
import shlex
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest
import typer.main

from meshreel.batch.discovery import WHOLE_SEQUENCES
from meshreel.cli.app import app
from meshreel.cli.batch import FRAMES, WHOLE
from meshreel.formats.registry import FRAME_FORMATS
from meshreel.viewer.page import PAGE

README = Path(__file__).parents[2] / "README.md"
TEXT = README.read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)
OF_OTHERS = "# with "
"""How a block begins that needs a file or a program that is not here, and says which."""

INSTALLS = re.compile(r"^pip install [^&]*(&&)?")
COMMANDS = typer.main.get_command(app).commands


def lines_of(block):
    """The command lines of a block without what installs things, or runs these tests."""
    lines = [INSTALLS.sub("", line).strip() for line in block.splitlines()]
    return [line for line in lines if line and not line.startswith(("#", "pytest"))]


def every_command():
    """Command lines of all shell blocks, and those within sentences, as words."""
    whole = [line for kind, block in BLOCKS if kind != "python" for line in lines_of(block)]
    joined = re.sub(r"```.*?```", "", TEXT, flags=re.DOTALL)
    inline = re.findall(r"`(meshreel [^`]+)`", joined)
    for line in [*whole, *inline]:
        for command in shlex.split(line, comments=True) and line.split("&&"):
            words = shlex.split(command, comments=True)
            if words and words[0] == "meshreel":
                yield words[1:]


@pytest.fixture
def shell(tmp_path):
    """A folder, and an environment in which `meshreel` is this program."""
    program = tmp_path / "bin" / "meshreel"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m meshreel "$@"\n')
    program.chmod(0o755)
    work = tmp_path / "work"
    work.mkdir()
    return work, {**os.environ, "PATH": f"{program.parent}{os.pathsep}{os.environ['PATH']}"}


def run_line(line, work, environment):
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", line],
        cwd=work,
        env=environment,
        capture_output=True,
        text=True,
        timeout=900,
    )
    assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"


def look_at(line, work, environment):
    """Start a player, wait until it says where it plays, and stop it as ctrl-C does."""
    words = [*shlex.split(line, comments=True), "--no-open"]
    process = subprocess.Popen(
        words, cwd=work, env=environment, stdout=subprocess.PIPE, text=True, bufsize=1
    )
    try:
        [address] = re.findall(r"plays at (http://\S+)", process.stdout.readline())
        with urllib.request.urlopen(address, timeout=60) as page:
            assert page.status == 200
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=60) == 0
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


@pytest.mark.slow
def test_examples_run_when_they_are_pasted_in_order(shell):
    work, environment = shell
    if not PAGE.is_file():
        pytest.skip("the page of the player is not built")
    n_run = 0
    for kind, block in BLOCKS:
        if block.startswith(OF_OTHERS):
            continue
        if kind == "python":
            subprocess.run([sys.executable, "-c", block], cwd=work, check=True, timeout=600)
            n_run += 1
            continue
        for line in lines_of(block):
            run = look_at if line.startswith("meshreel view") else run_line
            run(line, work, environment)
            n_run += 1
    assert n_run > 25


def test_options_exist_when_a_command_names_them():
    found = list(every_command())
    assert len(found) > 40
    for name, *words in found:
        assert name.startswith("--") or name in COMMANDS, name
        if name not in COMMANDS:
            continue
        options = {one for param in COMMANDS[name].params for one in param.opts} | {"--help"}
        given = {word.partition("=")[0] for word in words if re.match(r"--?[a-z]", word)}
        assert given <= options, (name, given - options)


def test_blocks_of_other_programs_say_which_when_they_are_not_run():
    others = [block for _, block in BLOCKS if block.startswith("#")]
    assert others
    for block in others:
        assert re.match(r"# with [a-z ]*(Blender|Houdini|Maya|Dask)", block)


@pytest.mark.parametrize("told", [WHOLE, FRAMES])
def test_readme_and_help_tell_what_batch_takes(told):
    expected = WHOLE_SEQUENCES if told is WHOLE else FRAME_FORMATS
    assert set(told.split()) == set(expected)
    assert told in " ".join(TEXT.split())
