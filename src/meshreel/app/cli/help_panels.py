"""Help of commands: usage, description, and a panel for each group of options."""

import re
from pathlib import Path

import click

HELP_ALL = "--help-all"

CODE = re.compile(r"`([^`]+)`")
"""An item of a list that is a command, between backticks."""

Row = tuple[str, str]
"""Names and their meaning."""


def write_help(
    command: click.Command, context: click.Context, formatter: click.HelpFormatter
) -> None:
    """Write the help of a command."""
    formatter.write_usage(context.command_path, " ".join(command.collect_usage_pieces(context)))
    _write_description(command.help or "", formatter)
    for title, rows in _panels(command, context).items():
        with formatter.section(_bold(title)):
            formatter.write_dl([(_bold(names), meaning) for names, meaning in rows])


def _write_description(text: str, formatter: click.HelpFormatter) -> None:
    """Write the paragraphs of a docstring, and the items of its lists, which begin with "- "."""
    for paragraph in text.split("\n\n"):
        formatter.write_paragraph()
        is_list = paragraph.startswith("- ")
        for item in paragraph.split("\n- ") if is_list else [paragraph]:
            line = " ".join(item.removeprefix("- ").split())
            if is_list:
                line = "- " + CODE.sub(r"\1", line)
            following = "    " if is_list else "  "
            formatter.write(click.wrap_text(line, formatter.width, "  ", following) + "\n")


def _panels(command: click.Command, context: click.Context) -> dict[str, list[Row]]:
    """Rows of each panel by its title: arguments, options, groups of options, commands."""
    panels: dict[str, list[Row]] = {"Arguments": [], "Options": []}
    offers_all = HELP_ALL not in context.meta and any(
        HELP_ALL in param.opts for param in command.params
    )
    for param in command.get_params(context):
        if isinstance(param, click.Argument):
            row = param.make_metavar(context), _meaning(param, getattr(param, "help", ""))
            panels["Arguments"].append(row)
        elif isinstance(param, click.Option) and not param.hidden:
            if offers_all and getattr(param, "is_rare", False):
                continue
            title = getattr(param, "panel", "") or "Options"
            row = _names(param, context), _meaning(param, param.help)
            panels.setdefault(title, []).append(row)
    if isinstance(command, click.Group):
        panels["Commands"] = [
            (name, _summary(command.get_command(context, name)))
            for name in command.list_commands(context)
        ]
    return {title: rows for title, rows in panels.items() if rows}


def _names(option: click.Option, context: click.Context) -> str:
    """Names of an option and its metavar: "-o, --output TEXT"."""
    names = ", ".join(sorted(option.opts, key=len))
    text = " / ".join([names, *option.secondary_opts])
    return text if option.is_flag else f"{text} {option.make_metavar(context)}"


def _meaning(param: click.Parameter, text: str | None) -> str:
    parts = [text or ""]
    if isinstance(param, click.Option) and (default := default_text(param)):
        parts.append(f"[default: {default}]")
    if param.required:
        parts.append("[required]")
    return " ".join(parts)


def default_text(option: click.Option) -> str:
    """The default of an option as text; empty if its help states it, or it is a switch."""
    default = option.default
    is_shown = isinstance(default, str | int | float | Path) and not isinstance(default, bool)
    return str(default) if is_shown and option.show_default is not False else ""


def _summary(command: click.Command | None) -> str:
    return " ".join((command.help if command and command.help else "").partition("\n\n")[0].split())


def _bold(text: str) -> str:
    return click.style(text, bold=True)
