"""Options as annotated fields of dataclasses: type, default, range and help, written once.

The signature and docstring of a function, the command line and the documentation are made from
them.
"""

import inspect
import math
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from functools import wraps
from types import UnionType
from typing import (
    Annotated,
    Any,
    Concatenate,
    ParamSpec,
    TypeVar,
    get_args,
    get_origin,
    get_type_hints,
)

from meshreel.errors import InvalidInputError

Options = ParamSpec("Options")
First = TypeVar("First")
Record = TypeVar("Record")
Result = TypeVar("Result")

DOC_WIDTH = 92
"""Characters of a line of a generated docstring, without its indent."""

OPTIONS_LINE = "options"
"""Parameter in the docstring of a function, with a line of text, that all options replace."""


@dataclass(frozen=True)
class Range:
    """The numbers that are allowed.

    Parameters
    ----------
    is_open : bool, default False
        Whether `low` itself is refused.
    is_whole : bool, default False
        Whether only whole numbers are allowed.
    """

    low: float
    high: float = math.inf
    is_open: bool = False
    is_whole: bool = False

    def __contains__(self, number: float) -> bool:
        if not self.low <= number <= self.high or not math.isfinite(number):
            return False
        if self.is_open and number == self.low:
            return False
        return not self.is_whole or int(number) == number

    def __str__(self) -> str:
        kind = "a whole number of " if self.is_whole else ""
        if self.high == math.inf:
            return f"above {self.low:g}" if self.is_open else f"{kind}at least {self.low:g}"
        if self.is_open:
            return f"above {self.low:g} and up to {self.high:g}"
        return f"{self.low:g}..{self.high:g}"

    @property
    def words(self) -> str:
        """The same inside of a sentence, for a range with two ends: "1 to 9"."""
        return f"{self.low:g} to {self.high:g}"

    def check(self, number: Any, name: str, unit: str = "") -> None:
        """Nothing if a number is in the range.

        Parameters
        ----------
        name : str
            What the number is, for the error.

        Raises
        ------
        InvalidInputError
            If it is not, or is no number.
        """
        allowed = f"{self}, {unit}" if unit else str(self)
        if _as_number(number) not in self:
            shown = repr(number) if isinstance(number, str) else number
            raise InvalidInputError(f"{name} must be {allowed}; got {shown}")


COUNT = Range(1, is_whole=True)
"""How many of something, where there has to be one."""


@dataclass(frozen=True)
class Option:
    """What a field of options means to users: the metadata of its annotation.

    ``quality: Annotated[float | None, Option("1 to 100.", range=Range(1, 100))] = None``

    Attributes
    ----------
    help : str
        What is chosen, in a sentence or two. Write other options as ``{unit}``, which becomes
        ``--unit`` on the command line.
    default_text : str
        Where the default is None: what that means, unless `help` says it.
    names : tuple of str
        The values that are allowed, where they are names.
    range : Range or None
        The numbers that are allowed. Of an option that takes text besides, the numbers that it
        may mean.
    unit : str
        Of a number, as it follows the range: "in percent".
    more : str
        What the documentation says besides.
    group : str
        Heading in help and documentation; empty for the first.
    flag : str
        Name on the command line, such as "--modes"; made from `name` where it is empty.
    metavar : str
        Stands for the value in help.
    methods : tuple of str
        Names of the methods of coding that it has an effect on.
    name : str
        Of the field: the keyword in Python. Set by `options_of_fields`, as the following.
    annotation : type
        Of the field, without the metadata.
    default : object
        Of the field.
    """

    help: str
    default_text: str = ""
    names: tuple[str, ...] = ()
    range: Range | None = None
    unit: str = ""
    more: str = ""
    group: str = ""
    flag: str = ""
    metavar: str = ""
    methods: tuple[str, ...] = ()
    name: str = ""
    annotation: Any = None
    default: Any = None

    @property
    def types(self) -> tuple[Any, ...]:
        """The types that a value may have, besides None."""
        allowed = get_args(self.annotation) if self.has_several_types else (self.annotation,)
        return tuple(one for one in allowed if one is not type(None))

    @property
    def has_several_types(self) -> bool:
        """Whether the annotation is a union."""
        return isinstance(self.annotation, UnionType)

    def help_naming(self, name_of: Callable[[str], str]) -> str:
        """The help, in which a function gives names to other options."""
        return self.help.format_map(_Named(name_of))

    def check(self, value: Any) -> None:
        """Nothing if a value is allowed.

        Lists and text of options that take numbers, too, are left to those who read them.

        Raises
        ------
        InvalidInputError
            If it is not; says which are.
        """
        if value is None and self.default is None:
            return
        if self.annotation is bool and not isinstance(value, bool):
            raise InvalidInputError(f"{self.name} must be True or False; got {value!r}")
        if self.names:
            if value not in self.names:
                raise InvalidInputError(
                    f"{self.name} {value!r} is unknown; choose {', '.join(self.names)}"
                )
        elif self.range is not None and not self._is_read_elsewhere(value):
            self.range.check(value, self.name, self.unit)

    def _is_read_elsewhere(self, value: Any) -> bool:
        others = [get_origin(one) or one for one in self.types if one not in (int, float)]
        return any(isinstance(value, other) for other in others)


