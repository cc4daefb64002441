"""How the program is started, completed by the shell, and explains its options."""

import os
import subprocess
import sys

import pytest

import meshreel
from meshreel.app.cli import evaluate, paper
from meshreel.app.cli.commands import COMMANDS
from samples.commands import run
from samples.meshes import waving_grid

HEAVY = {"numpy", "scipy", "PIL", "rich.markdown", "pydantic"}
"""Modules that take longer to import than the program takes to answer without them."""


@pytest.fixture
def offered(folder, monkeypatch):
    """What bash offers for the last word of a line in a folder, beside files it finds itself."""

    def offer(line):
        monkeypatch.setenv("COMP_WORDS", line)
        monkeypatch.setenv("COMP_CWORD", str(len(line.split(" ")) - 1))
        monkeypatch.setenv("_MESHREEL_COMPLETE", "bash_complete")
        lines = [found.split(",", 1) for found in run(cwd=folder).stdout.split()]
        return [word for kind, word in lines if kind == "plain"]

    return offer


@pytest.fixture
def folder(tmp_path):
    meshreel.save(waving_grid(), tmp_path / "walk.npz")
    (tmp_path / "walk.reel").write_bytes(meshreel.encode(waving_grid()))
    (tmp_path / "walk.txt").write_text("words")
    (tmp_path / "waves").mkdir()
    return tmp_path


def test_module_runs_the_program_when_python_is_told_to_run_it():
    done = subprocess.run(
        [sys.executable, "-m", "meshreel", "--version"], capture_output=True, text=True, timeout=60
    )
    assert done.stdout == f"meshreel {meshreel.__version__}\n"


def imported(*arguments):
    """The modules that the program has when it ends."""
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


REGISTRY = {"meshreel.methods", "meshreel.codec", "meshreel.codec.methods"}
"""Modules that register methods of coding, and load none of them."""


def test_program_imports_nothing_to_compute_with_when_its_version_is_asked_for():
    found = imported("--version")
    ours = {name for name in found if name.startswith("meshreel.")}
    light = {"meshreel.errors", "meshreel.app", *REGISTRY}
    assert {name for name in ours if not name.startswith("meshreel.app.cli")} == light
    assert not {*HEAVY, "rich"} & found


@pytest.mark.parametrize("words", [["--help"], *([name, "--help"] for name in COMMANDS)])
def test_program_imports_no_arrays_when_it_shows_help(words):
    found = imported(*words)
    assert not HEAVY & found
    of_commands = {name for name in found if name.removeprefix("meshreel.app.cli.") in COMMANDS}
    assert of_commands == {f"meshreel.app.cli.{name}" for name in words[:-1] or COMMANDS}


@pytest.mark.slow
def test_program_imports_no_codec_when_it_describes_a_file_that_is_no_stream(folder):
    found = imported("info", folder / "walk.npz")
    codec = {name for name in found if name.startswith("meshreel.codec")}
    light = {*REGISTRY, "meshreel.codec.option"}
    light |= {"meshreel.codec.bitstream", "meshreel.codec.bitstream.layout"}
    light |= {"meshreel.codec.memory"}  # the limit that is an option
    assert codec <= light
    assert not {"scipy", "DracoPy"} & found


def test_program_imports_nothing_to_decode_frames_with_when_it_describes_a_stream(folder):
    found = imported("info", folder / "walk.reel")
    assert not {"scipy", "meshreel.codec.reel.encoding.whole", "meshreel.codec.encoder"} & found


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_script_completes_the_program_when_asked_for(shell):
    done = run("--show-completion", shell)
    assert done.returncode == 0
    assert f"_MESHREEL_COMPLETE={shell}_complete" in done.stdout


def test_completion_offers_every_command_when_none_is_typed(offered):
    assert offered("meshreel ") == list(COMMANDS)


def test_completion_offers_options_when_one_is_begun(offered):
    assert offered("meshreel encode walk.npz --max") == ["--max-error"]


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("meshreel encode wa", ["walk.npz", "walk.reel", "waves/"]),
        ("meshreel decode wa", ["walk.reel", "waves/"]),
        ("meshreel info wal", ["walk.npz", "walk.reel"]),
        ("meshreel encode waves", []),  # the shell's own: a slash and no space
        ("meshreel decode walk.reel -o out.usd", ["out.usd", "out.usda", "out.usdc", "out.usdz"]),
        ("meshreel export walk.reel -o page.", ["page.html"]),
        ("meshreel render walk.reel -o film.m", ["film.mp4"]),
        ("meshreel encode walk.npz --method pca-", ["pca-qp", "pca-q", "pca-qs"]),
        ("meshreel render walk.reel --heatmap a", ["angle"]),
    ],
)
def test_completion_offers_files_endings_and_names_when_they_are_begun(offered, line, expected):
    assert offered(line) == expected


def test_names_in_help_are_those_of_the_evaluation():
    from meshreel.evaluation.codecs.peers.registry import PEER_NAMES
    from meshreel.evaluation.codecs.settings import CODED_METHODS, DEFAULT_METHODS
    from meshreel.evaluation.tracks.peers import TRACK_PEER_NAMES
    from meshreel.paper.sweeps import METHOD_NAMES, PRESETS

    assert evaluate.METHODS.split(", ") == [*CODED_METHODS]
    assert evaluate.DEFAULT.split(",") == [*DEFAULT_METHODS]
    assert evaluate.PEERS.split(",") == [*PEER_NAMES]
    assert evaluate.TRACK_PEERS.split(",") == [*TRACK_PEER_NAMES]
    assert paper.METHODS.split(",") == [*METHOD_NAMES]
    assert tuple(PRESETS) == paper.PRESET_NAMES


def test_help_is_plain_text_when_the_terminal_shows_ascii_only():
    done = subprocess.run(
        [sys.executable, "-m", "meshreel", "encode", "--help"],
        capture_output=True,
        timeout=60,
        env={**os.environ, "PYTHONIOENCODING": "ascii", "COLUMNS": "60"},
    )
    shown = done.stdout.decode("ascii")
    assert "\n - meshreel encode sim.vtkhdf --track stress=500Pa --track" in shown
    assert "\n   velocity=0.1% --track id=exact" in shown


@pytest.mark.parametrize("command", COMMANDS)
def test_help_names_no_type_of_flags_when_it_is_shown(command):
    shown = run(command, "--help").stdout
    assert "--json" in shown or command in ("view", "core")
    assert "bool" not in shown.lower()
