"""What the commands show: progress to stderr, figures as tables or JSON to stdout."""

import json
import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    SpinnerColumn,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
)
from rich.progress import Progress as Bar
from rich.table import Table

from meshreel.progress import Progress

SHOW_AFTER_S = 1.0


@contextmanager
def progress_bar() -> Iterator[Progress]:
    """A listener that draws a bar on stderr once the work has taken a second.

    Draws nothing where stderr is not a terminal.
    """
    console = Console(stderr=True)
    bar = Bar(
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )
    task = bar.add_task("", total=1.0)
    timer = threading.Timer(SHOW_AFTER_S, bar.start)
    timer.daemon = True
    timer.start()

    def report(stage: str, fraction: float) -> None:
        bar.update(task, description=stage, completed=fraction)

    try:
        yield report
    finally:
        timer.cancel()
        timer.join()
        bar.stop()


def print_json(figures: Mapping[str, Any]) -> None:
    """The figures as JSON on stdout; numbers that are not finite become null."""
    print(json.dumps(_plain(figures), indent=2))


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not abs(value) < float("inf"):
        return None
    return value


def print_table(title: str, rows: Mapping[str, str]) -> None:
    """Two columns on stdout: what, and how much."""
    table = Table(title=title, show_header=False, title_justify="left", title_style="bold")
    table.add_column(no_wrap=True)
    table.add_column(justify="right")
    for name, value in rows.items():
        table.add_row(name, escape(value))
    Console().print(table)


def print_columns(title: str, headings: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """A table on stdout whose first column holds names and the others figures."""
    table = Table(title=title, title_justify="left", title_style="bold")
    for number, heading in enumerate(headings):
        table.add_column(heading, justify="right" if number else "left", overflow="fold")
    for row in rows:
        table.add_row(*map(escape, row))
    Console().print(table)


def print_notes(notes: list[str]) -> None:
    """What was done to the input, a line each, on stderr."""
    console = Console(stderr=True, highlight=False)
    for note in notes:
        console.print(f"note: {note}", markup=False)


def size_text(size_bytes: float) -> str:
    """A size that a person can read: 1234567 gives '1.23 MB'."""
    for unit in ("B", "kB", "MB"):
        if size_bytes < 999.5:
            return f"{size_bytes:.3g} {unit}"
        size_bytes /= 1000
    return f"{size_bytes:.3g} GB"
