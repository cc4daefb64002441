"""Command-line options for encoding, derived from `codec.options`."""

from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any, get_origin

import click

from meshreel.app.cli.completing import names_of
from meshreel.app.cli.messages import flag_of
from meshreel.app.cli.parameters import Decorator, option
from meshreel.codec.option import Option
from meshreel.codec.options import all_options

Encoding = dict[str, Any]
"""Values of the options for encoding, by name."""


def encode_options(**replacements: Decorator) -> Decorator:
    """Decorator: add all options for encoding to a command.

    The command receives them as a dictionary in its parameter `encoding`.

    Parameters
    ----------
    **replacements
        Options with another meaning in this command, by name.
    """

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(function)
        def with_encoding(*context: click.Context, **values: Any) -> None:
            encoding = {row.name: _value(row, values.pop(row.name)) for row in all_options()}
            function(*context, **values, encoding=encoding)

        decorated: Callable[..., Any] = with_encoding
        for row in reversed(all_options()):
            decorated = replacements.get(row.name, encode_option(row))(decorated)
        return decorated

    return decorate


def encode_option(row: Option, panel: str | None = None) -> Decorator:
    """The command-line option of an encoding option, by default in the panel of its group."""
    help_text = row.help_naming(flag_of)
    if row.names and not row.metavar:
        help_text = help_text.replace(".", f": {', '.join(row.names)}.", 1)
    if row.default_text:
        help_text += f" [default: {row.default_text}]"
    kind = row.types[0] if len(row.types) == 1 else str
    return option(
        row.name,
        row.flag,
        type=None if kind is bool else kind,
        is_flag=kind is bool,
        default=row.default,
        range=row.range,
        unit=row.unit,
        help=help_text,
        show_default=not row.default_text,
        metavar=row.metavar or None,
        completion=names_of(row.names) if row.names else None,
        panel=row.group if panel is None else panel,
    )


def _value(row: Option, value: Any) -> Any:
    """The value of an option, with a list of numbers parsed."""
    is_list = any(get_origin(kind) is Sequence for kind in row.types)
    return _numbers(row, value) if is_list and value is not None else value


def _numbers(row: Option, text: str) -> float | list[int]:
    """The number in '8', or the whole numbers in '8,8,6'."""
    single = float if float in row.types else int
    try:
        if "," in text:
            return [int(number) for number in text.split(",") if number.strip()]
        return single(text)
    except ValueError:
        noun = "a number" if single is float else "a whole number"
        raise click.UsageError(
            f"{row.flag} takes {noun}, or several whole numbers as in 8,8,6; got {text!r}"
        ) from None
