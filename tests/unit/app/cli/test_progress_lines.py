"""Progress lines, with and without a terminal."""

import io
import threading
import time
from types import SimpleNamespace

import pytest

from meshreel.app.cli import console
from meshreel.app.cli.console import shown_progress
from meshreel.runtime.progress import Count


class Lines(io.StringIO):
    """A text file or a terminal that counts its lines."""

    def __init__(self, *, is_terminal=False):
        super().__init__()
        self.has_come = threading.Semaphore(0)
        self.is_terminal = is_terminal

    def isatty(self):
        return self.is_terminal

    def flush(self):
        self.has_come.release()

    def next_line(self):
        assert self.has_come.acquire(timeout=20)
        return self.getvalue().splitlines()[-1]


@pytest.fixture(autouse=True)
def hurry(monkeypatch):
    """Lines come at once, and no time passes: a busy machine takes more than half a second."""
    monkeypatch.setattr(console, "time", SimpleNamespace(monotonic=lambda: 0.0))
    monkeypatch.setenv("COLUMNS", "100")
    for name in ("LOG_AFTER_S", "LOG_INTERVAL_S", "SHOW_AFTER_S", "REFRESH_S"):
        monkeypatch.setattr(console, name, 0.005)


def test_lines_are_repeated_without_calls():
    stream = Lines()
    with shown_progress(stream) as progress:
        progress("encoding, try 3", Count(12, 175, "frames"))
        line = "meshreel: encoding, try 3: 12 of 175 frames (0:00 so far)"
        assert any(stream.next_line() == line for _ in range(1000))
        assert stream.next_line() == line


@pytest.mark.parametrize(
    ("fraction", "words"), [(0.0, "comparing"), (0.5, "comparing: 50 %"), (1.0, "comparing")]
)
def test_line_contains_the_share_between_0_and_1(fraction, words):
    stream = Lines()
    with shown_progress(stream) as progress:
        progress("comparing", fraction)
        line = f"meshreel: {words} (0:00 so far)"
        assert any(stream.next_line() == line for _ in range(1000))


@pytest.mark.parametrize("is_terminal", [False, True])
def test_short_work_writes_no_line_and_ends_without_waiting(is_terminal, monkeypatch):
    for name in ("LOG_AFTER_S", "SHOW_AFTER_S"):
        monkeypatch.setattr(console, name, 60)
    stream, began = Lines(is_terminal=is_terminal), time.monotonic()
    with shown_progress(stream) as progress:
        progress("reading", 0.5)
    assert stream.getvalue().strip("\r") == ""
    assert time.monotonic() - began < 5


def test_closed_stream_does_not_stop_the_work():
    stream = Lines()
    with shown_progress(stream) as progress:
        stream.close()
        progress("reading", 0.5)
        time.sleep(0.05)


def screen_of(text, width):
    """Return what a terminal shows on the line that a text rewrites; it must not break the line."""
    shown = [" "] * width
    for piece in text.split("\r"):
        assert len(piece) < width
        shown[: len(piece)] = piece
    return "".join(shown).rstrip()


def wait_for_line(terminal, line):
    deadline = time.monotonic() + 20
    while screen_of(terminal.getvalue(), 100) != line:
        assert time.monotonic() < deadline, terminal.getvalue()[-200:]
        time.sleep(0.005)


def test_line_on_a_terminal_is_replaced_and_removed():
    terminal = Lines(is_terminal=True)
    with shown_progress(terminal) as progress:
        progress("encoding, try 3", Count(35, 175, "frames"))
        wait_for_line(terminal, "meshreel: encoding, try 3: 35 of 175 frames (0:00 so far)")
        progress("order", 1.0)
        wait_for_line(terminal, "meshreel: order (0:00 so far)")
    assert screen_of(terminal.getvalue(), 100) == ""


def test_line_on_a_terminal_is_cut_to_its_width():
    terminal = Lines(is_terminal=True)
    with shown_progress(terminal) as progress:
        progress("reading " + "歩" * 80, 0.5)
        deadline = time.monotonic() + 20
        while "歩" * 40 not in terminal.getvalue():
            assert time.monotonic() < deadline
            time.sleep(0.005)
    assert "歩" * 41 not in terminal.getvalue()
