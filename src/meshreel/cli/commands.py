"""The commands of the program, each imported when it is asked for, and how their help is shown."""

from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Any, Final

import typer
from typer.core import TyperCommand, TyperGroup

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
"""In the order of help; `encode` is the function `encode_command` of `meshreel.cli.encode`."""

TAKE_ADDRESSES = frozenset({"encode", "batch", "decode", "convert", "info", "compare"})
"""Commands whose files may be remote."""

MARKUP: Final = "markdown"


class Command(TyperCommand):
    """A command whose help shows no type beside its flags."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Take its words; addresses only where they have an effect."""
        from meshreel.stores.address import refuse_address

        if self.name not in TAKE_ADDRESSES:
            for given in args:
                refuse_address(given, f"what `meshreel {self.name}` reads and writes")
        return list(super().parse_args(ctx, args))

    def get_params(self, ctx: Any) -> list[Any]:
        """Its arguments and options."""
        return _flags_alone(super().get_params(ctx))


class LazyCommands(Mapping[str, Any]):
    """`COMMANDS` by name; only those that are asked for are imported."""

    def __init__(self) -> None:
        self._made: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in COMMANDS:
            raise KeyError(name)
        if name not in self._made:
            self._made[name] = _command(name)
        return self._made[name]

    def __contains__(self, name: object) -> bool:
        return name in COMMANDS

    def __iter__(self) -> Iterator[str]:
        return iter(COMMANDS)

    def __len__(self) -> int:
        return len(COMMANDS)


class Group(TyperGroup):
    """The program, whose help shows no type beside its flags."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**{**settings, "commands": LazyCommands()})

    def get_params(self, ctx: Any) -> list[Any]:
        """Its options."""
        return _flags_alone(super().get_params(ctx))


def _command(name: str) -> Any:
    """The command of a name: Typer makes one of an application that has no other."""
    only = typer.Typer(
        add_completion=False, rich_markup_mode=MARKUP, pretty_exceptions_enable=False
    )
    module = import_module(f"meshreel.cli.{name}")
    only.command(name, cls=Command)(getattr(module, f"{name}_command"))
    return typer.main.get_command(only)


def _flags_alone(params: list[Any]) -> list[Any]:
    for param in params:
        if getattr(param, "is_flag", False):
            param.metavar = ""
    return params
