"""Options as annotated fields of dataclasses: type, default, range and help, written once.

The signature and docstring of a function, the command line and the documentation derive from them.
"""

import inspect
import math
import os
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from difflib import get_close_matches
from functools import cache, wraps
from types import UnionType
from typing import (
    Annotated,
    Any,
    Concatenate,
    ParamSpec,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from meshreel.errors import InvalidInputError, Keyword

Options = ParamSpec("Options")
First = TypeVar("First")
Record = TypeVar("Record")
Result = TypeVar("Result")
Function = TypeVar("Function", bound=Callable[..., Any])

DOC_WIDTH = 92
"""Width of a generated docstring, without its indent."""

OPTIONS_LINE = "options"
"""Placeholder in a docstring, followed by one line, that the options replace."""


@dataclass(frozen=True)
class Range:
    """A range of allowed numbers."""

    low: float
    high: float = math.inf
    is_open: bool = False
    """Whether `low` is excluded."""
    is_whole: bool = False
    """Whether only whole numbers are allowed."""

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
        """Both ends for use in a sentence: "1 to 9"."""
        return f"{self.low:g} to {self.high:g}"

    def check(self, number: Any, name: str | Keyword, unit: str = "") -> None:
        """Raise InvalidInputError, with the option's name, unless a number is in the range."""
        allowed = f"{self}, {unit}" if unit else str(self)
        try:
            amount = math.nan if isinstance(number, str | bytes) else float(number)
        except (TypeError, ValueError, OverflowError):
            amount = math.nan
        if amount not in self:
            is_whole = isinstance(number, float) and number.is_integer()
            value = int(number) if is_whole else repr(number) if isinstance(number, str) else number
            raise InvalidInputError(name, f" must be {allowed}; got {value}")


COUNT = Range(1, is_whole=True)
"""Counts of at least 1."""


@dataclass(frozen=True)
class Option:
    """User-facing description of an option: the metadata of its field's annotation.

    ``quality: Annotated[float | None, Option("1 to 100.", range=Range(1, 100))] = None``
    """

    help: str
    """A sentence or two. Refer to other options as ``{unit}``, which becomes ``--unit`` on the
    command line.
    """
    default_text: str = ""
    """Meaning of the default None, unless `help` explains it."""
    names: tuple[str, ...] = ()
    """Allowed values, if they are names."""
    range: Range | None = None
    """Allowed numbers, also of text that is parsed to a number."""
    unit: str = ""
    """Unit of a number, as it follows the range: "in percent"."""
    more: str = ""
    """Additional text of the documentation."""
    group: str = ""
    """Heading in help and documentation; empty for the first."""
    flag: str = ""
    """Name on the command line, such as "--modes"; by default derived from `name`."""
    metavar: str = ""
    """Placeholder of the value in help."""
    implied: Any = None
    """Value of the option without an argument on the command line; None if it needs one."""
    methods: tuple[str, ...] = ()
    """Names of the encoding methods that use it."""
    needs_all_frames: bool = False
    """Whether it needs the whole sequence, so that live frames exclude it."""
    synonyms: Mapping[str, str] = field(default_factory=dict)
    """Names in the paper and other programs, each with the difference of its values, if any."""
    name: str = ""
    """Keyword in Python; like the following, set by `options_of_fields` from the field."""
    annotation: Any = None
    """Type of the field, without the metadata."""
    default: Any = None

    def of_field(self, name: str, annotation: Any, default: Any) -> "Option":
        """Return the option of a field or a parameter."""
        flag = self.flag or f"--{name.replace('_', '-')}"
        return replace(self, name=name, annotation=annotation, default=default, flag=flag)

    @property
    def types(self) -> tuple[Any, ...]:
        """Types of a value, except None."""
        is_union = get_origin(self.annotation) in (Union, UnionType)
        allowed = get_args(self.annotation) if is_union else (self.annotation,)
        return tuple(kind for kind in allowed if kind is not type(None))

    def help_naming(self, name_of: Callable[[str], str]) -> str:
        """Return the help; `name_of` returns the names of other options in it."""
        return self.help.format_map(_OptionNames(name_of))

    def check(self, value: Any) -> None:
        """Raise InvalidInputError unless a value is allowed.

        Lists and text of options that also take numbers are checked by their parsers.
        """
        if value is None and self.default is None:
            return
        if self.annotation is bool and not isinstance(value, bool):
            raise InvalidInputError(Keyword(self.name), f" must be True or False; got {value!r}")
        if self.names:
            if not isinstance(value, str) or value not in self.names:  # arrays compare in their way
                text = repr(value) if isinstance(value, str) else f"of type {type(value).__name__}"
                raise InvalidInputError(
                    Keyword(self.name), f" {text} is unknown; choose {', '.join(self.names)}"
                )
        elif self.range is not None:
            others = [get_origin(kind) or kind for kind in self.types if kind not in (int, float)]
            if not isinstance(value, tuple(others)):
                self.range.check(value, Keyword(self.name), self.unit)

    def check_method(self, method: str) -> None:
        """Raise InvalidInputError unless a method uses the option."""
        if method not in self.methods:
            raise InvalidInputError(
                f"method {method} does not take ",
                Keyword(self.name),
                f"; omit it, or choose {' or '.join(self.methods)}",
            )


class _OptionNames(dict[str, str]):
    """Maps options to the names that a function returns for them."""

    def __init__(self, name_of: Callable[[str], str]) -> None:
        self._name_of = name_of

    def __missing__(self, name: str) -> str:
        return self._name_of(name)


def options_of_fields(record: type) -> tuple[Option, ...]:
    """Return the fields of a dataclass that are annotated with an `Option`, as options."""
    hashable: Any = record  # mypy confuses the hash of the class with that of its instances
    return _options_of_fields(hashable)


@cache
def _options_of_fields(record: Any) -> tuple[Option, ...]:
    hints = get_type_hints(record, include_extras=True)
    options = []
    for row in fields(record):
        if get_origin(hints[row.name]) is Annotated:
            annotation, option = get_args(hints[row.name])
            options.append(option.of_field(row.name, annotation, row.default))
    return tuple(options)


def check_names(names: Iterable[str], known: Sequence[str], options: Iterable[Option] = ()) -> None:
    """Raise InvalidInputError, with the closest known name, unless all names are known.

    A synonym of one of the options gets the name of that.
    """
    for name in names:
        if name not in known:
            raise InvalidInputError(f"option {name!r} is unknown; ", *_advice(name, known, options))


def _advice(name: str, known: Sequence[str], options: Iterable[Option]) -> Iterator[str | Keyword]:
    for option in options:
        if name in option.synonyms:
            difference = option.synonyms[name]
            yield from ("its name is ", Keyword(option.name))
            yield f", {difference}" if difference else ""
            return
    near = get_close_matches(name, known, 1)
    yield f"did you mean {near[0]!r}?" if near else f"choose {', '.join(known)}"


def takes_fields(
    record: Callable[Options, Record],
) -> Callable[[Callable[[First, Record], Result]], Callable[Concatenate[First, Options], Result]]:
    """Return a decorator that passes keywords to a function as the fields of a dataclass.

    The decorated function has the signature of the dataclass; in its docstring, the options replace
    `OPTIONS_LINE`.
    """

    def decorate(
        function: Callable[[First, Record], Result],
    ) -> Callable[Concatenate[First, Options], Result]:
        @wraps(function)
        def with_fields(*args: Any, **kwargs: Any) -> Result:
            if first.name in kwargs and not args:
                args = (kwargs.pop(first.name),)
            if not kwargs.keys() <= hints.keys():
                check_names(kwargs, [*hints], options_of_fields(record))  # type: ignore[arg-type]
            if not args:
                raise TypeError(f"{function.__name__} needs {first.name}")
            return function(args[0], record(*args[1:], **kwargs))

        first, _ = inspect.signature(function, eval_str=True).parameters.values()
        hints = get_type_hints(record)
        fields_of_record = inspect.signature(record).parameters.values()
        parameters = [
            parameter.replace(annotation=hints[parameter.name]) for parameter in fields_of_record
        ]
        with_fields.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
            [first.replace(kind=first.POSITIONAL_OR_KEYWORD), *parameters],
            return_annotation=get_type_hints(function)["return"],
        )
        return lists_fields(record)(with_fields)

    return decorate


