"""The commands of the program, each imported when it runs or shows its help.

Help has a panel for each group of options. Errors name the correct command for an output given as
an argument instead of an option, or vice versa.
"""

import inspect
import re
import shlex
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import click

COMMANDS = (
    "encode",
    "register",
    "batch",
    "decode",
    "convert",
    "formats",
    "info",
    "compare",
    "view",
    "export",
    "render",
    "demo",
    "core",
    "paper",
    "evaluate",
)
"""In the order of the help. Module `meshreel.app.cli.encode` defines `encode_command`."""

NUMBER = re.compile(r"\d*\.?\d+(e[+-]?\d+)?")

MAX_SHOWN = 30
"""Largest number of options that `--help` shows whether or not they are common."""

WITH_ADDRESSES = frozenset({"encode", "register", "batch", "decode", "convert", "info", "compare"})
"""Commands that accept addresses of remote files."""

HELP_ALL = "--help-all"

CODE = re.compile(r"`([^`]+)`")
"""An item of a list that is a command, between backticks."""

OUTPUT_EXTENSIONS = {"output": ".reel", "out": ""}
"""Extension of the output by the name of its option; empty for a folder."""

OUTPUT_FLAGS = ("-o", "--output", "--out")

Row = tuple[str, str]
"""Names and their meaning."""


