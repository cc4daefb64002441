"""How the program is started, completed by the shell, and explains its options."""

import subprocess
import sys

import pytest

import meshreel
from meshreel.cli.commands import COMMANDS
from samples.commands import run
from samples.meshes import waving_grid


@pytest.fixture
def offered(folder, monkeypatch):
    """What bash offers for the last word of a line in a folder."""

    def offer(line):
        monkeypatch.setenv("COMP_WORDS", line)
        monkeypatch.setenv("COMP_CWORD", str(len(line.split(" ")) - 1))
        monkeypatch.setenv("_MESHREEL_COMPLETE", "complete_bash")
        return run(cwd=folder).stdout.split()

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
        "import atexit, sys; from meshreel.cli import main; "
        "atexit.register(lambda: print(*sys.modules, file=sys.stderr)); main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    return {name for name in done.stderr.split() if not name.startswith("meshreel.cli")}


def test_program_imports_nothing_to_compute_with_when_its_version_is_asked_for():
    found = imported("--version")
    assert {name for name in found if name.startswith("meshreel.")} == {"meshreel.errors"}
    assert "numpy" not in found


@pytest.mark.slow
def test_program_imports_no_codec_when_it_describes_a_file_that_is_no_stream(folder):
    found = imported("info", folder / "walk.npz")
    assert not {name for name in found if name.startswith(("meshreel.codec", "meshreel.reel"))}
    assert not {"scipy", "DracoPy"} & found


def test_program_imports_nothing_to_decode_frames_with_when_it_describes_a_stream(folder):
    found = imported("info", folder / "walk.reel")
    assert not {"scipy", "meshreel.reel.decoder", "meshreel.codec.encoder"} & found


def test_completion_script_completes_the_program_when_asked_for():
    done = run("--show-completion", "bash")
    assert done.returncode == 0
    assert "complete -o default -F _meshreel_completion meshreel" in done.stdout


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


@pytest.mark.parametrize("command", COMMANDS)
def test_help_names_no_type_of_flags_when_it_is_shown(command):
    shown = run(command, "--help").stdout
    assert "--json" in shown or command in ("view", "core")
    assert "bool" not in shown.lower()
