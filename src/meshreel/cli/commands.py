"""How commands and options are shown in help: a flag stands alone, for it takes no value."""

from typing import Any

from typer.core import TyperCommand, TyperGroup


class Command(TyperCommand):
    """A command whose help shows no type beside its flags."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Its arguments and options."""
        return _flags_alone(super().get_params(ctx))


class Group(TyperGroup):
    """The program, whose help shows no type beside its flags."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Its options."""
        return _flags_alone(super().get_params(ctx))


def _flags_alone(params: list[Any]) -> list[Any]:
    for param in params:
        if getattr(param, "is_flag", False):
            param.metavar = ""
    return params