def _as_number(value: Any) -> float:
    """A value as a float; not-a-number if it is none."""
    try:
        return math.nan if isinstance(value, str | bytes) else float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan


class _Named(dict[str, str]):
    """Names of options, each from a function when it is looked up."""

    def __init__(self, name_of: Callable[[str], str]) -> None:
        self._name_of = name_of

    def __missing__(self, name: str) -> str:
        return self._name_of(name)


def options_of_fields(record: type) -> tuple[Option, ...]:
    """The fields of a dataclass whose annotation has an `Option`, as options with their names."""
    hints = get_type_hints(record, include_extras=True)
    found = []
    for field in fields(record):
        if get_origin(hints[field.name]) is Annotated:
            annotation, option = get_args(hints[field.name])
            flag = option.flag or f"--{field.name.replace('_', '-')}"
            found.append(
                replace(
                    option,
                    name=field.name,
                    annotation=annotation,
                    default=field.default,
                    flag=flag,
                )
            )
    return tuple(found)


def takes_fields(
    record: Callable[Options, Record],
) -> Callable[[Callable[[First, Record], Result]], Callable[Concatenate[First, Options], Result]]:
    """A decorator for a function of a value and a dataclass: it takes the fields as keywords.

    Its signature is that of the dataclass; in its docstring, options replace the parameter
    `OPTIONS_LINE`.
    """

    def decorate(
        function: Callable[[First, Record], Result],
    ) -> Callable[Concatenate[First, Options], Result]:
        @wraps(function)
        def with_fields(first: First, /, *args: Options.args, **kwargs: Options.kwargs) -> Result:
            return function(first, record(*args, **kwargs))

        first, _ = inspect.signature(function, eval_str=True).parameters.values()
        hints = get_type_hints(record)
        given = inspect.signature(record).parameters.values()
        parameters = [one.replace(annotation=hints[one.name]) for one in given]
        with_fields.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
            [first.replace(kind=first.POSITIONAL_OR_KEYWORD), *parameters],
            return_annotation=get_type_hints(function)["return"],
        )
        if with_fields.__doc__ and isinstance(record, type):
            described = "\n".join(map(numpydoc, options_of_fields(record)))
            lines = inspect.cleandoc(with_fields.__doc__).split("\n")
            place = lines.index(OPTIONS_LINE)
            with_fields.__doc__ = "\n".join([*lines[:place], described, *lines[place + 2 :]])
        return with_fields

    return decorate


def numpydoc(option: Option) -> str:
    """An option as numpydoc describes a parameter."""
    names, text = ", ".join(map(literal, option.names)), documentation(option)
    default = "optional" if option.default is None else f"default {literal(option.default)}"
    head = f"{option.name} : {{{names}}}, {default}"
    if not names or len(head) > DOC_WIDTH + 4:
        head = f"{option.name} : {type_text(option)}, {default}"
        text = f"One of {names}. {text}" if names else text
    lines = textwrap.wrap(text, DOC_WIDTH, break_on_hyphens=False)
    return "\n    ".join([head, *lines])


def documentation(option: Option) -> str:
    """The text about an option for users of Python."""
    texts = [option.help_naming("`{}`".format)]
    if option.default_text:
        texts.append(f"Default: {option.default_text}.")
    return " ".join(filter(None, [*texts, option.more]))


def literal(default: Any) -> str:
    """A value in Python syntax, text in double quotes."""
    return f'"{default}"' if isinstance(default, str) else repr(default)


def type_text(option: Option) -> str:
    """The types of an option in words: "float or str"."""
    return " or ".join(map(_type_name, option.types))


def _type_name(kind: Any) -> str:
    if get_origin(kind) is Mapping:
        return "mapping"
    return f"sequence of {get_args(kind)[0].__name__}" if get_origin(kind) else kind.__name__
