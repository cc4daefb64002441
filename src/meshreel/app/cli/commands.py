"""The commands of the program, each imported when it runs or shows its help."""

from collections.abc import Callable
from importlib import import_module
from typing import Any

import click

COMMANDS = (
    "encode",
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
"""In the order of help; `encode` is the function `encode_command` of `meshreel.app.cli.encode`."""

TAKE_ADDRESSES = frozenset({"encode", "batch", "decode", "convert", "info", "compare"})
"""Commands whose files may be remote."""


class Command(click.Command):
    """A command whose help is drawn in panels."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Take its words; addresses only where they have an effect."""
        from meshreel.runtime.stores.address import refuse_address

        if self.name not in TAKE_ADDRESSES:
            for given in args:
                refuse_address(given, f"what `meshreel {self.name}` reads and writes")
        return super().parse_args(ctx, args)

    def get_help(self, ctx: click.Context) -> str:
        """Its help, as wide as the terminal."""
        from meshreel.app.cli.help_panels import help_text

        return help_text(self, ctx)


class Program(click.Group):
    """The program: a group that imports a command when it is used."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Their names."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command of a name."""
        return command_named(cmd_name) if cmd_name in COMMANDS else None

    def get_help(self, ctx: click.Context) -> str:
        """Its help, as wide as the terminal."""
        from meshreel.app.cli.help_panels import help_text

        return help_text(self, ctx)


def command(function: Callable[..., Any]) -> click.Command:
    """A decorator that makes a command of a function, whose docstring is its help."""
    return click.command(function.__name__.removesuffix("_command"), cls=Command)(function)


def command_named(name: str) -> click.Command:
    """One of `COMMANDS`."""
    found: click.Command = getattr(import_module(f"meshreel.app.cli.{name}"), f"{name}_command")
    return found
