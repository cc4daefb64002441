"""Output of commands: progress on stderr; figures on stdout, as tables or JSON.

Control characters in text are escaped.
"""

import json
import shutil
import sys
import threading
import time
import unicodedata
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from itertools import zip_longest
from typing import Any, TextIO

import click

from meshreel.app.cli.messages import escaped, with_options
from meshreel.app.figures import Cell
from meshreel.runtime.counting import singular
from meshreel.runtime.progress import Count, Progress

MIN_ELAPSED_S = 2.0
"""Elapsed time before the remaining time is shown, because early estimates are unstable."""

LOG_AFTER_S, LOG_INTERVAL_S = 5.0, 10.0
SHOW_AFTER_S, REFRESH_S = 1.0, 0.1
"""Time until the first line of progress and between lines, in a log and on a terminal."""

Row = Sequence[Sequence[str]]
"""The lines of each cell."""


class PaceClock:
    """Measures the pace of the current stage.

    Parameters
    ----------
    now_s : callable, optional
        Returns the time in seconds, from any origin.
    """

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._unit_and_total = ("", 0)
        self._began_s, self._n_before, self._n_done = now_s(), 0, 0

    def describe(self, fraction: float) -> str:
        """Text such as "12 of 175 frames, 8.4 frames/s, 0:19 left"; empty if nothing is counted.

        The pace restarts when the unit or total changes, or the count falls.

        Parameters
        ----------
        fraction : float
            A `Count` if items are counted.
        """
        if not isinstance(fraction, Count):
            self._unit_and_total = ("", 0)
            return ""
        unit_and_total = fraction.unit, fraction.total
        if unit_and_total != self._unit_and_total or fraction.done < self._n_done:
            self._began_s, self._n_before = self._now_s(), fraction.done
        self._unit_and_total, self._n_done = unit_and_total, fraction.done
        unit = singular(fraction.unit) if fraction.total == 1 else fraction.unit
        text = f"{fraction.done} of {fraction.total} {unit}"
        elapsed_s, n_since = self._now_s() - self._began_s, fraction.done - self._n_before
        if elapsed_s < MIN_ELAPSED_S or n_since == 0:
            return text
        pace = n_since / elapsed_s
        left_s = (fraction.total - fraction.done) / pace
        return f"{text}, {pace_text(pace, fraction.unit)}, {clock_text(left_s)} left"


def pace_text(per_second: float, unit: str) -> str:
    """Text such as "8.4 frames/s", or "3.1 s each" for items that take more than a second."""
    if per_second < 1:
        return f"{1 / per_second:.3g} s each"
    pace = f"{per_second:.3g}"
    return f"{pace} {singular(unit) if pace == '1' else unit}/s"


def clock_text(seconds: float) -> str:
    """Text such as "0:19", "12:05" and "3:07:00"."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


def print_json(figures: Mapping[str, Any]) -> None:
    """Print figures as JSON on stdout; numbers that are not finite become null.

    Messages contain options instead of keywords.
    """
    print(json.dumps(_plain(figures), indent=2))


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not abs(value) < float("inf"):
        return None
    return with_options(value) if isinstance(value, str) else value


def print_table(title: str, rows: Mapping[str, Cell]) -> None:
    """Print a table of names and values on stdout."""
    _print_titled(title, [(_lines(name), _lines(value)) for name, value in rows.items()])


def print_figures(
    title: str,
    rows: Mapping[str, Cell],
    figures: Mapping[str, Any],
    notes: Iterable[str],
    *,
    as_json: bool,
) -> None:
    """Print notes on stderr; then rows as a table, or figures and notes as JSON."""
    print_notes(notes)
    if as_json:
        print_json({**figures, "notes": list(notes)})
    else:
        print_table(title, rows)


def print_columns(title: str, headings: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table on stdout, with names in the first column and figures in the others."""
    _print_titled(title, [[_lines(cell) for cell in row] for row in rows], headings)


