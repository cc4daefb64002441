"""The options of encoding as options of commands, made from the fields of `EncoderConfig`."""

from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any, get_origin

import click

from meshreel.app.cli.completing import names_of
from meshreel.app.cli.messages import flag_of
from meshreel.app.cli.parameters import Decorator, option
from meshreel.codec.config import all_options
from meshreel.codec.option import Option

Encoding = dict[str, Any]
"""The options of encoding that a command was given, by their names in Python."""


def encode_options(**instead: Decorator) -> Decorator:
    """A decorator that gives a command all options of encoding.

    The command gets them as a dictionary, its parameter `encoding`.

    Parameters
    ----------
    **instead
        By name, options that mean more in this command than in others.
    """

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(function)
        def with_encoding(*context: click.Context, **given: Any) -> None:
            encoding = {row.name: _value(row, given.pop(row.name)) for row in all_options()}
            function(*context, **given, encoding=encoding)

        decorated: Callable[..., Any] = with_encoding
        for row in reversed(all_options()):
            decorated = instead.get(row.name, encode_option(row))(decorated)
        return decorated

    return decorate


def encode_option(row: Option, panel: str | None = None) -> Decorator:
    """An option of encoding as one of a command, by default in the panel of its group."""
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


def _value(row: Option, typed: Any) -> Any:
    """The value of an option for Python."""
    is_list = any(get_origin(one) is Sequence for one in row.types)
    return _numbers(row, typed) if is_list and typed is not None else typed


def _numbers(row: Option, text: str) -> float | list[int]:
    """One number, or several whole ones, from '8' or '8,8,6'."""
    single = float if float in row.types else int
    try:
        if "," in text:
            return [int(number) for number in text.split(",") if number.strip()]
        return single(text)
    except ValueError:
        one = "a number" if single is float else "a whole number"
        raise click.UsageError(
            f"{row.flag} takes {one}, or several whole ones as in 8,8,6; got {text!r}"
        ) from None
