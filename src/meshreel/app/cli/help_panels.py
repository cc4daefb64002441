"""Help of commands: usage, description, and a panel for each group of options."""

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import click
from rich.console import Console, Group, RenderableType
from rich.padding import Padding
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

CODE = re.compile(r"`([^`]+)`")
CODE_STYLE, NAME_STYLE, DIM_STYLE = "bold", "bold cyan", "dim"

Row = tuple[Text, Text]
"""Names and their meaning."""


def help_text(command: click.Command, context: click.Context) -> str:
    """The help of a command, with colors if stdout is a terminal."""
    console = Console(highlight=False)
    with console.capture() as captured:
        console.print(*_parts(command, context), sep="\n")
    return captured.get().rstrip()


def _parts(command: click.Command, context: click.Context) -> Iterator[RenderableType]:
    usage = " ".join([context.command_path, *command.collect_usage_pieces(context)])
    yield Padding(Text(f"Usage: {usage}", "bold"), 1)
    yield Padding(Group(*_paragraphs(command.help or "")), (0, 1, 1, 1))
    for title, rows in _panels(command, context).items():
        yield Panel(_table(rows), title=title, title_align="left", border_style=DIM_STYLE)


def _paragraphs(text: str) -> Iterator[RenderableType]:
    """Paragraphs of a docstring and items of its lists, which begin with "- "."""
    was_item = False
    for number, paragraph in enumerate(text.split("\n\n")):
        line = " ".join(paragraph.split())
        is_item = line.startswith("- ")
        if number and not (is_item and was_item):
            yield Text()
        yield _item(line.removeprefix("- ")) if is_item else _with_code(line)
        was_item = is_item


def _item(text: str) -> Table:
    """A list item with a hanging indent."""
    table = Table.grid(padding=(0, 1))
    table.add_row("-", _with_code(text))
    return table


def _panels(command: click.Command, context: click.Context) -> dict[str, list[Row]]:
    """Rows of each panel by its title: arguments, options, groups of options, commands."""
    panels: dict[str, list[Row]] = {"Arguments": [], "Options": []}
    for param in command.get_params(context):
        if isinstance(param, click.Argument):
            row = Text(param.make_metavar(context), NAME_STYLE), _meaning(param)
            panels["Arguments"].append(row)
        elif isinstance(param, click.Option) and not param.hidden:
            title = getattr(param, "panel", "") or "Options"
            panels.setdefault(title, []).append((_names(param, context), _meaning(param)))
    if isinstance(command, click.Group):
        panels["Commands"] = [
            (Text(name, NAME_STYLE), _with_code(_summary(command.get_command(context, name))))
            for name in command.list_commands(context)
        ]
    return {title: rows for title, rows in panels.items() if rows}


def _names(option: click.Option, context: click.Context) -> Text:
    """Names of an option and its metavar: "-o, --output TEXT"."""
    names = ", ".join(sorted(option.opts, key=len))
    text = Text(" / ".join([names, *option.secondary_opts]), NAME_STYLE)
    if not option.is_flag:
        text.append(f" {option.make_metavar(context)}", DIM_STYLE)
    return text


def _meaning(param: Any) -> Text:
    text = _with_code(param.help or "")
    if isinstance(param, click.Option) and (default := default_text(param)):
        text.append(f" [default: {default}]", DIM_STYLE)
    if param.required:
        text.append(" [required]", DIM_STYLE)
    return text


def default_text(option: click.Option) -> str:
    """The default of an option as text; empty if its help states it, or it is a switch."""
    default = option.default
    is_shown = isinstance(default, str | int | float | Path) and not isinstance(default, bool)
    return str(default) if is_shown and option.show_default is not False else ""


def _summary(command: click.Command | None) -> str:
    return " ".join((command.help if command and command.help else "").partition("\n\n")[0].split())


def _with_code(text: str) -> Text:
    """A text with highlighted code between backticks."""
    highlighted = Text()
    for number, piece in enumerate(CODE.split(text)):
        highlighted.append(piece, CODE_STYLE if number % 2 else None)
    return highlighted


def _table(rows: Iterable[Row]) -> Table:
    table = Table.grid(padding=(0, 2))
    table.add_column(overflow="fold")
    table.add_column(ratio=1)
    for row in rows:
        table.add_row(*row)
    return table
