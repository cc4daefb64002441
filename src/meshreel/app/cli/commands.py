"""The commands of the program, each imported when it runs or shows its help."""

import inspect
import re
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import click

from meshreel.app.cli.help_panels import HELP_ALL, write_help

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


class Command(click.Command):
    """A command with help in panels."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse arguments; refuse misplaced outputs, split values, and addresses if unsupported."""
        from meshreel.app.cli.output_position import check_output_position
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
                suggestion = _flag_of_synonym(error.option_name)
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


def _flag_of_synonym(option_name: str) -> str:
    """Return the option that the paper or another program calls "--n-c"; empty if none does."""
    from meshreel.codec.options import all_options

    name = option_name.removeprefix("--").replace("-", "_")
    return next((option.flag for option in all_options() if name in option.synonyms), "")


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
