"""Progress lines, with and without a terminal."""

import io
import threading
import time
from types import SimpleNamespace

import pytest

from meshreel.app.cli import console
from meshreel.app.cli.console import progress_line, progress_lines
from meshreel.runtime.progress import Count


class Lines(io.StringIO):
    """A text file with an event that is set at a number of lines."""

    def __init__(self):
        super().__init__()
        self.has_come = threading.Semaphore(0)

    def flush(self):
        self.has_come.release()

    def wait_for(self, n_lines):
        for _ in range(n_lines):
            assert self.has_come.acquire(timeout=20)
        return self.getvalue().splitlines()


@pytest.fixture(autouse=True)
def still_clock(monkeypatch):
    """No time passes: a busy machine takes more than the half second after which 0:01 is shown."""
    monkeypatch.setattr(console, "time", SimpleNamespace(monotonic=lambda: 0.0))


def test_lines_are_repeated_without_calls():
    stream = Lines()
    with progress_lines(stream, first_line_s=0.01, interval_s=0.01) as progress:
        progress("encoding, try 3", Count(12, 175, "frames"))
        lines = stream.wait_for(3)
    assert lines[-1] == "meshreel: encoding, try 3: 12 of 175 frames (0:00 so far)"


@pytest.mark.parametrize(
    ("fraction", "words"), [(0.0, "comparing"), (0.5, "comparing: 50 %"), (1.0, "comparing")]
)
def test_line_contains_the_share_between_0_and_1(fraction, words):
    stream = Lines()
    with progress_lines(stream, first_line_s=0.01, interval_s=0.01) as progress:
        progress("comparing", fraction)
        stream.wait_for(2)
        lines = stream.wait_for(1)
    assert lines[-1] == f"meshreel: {words} (0:00 so far)"


def test_short_work_writes_no_line():
    stream = Lines()
    with progress_lines(stream, first_line_s=60) as progress:
        progress("reading", 0.5)
    assert stream.getvalue() == ""


def test_closed_stream_does_not_stop_the_work():
    stream = Lines()
    stream.close()
    with progress_lines(stream, first_line_s=0.001, interval_s=0.001) as progress:
        progress("reading", 0.5)
        time.sleep(0.05)


def test_end_does_not_wait_for_the_next_line():
    began = time.monotonic()
    with progress_lines(Lines(), first_line_s=30, interval_s=30):
        pass
    assert time.monotonic() - began < 5


def screen_of(text, width):
    """Return what a terminal shows on the line that a text rewrites; it must not break the line."""
    shown = [" "] * width
    for piece in text.split("\r"):
        assert len(piece) < width
        shown[: len(piece)] = piece
    return "".join(shown).rstrip()


@pytest.fixture
def terminal(monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setattr(console, "SHOW_AFTER_S", 0.001)
    monkeypatch.setattr(console, "REFRESH_S", 0.001)
    return Lines()


def wait_for_line(terminal, line):
    deadline = time.monotonic() + 20
    while screen_of(terminal.getvalue(), 100) != line:
        assert time.monotonic() < deadline, terminal.getvalue()[-200:]
        time.sleep(0.005)


def test_line_on_a_terminal_is_replaced_and_removed(terminal):
    with progress_line(terminal) as progress:
        progress("encoding, try 3", Count(35, 175, "frames"))
        line = "encoding, try 3  ####                   20%  0:00  35 of 175 frames"
        wait_for_line(terminal, line)
        progress("order", 1.0)
        wait_for_line(terminal, f"order  {'#' * 20}  100%  0:00")
    assert screen_of(terminal.getvalue(), 100) == ""


def test_line_on_a_terminal_is_cut_to_its_width(terminal):
    with progress_line(terminal) as progress:
        progress("reading " + "歩" * 80, 0.5)
        wait_for = "reading " + "歩" * 45
        deadline = time.monotonic() + 20
        while wait_for not in terminal.getvalue():
            assert time.monotonic() < deadline
            time.sleep(0.005)
    assert "歩" * 46 not in terminal.getvalue()


def test_short_work_shows_no_line_on_a_terminal(terminal, monkeypatch):
    monkeypatch.setattr(console, "SHOW_AFTER_S", 60)
    with progress_line(terminal) as progress:
        progress("reading", 0.5)
    assert terminal.getvalue().strip("\r") == ""
