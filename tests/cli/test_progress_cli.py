"""Progress lines of long commands without a terminal."""

import importlib
import io
import re
import time
from contextlib import contextmanager

import pytest

import meshreel
from meshreel.app.cli import console, reports, written
from meshreel.app.cli.app import app
from meshreel.app.cli.commands import COMMANDS
from meshreel.app.cli.console import shown_progress
from samples.figures import coarse_figures
from samples.meshes import waving_grid

PAPER = "paper walk.npz --quick --methods pca-qp --out report"
EVALUATE = "evaluate walk.npz --quick --methods reel --peers none --out e"
LINE = re.compile(r"meshreel: .+ \(\d+:\d\d so far\)")

TIMEOUT_S = 20


@pytest.fixture
def lines_of(tmp_path, monkeypatch, capsys):
    """Function that runs a command and returns its lines on stderr; stages wait for their line."""
    output = io.StringIO()

    @contextmanager
    def patient_progress():
        stages = set()
        with shown_progress(output) as report:

            def report_and_wait(stage, fraction):
                report(stage, fraction)
                deadline = time.monotonic() + TIMEOUT_S
                while stage not in stages and stage not in output.getvalue():
                    assert time.monotonic() < deadline, f"no line of `{stage}` in {TIMEOUT_S} s"
                    time.sleep(0.005)
                stages.add(stage)

            yield report_and_wait

    monkeypatch.setattr(console, "LOG_AFTER_S", 0.001)
    monkeypatch.setattr(console, "LOG_INTERVAL_S", 0.01)
    commands = [importlib.import_module(f"meshreel.app.cli.{name}") for name in COMMANDS]
    for module in (reports, written, *commands):
        monkeypatch.setattr(module, "shown_progress", patient_progress, raising=False)
    monkeypatch.chdir(tmp_path)
    meshreel.save(waving_grid(6, 12, 14), tmp_path / "walk.npz")
    (tmp_path / "walk.reel").write_bytes(meshreel.encode(waving_grid(6, 12, 14)))

    def run(*words):
        capsys.readouterr()
        with coarse_figures():
            app(list(words), prog_name="meshreel", standalone_mode=False)
        return [*output.getvalue().splitlines(), *capsys.readouterr().err.splitlines()]

    return run


@pytest.mark.parametrize(
    ("command", "stages"),
    [
        ("encode walk.npz -o a.reel --kg 0.5", ["encoding, try"]),
        pytest.param(
            PAPER, ["drawing", r"modes, \d+ bits, \w+.*: \d+ of \d+ runs"], marks=pytest.mark.slow
        ),
        pytest.param(EVALUATE, [r"reel .*: \d+ of \d+ runs", ": drawing"], marks=pytest.mark.slow),
        (
            "render walk.reel -o a.gif --size 400x200 --original walk.npz --heatmap distance",
            ["drawing: "],
        ),
        pytest.param(
            "batch . streams --workers 1",
            ["encoding, 1 at a time: 0 of 1 input"],
            marks=pytest.mark.slow,
        ),
        pytest.param("demo --frames 20", ["simulating"], marks=pytest.mark.slow),
    ],
)
def test_command_prints_its_progress(lines_of, command, stages):
    lines = lines_of(*command.split())
    for stage in stages:
        assert any(re.search(stage, line) for line in lines)
    progress = [line for line in lines if "so far" in line]
    assert all(LINE.fullmatch(line) for line in progress)