def lists_fields(record: Any) -> Callable[[Function], Function]:
    """Return a decorator that puts the options of a dataclass in place of `OPTIONS_LINE`."""

    def decorate(function: Function) -> Function:
        if function.__doc__ and isinstance(record, type):
            options = "\n".join(map(numpydoc, options_of_fields(record)))
            lines = inspect.cleandoc(function.__doc__).split("\n")
            index = lines.index(OPTIONS_LINE)
            function.__doc__ = "\n".join([*lines[:index], options, *lines[index + 2 :]])
        return function

    return decorate


def numpydoc(option: Option) -> str:
    """Describe an option as a numpydoc parameter."""
    names, text = ", ".join(map(literal, option.names)), documentation(option)
    default = "optional" if option.default is None else f"default {literal(option.default)}"
    head = f"{option.name} : {{{names}}}, {default}"
    if not names or len(head) > DOC_WIDTH + 4:
        head = f"{option.name} : {type_text(option)}, {default}"
        text = f"One of {names}. {text}" if names else text
    lines = textwrap.wrap(text, DOC_WIDTH, break_on_hyphens=False)
    return "\n    ".join([head, *lines])


def documentation(option: Option) -> str:
    """Describe an option to users of Python."""
    texts = [option.help_naming("`{}`".format)]
    if option.default_text:
        texts.append(f"Default: {option.default_text}.")
    return " ".join(filter(None, [*texts, option.more]))


def literal(default: Any) -> str:
    """Format a value in Python syntax, text in double quotes."""
    return f'"{default}"' if isinstance(default, str) else repr(default)


def type_text(option: Option) -> str:
    """Name the types of an option: "float or str"."""
    return " or ".join(map(_type_name, option.types))


def _type_name(kind: Any) -> str:
    if (special := {Mapping: "mapping", os.PathLike: "path"}.get(get_origin(kind))) is not None:
        return special
    if not get_origin(kind):
        return str(kind.__name__)
    [item] = get_args(kind)
    return f"sequence of {' or '.join(map(_type_name, get_args(item) or [item]))}"