def _print_titled(title: str, rows: Sequence[Row], headings: Sequence[str] = ()) -> None:
    """Print a table under its title; nothing is wrapped, so that paths can be copied."""
    click.echo(click.style(escaped(title), bold=True))
    for line in table_lines(rows, headings):
        click.echo(f"  {line}")


def table_lines(rows: Sequence[Row], headings: Sequence[str] = ()) -> Iterator[str]:
    """Lines of a table; with headings, columns after the first are aligned to the right."""
    table = [*([[[heading] for heading in headings]] if headings else []), *rows]
    widths = [
        max((text_width(line) for cell in column for line in cell), default=0)
        for column in zip(*table, strict=True)
    ]
    for row in table:
        for pieces in zip_longest(*row, fillvalue=""):
            padded = []
            for number, (piece, width) in enumerate(zip(pieces, widths, strict=True)):
                space = " " * (width - text_width(piece))
                padded.append(space + piece if headings and number else piece + space)
            yield "  ".join(padded).rstrip()


def text_width(text: str) -> int:
    """Number of terminal columns that the text occupies."""
    if text.isascii():
        return len(text)
    return sum(
        0 if unicodedata.combining(letter) else 1 + (unicodedata.east_asian_width(letter) in "WF")
        for letter in text
    )


def _lines(cell: Cell) -> list[str]:
    """Return the escaped lines of a cell, with options in place of keywords."""
    return [escaped(with_options(line)) for line in ([cell] if isinstance(cell, str) else cell)]


def print_notes(notes: Iterable[str]) -> None:
    """Print notes on stderr, one line each."""
    for note in dict.fromkeys(map(with_options, notes)):
        click.echo(escaped(f"note: {note}"), err=True)


@contextmanager
def shown_progress(stream: TextIO | None = None) -> Iterator[Progress]:
    """A progress callback whose latest state is written by a thread, even between calls.

    Example: "meshreel: encoding, try 3: 12 of 175 frames, 8.4 frames/s, 0:19 left (0:42 so far)".
    On a terminal the line is replaced ten times a second, and removed at the end; elsewhere a line
    is written every few seconds.

    Parameters
    ----------
    stream : text file, optional
        Default: stderr.
    """
    file = sys.stderr if stream is None else stream
    began_s, clock = time.monotonic(), PaceClock()
    latest: list[tuple[str, float]] = [("working", 0.0)]
    is_over, shown_width = threading.Event(), 0

    def report(stage: str, fraction: float) -> None:
        clock.describe(fraction)  # starts to measure the pace
        latest[0] = stage, fraction

    def replace_line(line: str) -> None:
        nonlocal shown_width
        # A line longer than the terminal could not be removed.
        while text_width(line) >= shutil.get_terminal_size().columns:
            line = line[:-1]
        print(f"\r{line}{' ' * (shown_width - text_width(line))}", end="", file=file, flush=True)
        shown_width = text_width(line)

    def write_regularly(wait_s: float, interval_s: float, write: Callable[[str], None]) -> None:
        while not is_over.wait(wait_s):
            elapsed = clock_text(time.monotonic() - began_s)
            stage, fraction = latest[0]
            text = clock.describe(fraction)
            if not text and 0 < fraction < 1:
                text = f"{100 * fraction:.0f} %"
            state = f"{stage}: {text}" if text else stage
            with suppress(OSError, ValueError):  # the stream may be closed
                write(f"meshreel: {escaped(state)} ({elapsed} so far)")
            wait_s = interval_s

    is_terminal = file.isatty()
    if is_terminal:
        schedule: tuple[Any, ...] = SHOW_AFTER_S, REFRESH_S, replace_line
    else:
        schedule = LOG_AFTER_S, LOG_INTERVAL_S, partial(print, file=file, flush=True)
    writer = threading.Thread(
        target=write_regularly, args=schedule, name="meshreel-progress", daemon=True
    )
    writer.start()
    try:
        yield report
    finally:
        is_over.set()
        writer.join()
        if is_terminal:
            replace_line("")
            print("\r", end="", file=file, flush=True)
