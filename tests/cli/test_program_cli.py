"""Start of the program, its imports, shell completion and help."""

import os
import re
import subprocess
import sys

import pytest

import meshreel
from meshreel.app.cli import evaluate, paper
from meshreel.app.cli.commands import COMMANDS, command_named
from samples.commands import run, run_ok
from samples.meshes import waving_grid
from samples.programs import output_of

HEAVY = {"numpy", "scipy", "PIL", "pydantic"}
"""Modules that are slow to import."""


@pytest.fixture
def offered(folder, monkeypatch):
    """Function that returns the completions of a line in bash, except files that bash completes."""

    def offer(line):
        monkeypatch.setenv("COMP_WORDS", line)
        monkeypatch.setenv("COMP_CWORD", str(len(line.split(" ")) - 1))
        monkeypatch.setenv("_MESHREEL_COMPLETE", "bash_complete")
        lines = [line.split(",", 1) for line in run(cwd=folder).stdout.split()]
        return [word for kind, word in lines if kind == "plain"]

    return offer


@pytest.fixture
def folder(tmp_path):
    meshreel.save(waving_grid(), tmp_path / "walk.npz")
    (tmp_path / "walk.reel").write_bytes(meshreel.encode(waving_grid()))
    (tmp_path / "walk.txt").write_text("words")
    (tmp_path / "waves").mkdir()
    return tmp_path


def test_python_m_runs_the_program():
    printed = output_of(sys.executable, "-m", "meshreel", "--version")
    assert printed == f"meshreel {meshreel.__version__}\n"


def imported(*arguments):
    """Return the modules that the program imports."""
    program = (
        "import atexit, sys; from meshreel.app.cli import main; "
        "atexit.register(lambda: print(*sys.modules, file=sys.stderr)); main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    return set(done.stderr.split())


REGISTRY = {
    "meshreel.methods", "meshreel.codec", "meshreel.codec.methods",
    "meshreel.model", "meshreel.model.showing", "meshreel.runtime", "meshreel.runtime.version",
}  # fmt: skip
"""The version, and modules that register methods and the viewer without loading them."""


def test_version_imports_no_heavy_modules():
    modules = imported("--version")
    ours = {name for name in modules if name.startswith("meshreel.")}
    version = {"meshreel.runtime", "meshreel.runtime.version"}
    light = {"meshreel.errors", "meshreel.app", *version, *REGISTRY}
    assert {name for name in ours if not name.startswith("meshreel.app.cli")} == light
    assert not HEAVY & modules


@pytest.mark.slow
@pytest.mark.parametrize("words", [["--help"], *([name, "--help"] for name in COMMANDS)])
def test_help_imports_no_heavy_modules(words):
    modules = imported(*words)
    assert not HEAVY & modules
    of_commands = {name for name in modules if name.removeprefix("meshreel.app.cli.") in COMMANDS}
    assert of_commands == {f"meshreel.app.cli.{name}" for name in words[:-1] or COMMANDS}


@pytest.mark.slow
def test_info_of_other_formats_imports_no_codec(folder):
    modules = imported("info", folder / "walk.npz")
    codec = {name for name in modules if name.startswith("meshreel.codec")}
    light = {*REGISTRY, "meshreel.codec.option"}
    light |= {"meshreel.codec.bitstream", "meshreel.codec.bitstream.layout"}
    light |= {"meshreel.codec.memory"}  # the limit of --memory
    assert codec <= light
    assert not {"scipy", "DracoPy"} & modules


@pytest.mark.slow
def test_info_of_a_stream_imports_no_decoder(folder):
    modules = imported("info", folder / "walk.reel")
    assert not {"scipy", "meshreel.codec.reel.encoding.whole", "meshreel.codec.encoder"} & modules


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_show_completion_prints_a_script(shell):
    done = run_ok("--show-completion", shell)
    assert f"_MESHREEL_COMPLETE={shell}_complete" in done.stdout


def test_completion_offers_all_commands(offered):
    assert offered("meshreel ") == list(COMMANDS)


def test_completion_offers_options(offered):
    assert offered("meshreel encode walk.npz --max") == ["--max-error"]


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("meshreel encode wa", []),  # the shell completes files
        ("meshreel encode walk.npz --method pca-", ["pca-qp", "pca-q", "pca-qs"]),
        ("meshreel render walk.reel --heatmap a", ["angle"]),
    ],
)
def test_completion_offers_names(offered, line, expected):
    assert offered(line) == expected


def test_names_in_help_equal_those_of_the_evaluation():
    from meshreel.codec.methods import METHOD_NAMES
    from meshreel.evaluation.positions import DEFAULT_METHODS, PEERS
    from meshreel.paper import sweeps
    from meshreel.paper.sweeps import PRESETS

    assert evaluate.METHODS.split(", ") == [*METHOD_NAMES]
    assert evaluate.DEFAULT.split(",") == [*DEFAULT_METHODS]
    assert evaluate.PEERS.split(",") == [peer.name for peer in PEERS]
    assert paper.METHODS.split(",") == [*sweeps.METHOD_NAMES]
    [preset] = [param for param in command_named("paper").params if param.name == "preset"]
    assert tuple(PRESETS) == tuple(vars(preset.type)["choices"])


def test_help_is_ascii_when_the_terminal_requires_it():
    done = subprocess.run(
        [sys.executable, "-m", "meshreel", "encode", "--help"],
        capture_output=True,
        timeout=60,
        env={**os.environ, "PYTHONIOENCODING": "ascii", "COLUMNS": "60"},
    )
    text = done.stdout.decode("ascii")
    assert "\n  - meshreel encode sim.vtkhdf --track stress=500Pa" in text
    assert "\n    --track velocity=0.1% --track id=exact" in text


def test_help_shows_common_options_and_help_all_every_one():
    shown, every = run_ok("encode", "--help").stdout, run_ok("encode", "--help-all").stdout
    flags = re.compile(r"^  (?:-\w, )?(--[a-z-]+)", re.MULTILINE)
    common, all_flags = (
        {*flags.findall(text)} - {"--help", "--help-all"} for text in (shown, every)
    )
    assert len(common) <= 16
    assert {"--output", "--quality", "--max-error", "--lossless", "--fps", "--track"} <= common
    assert {*all_flags} == {
        max(param.opts, key=len)
        for param in command_named("encode").params
        if param.name != "inputs"
    } - {"--help-all"}
    assert "The paper's methods" not in shown
    assert "The paper's methods" in every


@pytest.mark.parametrize("command", COMMANDS)
def test_help_shows_examples_and_no_type_of_flags(command):
    shown = run_ok(command, "--help").stdout
    assert f"meshreel {command} " in shown
    assert "--json" in shown or command in ("view", "core")
    assert "bool" not in shown.lower()
