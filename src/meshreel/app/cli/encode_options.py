"""Command-line options for encoding, derived from `codec.options`."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, get_origin

import click

from meshreel.app.cli.parameters import Group
from meshreel.codec.option import Option
from meshreel.codec.options import all_options

COMMON = ("quality", "bound", "max_error", "size", "lossless", "order", "effort")
"""Options that `--help` shows."""

MAX_PERCENT = 100
"""A larger error bound on the command line is a mistake; in Python any is allowed."""

Encoding = dict[str, Any]
"""Values of the options for encoding, by name."""


def encoding(**other_help: str) -> Group:
    """All options for encoding.

    Parameters
    ----------
    **other_help
        Help of options with another meaning in a command, by name.
    """
    options = all_options()
    params = [replace(option, help=other_help.get(option.name, option.help)) for option in options]

    def record(values: dict[str, Any]) -> Encoding:
        return {option.name: _value(option, values[option.name]) for option in options}

    return Group(params, record, COMMON)


ENCODING = encoding()


def _value(option: Option, value: Any) -> Any:
    """The value of an option, with a list of numbers parsed."""
    if option.name in ("bound", "max_error") and value and _percent(value) > MAX_PERCENT:
        raise click.UsageError(
            f"{option.flag} must be at most {MAX_PERCENT}%, the size of the model; got {value}; "
            "0.1% is invisible on most models, 1% visible; 5u is 5 model units"
        )
    is_list = any(get_origin(kind) is Sequence for kind in option.types)
    return _numbers(option, value) if is_list and value is not None else value


def _percent(text: str) -> float:
    """The percentage that a text states; 0 if it has another unit."""
    try:
        return float(text.removesuffix("%"))
    except ValueError:
        return 0.0


def _numbers(option: Option, text: str) -> float | list[int]:
    """The number in '8', or the whole numbers in '8,8,6'."""
    single = float if float in option.types else int
    try:
        if "," in text:
            return [int(number) for number in text.split(",") if number.strip()]
        return single(text)
    except ValueError:
        noun = "a number" if single is float else "a whole number"
        raise click.UsageError(
            f"{option.flag} takes {noun}, or several whole numbers as in 8,8,6; got {text!r}"
        ) from None
