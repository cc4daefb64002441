"""Output of commands: progress on stderr; figures on stdout, as tables or JSON.

Control characters in text are escaped, and rich markup is not interpreted.
"""

import json
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import Any, TextIO

from rich.console import Console
from rich.progress import (
    BarColumn,
    SpinnerColumn,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
)
from rich.progress import Progress as Bar
from rich.table import Table
from rich.text import Text

from meshreel.app.cli.messages import all_with_option_names, escaped, with_option_names
from meshreel.runtime.counting import singular
from meshreel.runtime.progress import Count, Progress

MIN_ELAPSED_S = 2.0
"""Elapsed time before the remaining time is shown, because early estimates are unstable."""

SHOW_AFTER_S = 1.0

MIN_BAR, MAX_BAR = 8, 40
"""Limits of the width of the longest bar in columns; narrow terminals show no bars."""

_BORDERS_AND_SHARE = "│  │  │ 100.0 % │  │"

_EIGHTHS = " ▏▎▍▌▋▊▉█"

Cell = str | list[str]
"""Text of a table cell, or its lines."""

FIRST_LINE_S, LINE_INTERVAL_S = 5.0, 10.0
"""Time until the first progress line, and between lines."""


class PaceClock:
    """Measures the pace of the current stage.

    Parameters
    ----------
    now_s : callable, optional
        Returns the time in seconds, from any origin.
    """

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._counted = ("", 0)
        self._began_s, self._n_at_first, self._n_last = now_s(), 0, 0

    def words(self, fraction: float) -> str:
        """Text such as "12 of 175 frames, 8.4 frames/s, 0:19 left"; empty if nothing is counted.

        The pace restarts when the unit or total changes, or the count falls.

        Parameters
        ----------
        fraction : float
            A `Count` if items are counted.
        """
        if not isinstance(fraction, Count):
            self._counted = ("", 0)
            return ""
        counted = fraction.unit, fraction.total
        if counted != self._counted or fraction.done < self._n_last:
            self._began_s, self._n_at_first = self._now_s(), fraction.done
        self._counted, self._n_last = counted, fraction.done
        unit = singular(fraction.unit) if fraction.total == 1 else fraction.unit
        text = f"{fraction.done} of {fraction.total} {unit}"
        elapsed_s, n_since = self._now_s() - self._began_s, fraction.done - self._n_at_first
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


@contextmanager
def progress_bar() -> Iterator[Progress]:
    """A progress callback that reports on stderr.

    On a terminal, a bar appears after a second with the stage, the elapsed time and, for counted
    items, their number, rate and remaining time. Otherwise see `progress_lines`.
    """
    console = Console(stderr=True)
    with _bar(console) if console.is_terminal else progress_lines() as report:
        yield report


@contextmanager
def _bar(console: Console) -> Iterator[Progress]:
    bar = Bar(
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[words]}", style="progress.remaining"),
        console=console,
        transient=True,
    )
    # Each stage reaches 1, but rich stops its clock when the total is reached.
    task = bar.add_task("", total=1 + 1e-9, words="")
    clock = PaceClock()
    timer = threading.Timer(SHOW_AFTER_S, bar.start)
    timer.daemon = True
    timer.start()

    def report(stage: str, fraction: float) -> None:
        words = clock.words(fraction)
        bar.update(task, description=escaped(stage), completed=float(fraction), words=words)

    try:
        yield report
    finally:
        timer.cancel()
        timer.join()
        bar.stop()


def print_json(figures: Mapping[str, Any]) -> None:
    """Print figures as JSON on stdout; numbers that are not finite become null.

    Messages in "notes" and "error" contain option names instead of keywords.
    """
    print(json.dumps(_plain(figures), indent=2))


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {
            str(key): _message(item) if key in ("notes", "error") else _plain(item)
            for key, item in value.items()
        }
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not abs(value) < float("inf"):
        return None
    return value


def _message(value: Any) -> Any:
    if isinstance(value, str):
        return with_option_names(value)
    return all_with_option_names(value) if isinstance(value, list) else _plain(value)


