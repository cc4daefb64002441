"""Command-line options for encoding, derived from `codec.reel_options`."""

from dataclasses import replace
from typing import Any

import click

from meshreel.app.cli.parameters import Group
from meshreel.codec.option import options_of_fields
from meshreel.codec.reel_options import ReelOptions

COMMON = ("quality", "bound", "max_error", "size", "lossless", "order", "effort")
"""Options that `--help` shows."""

MAX_PERCENT = 100
"""A larger error bound on the command line is a mistake; in Python any is allowed."""

Encoding = dict[str, Any]
"""Values of the options for encoding, by name."""


OPTIONS = tuple(option for option in options_of_fields(ReelOptions) if option.name != "step")
"""Those of the paper's methods are for Python and `meshreel paper`, and a step is for Python."""


def _checked(values: Encoding) -> Encoding:
    for name in ("bound", "max_error"):
        if values[name] and _percent(values[name]) > MAX_PERCENT:
            raise click.UsageError(
                f"--{name.replace('_', '-')} must be at most {MAX_PERCENT}%, the size of the "
                f"model; got {values[name]}; 0.1% is invisible on most models, 1% visible; 5u is "
                "5 model units"
            )
    return values


def _percent(text: str) -> float:
    """The percentage that a text states; 0 if it has another unit."""
    try:
        return float(text.removesuffix("%"))
    except ValueError:
        return 0.0


def encoding(**other_help: str) -> Group:
    """All options for encoding.

    Parameters
    ----------
    **other_help
        Help of options with another meaning in a command, by name.
    """
    params = [replace(option, help=other_help.get(option.name, option.help)) for option in OPTIONS]
    return Group(params, _checked, COMMON)


ENCODING = encoding()
