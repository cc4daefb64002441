"""Arguments and options of commands: those of Click, with help panels and number ranges."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from meshreel.codec.option import Range
from meshreel.errors import InvalidInputError

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]
Completion = Callable[[str], list[str]]
"""A function from an incomplete word to its completions."""

FILE = "file"
"""Completion type that makes the shell complete file names."""


class Number(click.ParamType):  # type: ignore[type-arg]  # not generic in older Click
    """A number or whole number within a range.

    Parameters
    ----------
    kind : type
        int or float.
    allowed : Range, optional
        Default: all numbers.
    unit : str
        Unit that follows the range in messages, such as "in percent".
    """

    def __init__(self, kind: Callable[[str], float], allowed: Range | None, unit: str) -> None:
        self.name = "number" if kind is float else "integer"
        self._kind, self._allowed, self._unit = kind, allowed, unit

    def convert(self, value: Any, param: Any, ctx: Any) -> float:
        """Parse a number; the error names the allowed range."""
        if isinstance(value, str) and self._unit == "in percent":
            value = value.removesuffix("%")
        try:
            number = self._kind(value)
        except ValueError:
            number = None
        if self._allowed is not None:
            self._allowed.check(value if number is None else number, param.opts[0], self._unit)
        if number is None:
            noun = "a number" if self._kind is float else "a whole number"
            raise InvalidInputError(f"{param.opts[0]} must be {noun}; got {value!r}")
        return number


class Option(click.Option):
    """An option with its help panel.

    Parameters
    ----------
    names : sequence of str
        The option, after the name of the function's parameter if that differs.
    type : type
        str, int, float or Path.
    panel : str
        Title of the help panel; the first panel of options if empty.
    completion : function, optional
    range, unit : Range and str, optional
        Range of numbers; see `Number`.
    **settings
        Arguments of `click.Option`.
    """

    def __init__(
        self,
        names: Sequence[str],
        type: Any = None,
        panel: str = "",
        completion: Completion | None = None,
        range: Range | None = None,
        unit: str = "",
        **settings: Any,
    ) -> None:
        kind = Number(type, range, unit) if type in (int, float) else _click_type(type)
        super().__init__(names, type=kind, shell_complete=_completing(completion), **settings)
        self.panel = panel


class Argument(click.Argument):
    """A positional argument with help; see `Option`."""

    def __init__(
        self,
        names: Sequence[str],
        help: str,
        type: Any = None,
        completion: Completion | None = None,
        **settings: Any,
    ) -> None:
        kind = _click_type(type)
        super().__init__(names, type=kind, shell_complete=_completing(completion), **settings)
        self.help = help


option: Callable[..., Decorator] = partial(click.option, cls=Option)
argument: Callable[..., Decorator] = partial(click.argument, cls=Argument)


def _click_type(kind: Any) -> Any:
    return click.Path(path_type=Path) if kind is Path else kind


def _completing(completion: Completion | None) -> Any:
    """The completion as Click calls it; without a match the shell completes file names."""
    if completion is None:
        return None

    def complete(_context: Any, _param: Any, incomplete: str) -> list[CompletionItem]:
        items = [CompletionItem(word) for word in completion(incomplete)]
        return items or [CompletionItem(incomplete, type=FILE)]

    return complete