def print_table(title: str, rows: Mapping[str, str] | Mapping[str, Cell]) -> None:
    """Print a table of names and values on stdout."""
    table = Table(show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(justify="right")
    for name, value in rows.items():
        table.add_row(_text(name), _text(value))
    _print_titled(Console(), title, table)


def print_columns(title: str, headings: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table on stdout, with names in the first column and figures in the others."""
    table = Table()
    for number, heading in enumerate(headings):
        table.add_column(heading, justify="right" if number else "left", overflow="fold")
    for row in rows:
        table.add_row(*map(_text, row))
    _print_titled(Console(), title, table)


def print_bars(title: str, sizes: Mapping[str, int]) -> None:
    """Print sizes in bytes on stdout with shares and bars that fit the terminal."""
    console = Console()
    total = sum(sizes.values()) or 1
    table = Table(show_header=False)
    table.add_column(overflow="fold")
    names = max(_text(name).cell_len for name in sizes)
    texts = [f"{size} B" for size in sizes.values()]
    for min_width in (max(map(len, texts)), len("100.0 %")):
        table.add_column(justify="right", no_wrap=True, min_width=min_width)
    width = console.width - names - max(map(len, texts)) - len(_BORDERS_AND_SHARE)
    if width >= MIN_BAR:
        table.add_column(no_wrap=True)
    for (name, size), text in zip(sizes.items(), texts, strict=True):
        share = size / max(sizes.values())
        bar = text_bar(share, min(width, MAX_BAR), ascii_only=console.options.ascii_only)
        cells: list[Text | str] = [_text(name), text, f"{100 * size / total:.1f} %", bar]
        table.add_row(*cells[: len(table.columns)])
    _print_titled(console, title, table)


def _print_titled(console: Console, title: str, table: Table) -> None:
    """Print a table under its title, which is not wrapped so that paths can be copied."""
    console.print(_text(title), style="bold", soft_wrap=True)
    console.print(table)


def _text(cell: Cell) -> Text:
    """Return escaped text for rich, without markup and emoji codes."""
    return Text("\n".join(map(escaped, [cell] if isinstance(cell, str) else cell)))


def text_bar(share: float, width: int, *, ascii_only: bool = False) -> str:
    """A bar over a share of a width in columns, in eighths of a column unless `ascii_only`.

    Shares above 0 are always visible.
    """
    if ascii_only:
        return "#" * max(round(share * width), 1 if share > 0 else 0)
    eighths = max(round(8 * share * width), 1 if share > 0 else 0)
    whole, rest = divmod(eighths, 8)
    return _EIGHTHS[8] * whole + (_EIGHTHS[rest] if rest else "")


def print_notes(notes: list[str]) -> None:
    """Print notes on stderr, one line each."""
    console = Console(stderr=True)
    for note in all_with_option_names(notes):
        console.print(_text(f"note: {note}"), soft_wrap=not console.is_terminal)


@contextmanager
def progress_lines(
    stream: TextIO | None = None,
    *,
    first_line_s: float = FIRST_LINE_S,
    interval_s: float = LINE_INTERVAL_S,
) -> Iterator[Progress]:
    """A progress callback that writes a plain line every few seconds, even between calls.

    Example: "meshreel: encoding, try 3: 12 of 175 frames, 8.4 frames/s, 0:19 left (0:42 so far)".

    Parameters
    ----------
    stream : text file, optional
        Default: stderr.
    first_line_s, interval_s : float
        Time until the first line, and between lines.
    """
    began_s, clock = time.monotonic(), PaceClock()
    latest: list[tuple[str, float]] = [("working", 0.0)]
    is_over = threading.Event()

    def report(stage: str, fraction: float) -> None:
        clock.words(fraction)  # starts to measure the pace
        latest[0] = stage, fraction

    def write() -> None:
        wait_s = first_line_s
        while not is_over.wait(wait_s):
            elapsed = clock_text(time.monotonic() - began_s)
            with suppress(OSError, ValueError):  # the stream may be closed
                line = f"meshreel: {escaped(_state(*latest[0], clock))} ({elapsed} so far)"
                print(line, file=stream or sys.stderr, flush=True)
            wait_s = interval_s

    writer = threading.Thread(target=write, name="meshreel-progress", daemon=True)
    writer.start()
    try:
        yield report
    finally:
        is_over.set()
        writer.join()


def _state(stage: str, fraction: float, clock: PaceClock) -> str:
    """The stage, and its progress if known."""
    words = clock.words(fraction)
    if not words and 0 < fraction < 1:
        words = f"{100 * fraction:.0f} %"
    return f"{stage}: {words}" if words else stage