class Command(click.Command):
    """A command with help in panels."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse arguments; refuse misplaced outputs, split values, and addresses if unsupported."""
        from meshreel.runtime.stores.address import refuse_address

        _refuse_split_values(ctx, args)
        if not {*ctx.help_option_names, HELP_ALL} & {*args} and not ctx.resilient_parsing:
            check_output_position(self, ctx, args)
        if self.name not in WITH_ADDRESSES:
            for arg in args:
                refuse_address(arg, f"every file of `meshreel {self.name}`")
        try:
            return super().parse_args(ctx, args)
        except click.UsageError as error:
            error.ctx = error.ctx or ctx  # the parser does not set it
            if isinstance(error, click.NoSuchOption):
                from meshreel.codec.options import all_options

                # The paper or another program calls an option "--n-c".
                name = error.option_name.removeprefix("--").replace("-", "_")
                suggestion = next((it.flag for it in all_options() if name in it.synonyms), "")
                if any(suggestion in param.opts for param in self.params):
                    message = f"{error.message} Did you mean {suggestion!r}?"
                    raise click.UsageError(message, ctx) from None
            raise

    def format_help(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the help in panels."""
        write_help(self, ctx, formatter)


class Program(click.Group):
    """The program: a group that imports commands on demand."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of all commands."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command, or None if there is no such command."""
        return command_named(cmd_name) if cmd_name in COMMANDS else None

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command that the arguments name; an error suggests similar names."""
        name = args[0]
        if name in COMMANDS:
            return super().resolve_command(ctx, args)
        from difflib import get_close_matches

        similar = " or ".join(map(repr, get_close_matches(name, COMMANDS)))
        suggestion = f" Did you mean {similar}?" if similar else ""
        raise click.UsageError(f"No such command {name!r}.{suggestion}", ctx)

    def format_help(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the help in panels."""
        write_help(self, ctx, formatter)


def _refuse_split_values(ctx: click.Context, args: list[str]) -> None:
    """Raise UsageError if a space separates the unit of an option from its number."""
    words = [word for arg in args for word in (arg.split("=", 1) if arg[:2] == "--" else [arg])]
    for option, number, unit in zip(words, words[1:], words[2:], strict=False):
        if option[:2] == "--" and NUMBER.fullmatch(number) and not Path(unit).exists():
            from meshreel.codec.error_bounds import METERS, MODEL_UNITS
            from meshreel.codec.memory import UNITS

            if unit in {*UNITS, *METERS, MODEL_UNITS, "%", "deg"}:
                raise click.UsageError(
                    f"a space separates {number} from its unit; write {option} {number}{unit}", ctx
                )


def check_output_position(command: click.Command, ctx: click.Context, args: Sequence[str]) -> None:
    """Raise UsageError with the correct command if the output is in the wrong place."""
    arguments = [param for param in command.params if isinstance(param, click.Argument)]
    outputs = [param for param in command.params if param.name in OUTPUT_EXTENSIONS]
    try:
        values, extra, _ = command.make_parser(ctx).parse_args(list(args))
    except click.NoSuchOption as error:
        if error.option_name in OUTPUT_FLAGS and not outputs:
            names = [param.make_metavar(ctx) for param in arguments]
            if any(name.startswith("OUT") for name in names):
                line = " ".join([ctx.command_path, *names])
                message = f"the output is an argument, not an option: {line}"
                raise click.UsageError(message, ctx) from None
        return
    except click.UsageError:
        return  # Click reports it
    words: list[str] = []
    for param in arguments:  # the value of a missing argument is neither a string nor a tuple
        value = values.get(param.name)
        if isinstance(value, str):
            words.append(value)
        elif isinstance(value, tuple):
            words.extend(value)
    words += extra
    n_extra = len(words) - len(arguments)
    takes_list = any(param.nargs < 0 for param in arguments)
    for output in outputs:
        if output.name not in values and (n_extra == 1 or (takes_list and n_extra > 1)):
            _refuse_argument(output, ctx, words)


def _refuse_argument(output: click.Parameter, ctx: click.Context, words: Sequence[str]) -> None:
    """Raise UsageError if the last of the arguments is probably the output.

    Parameters
    ----------
    output : Parameter
        Option of the output.
    words : sequence of str
        All arguments.
    """
    from meshreel.runtime.stores.address import is_remote

    *inputs, last = words
    extension = _extension(last)
    is_new = not is_remote(last) and not Path(last).exists()
    differs = bool(inputs) and extension != _extension(inputs[-1])
    if output.required:
        is_output = is_new or differs
    else:
        expected = OUTPUT_EXTENSIONS[output.name or ""]
        # An existing folder may be another input.
        is_output = extension == expected and (is_new or (differs and expected != ""))
    if is_output:
        flag = min(output.opts, key=len)
        first_input = shlex.join(inputs[:1]) + (" ..." if len(inputs) > 1 else "")
        line = " ".join(filter(None, [ctx.command_path, first_input, flag, shlex.quote(last)]))
        raise click.UsageError(f"the output is given with {flag}: {line}", ctx)


def _extension(word: str) -> str:
    from meshreel.runtime.stores.address import without_query

    return Path(without_query(word)).suffix.lower()


def write_help(
    command: click.Command, context: click.Context, formatter: click.HelpFormatter
) -> None:
    """Write the help of a command."""
    formatter.write_usage(context.command_path, " ".join(command.collect_usage_pieces(context)))
    # Paragraphs of the docstring, and the items of its lists, which begin with "- ".
    for paragraph in (command.help or "").split("\n\n"):
        formatter.write_paragraph()
        is_list = paragraph.startswith("- ")
        for item in paragraph.split("\n- ") if is_list else [paragraph]:
            line = " ".join(item.removeprefix("- ").split())
            if is_list:
                line = "- " + CODE.sub(r"\1", line)
            following = "    " if is_list else "  "
            formatter.write(click.wrap_text(line, formatter.width, "  ", following) + "\n")
    for title, rows in _panels(command, context).items():
        with formatter.section(_bold(title)):
            formatter.write_dl([(_bold(names), meaning) for names, meaning in rows])


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
            names = ", ".join(sorted(param.opts, key=len))
            text = " / ".join([names, *param.secondary_opts])
            if not param.is_flag:
                text = f"{text} {param.make_metavar(context)}"
            panels.setdefault(title, []).append((text, _meaning(param, param.help)))
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            one = command.get_command(context, name)
            summary = (one.help if one and one.help else "").partition("\n\n")[0]
            panels.setdefault("Commands", []).append((name, " ".join(summary.split())))
    return {title: rows for title, rows in panels.items() if rows}


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


def _bold(text: str) -> str:
    return click.style(text, bold=True)


def _show_all(ctx: click.Context, _param: click.Parameter, shows_all: bool) -> None:
    """Print the help with all options, and exit."""
    if shows_all and not ctx.resilient_parsing:
        ctx.meta[HELP_ALL] = True
        click.echo(ctx.get_help(), color=ctx.color)
        ctx.exit()


def command(function: Callable[..., Any]) -> click.Command:
    """Decorator: turn a function into a command with its annotated parameters.

    Its docstring is the help.
    """
    from meshreel.app.cli.parameters import with_parameters

    name = function.__name__.removesuffix("_command")
    params, callback = with_parameters(function)
    n_rare = sum(getattr(param, "is_rare", False) for param in params)
    if len(params) > MAX_SHOWN and n_rare:
        text = f"Show this message with {n_rare} more options, and exit."
        params.append(
            click.Option(
                [HELP_ALL], is_flag=True, is_eager=True, expose_value=False, callback=_show_all,
                help=text,
            )
        )  # fmt: skip
    return Command(name, params=params, callback=callback, help=inspect.getdoc(function))


def command_named(name: str) -> click.Command:
    """Import a command of `COMMANDS`."""
    module = import_module(f"meshreel.app.cli.{name}")
    result: click.Command = getattr(module, f"{name}_command")
    return result
