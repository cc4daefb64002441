"""Parameters of commands, derived from the annotations of their functions.

    def convert_command(
        inputs: Annotated[tuple[str, ...], Argument("INPUT...", "The files to read.")],
        fps: Annotated[float | None, Option("Frames per second.")] = None,
    ) -> None:

`meshreel.codec.option.Option` describes an option, as for the fields of `EncoderConfig`.
"""

import inspect
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, NewType, get_args, get_origin

import click
from click.shell_completion import CompletionItem

from meshreel.app.cli.messages import flag_of
from meshreel.codec.option import Option, Range
from meshreel.errors import InvalidInputError

File = NewType("File", str)
"""Path or address of a file; the shell completes names of files."""


@dataclass(frozen=True)
class Argument:
    """A positional argument: its placeholder and help."""

    metavar: str
    help: str


@dataclass(frozen=True)
class Group:
    """Options that a command receives as one value."""

    options: Sequence[Option]
    """With their names, annotations and defaults."""
    record: Callable[[dict[str, Any]], Any]
    """Makes the value from those of the options by name."""
    common: Collection[str] | None = None
    """Names of the options that `--help` shows; `--help-all` shows all. Default: all."""


ForceOption = Annotated[bool, Option("Replace existing outputs.", flag="--force -f")]
JsonOption = Annotated[bool, Option("Print the figures as JSON.", flag="--json")]


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
            numerator, slash, denominator = str(value).partition("/")  # as in 30000/1001
            is_fraction = bool(slash) and self._kind is float
            number = float(numerator) / float(denominator) if is_fraction else self._kind(value)
        except (ValueError, ZeroDivisionError):
            number = None
        if self._allowed is not None:
            self._allowed.check(value if number is None else number, param.opts[0], self._unit)
        if number is None:
            noun = "a number" if self._kind is float else "a whole number"
            raise InvalidInputError(f"{param.opts[0]} must be {noun}; got {value!r}")
        return number


class ClickOption(click.Option):
    """An option with the title of its help panel; the first panel of options if empty.

    `--help` omits it if it is rare.
    """

    panel = ""
    is_rare = False


class ClickArgument(click.Argument):
    """A positional argument with help."""

    help: str = ""


def with_parameters(
    function: Callable[..., Any],
) -> tuple[list[click.Parameter], Callable[..., Any]]:
    """Parameters of a function, and a function that takes their values."""
    parameters: list[click.Parameter] = []
    groups: dict[str, Group] = {}
    for parameter in inspect.signature(function).parameters.values():
        annotation, declaration = get_args(parameter.annotation)
        if isinstance(declaration, Group):
            groups[parameter.name] = declaration
            common = declaration.common
            for option in declaration.options:
                is_rare = common is not None and option.name not in common
                parameters.append(click_option(option, is_rare=is_rare))
        elif isinstance(declaration, Argument):
            argument = ClickArgument(
                [parameter.name],
                type=click.Path(path_type=Path if annotation is Path else str),
                nargs=-1 if get_origin(annotation) is tuple else 1,
                required=parameter.default is inspect.Parameter.empty,
                metavar=declaration.metavar,
            )
            argument.help = declaration.help
            parameters.append(argument)
        else:
            is_required = parameter.default is inspect.Parameter.empty
            default = None if is_required else parameter.default
            option = declaration.of_field(parameter.name, annotation, default)
            parameters.append(click_option(option, required=is_required))

    def call(**values: Any) -> Any:
        for name, group in groups.items():
            values[name] = group.record(
                {option.name: values.pop(option.name) for option in group.options}
            )
        return function(**values)

    return parameters, call


def click_option(option: Option, *, required: bool = False, is_rare: bool = False) -> ClickOption:
    """The option as Click defines it."""
    help_text = option.help_naming(flag_of)
    if option.names and not option.metavar:
        help_text = help_text.replace(".", f": {', '.join(option.names)}.", 1)
    if option.default_text:
        help_text += f" [default: {option.default_text}]"
    is_list = get_origin(option.types[0]) is tuple
    kind = str if is_list or len(option.types) > 1 else option.types[0]
    parameter = ClickOption(
        [option.name, *option.flag.split()],
        type=None if kind is bool else _click_type(kind, option),
        is_flag=kind is bool,
        **({} if option.implied is None else {"flag_value": option.implied}),
        multiple=is_list,
        required=required,
        help=help_text,
        show_default=not option.default_text,
        metavar=option.metavar or None,
        shell_complete=_completer_of(option.names) if option.names else None,
        **({} if required else {"default": option.default}),
    )
    parameter.panel, parameter.is_rare = option.group, is_rare
    return parameter


def _click_type(kind: Any, option: Option) -> Any:
    if get_origin(kind) is Literal:
        return click.Choice(get_args(kind))
    if kind in (int, float):
        return Number(kind, option.range, option.unit)
    return click.Path(path_type=Path if kind is Path else str) if kind in (Path, File) else str


def _completer_of(names: Iterable[str]) -> Any:
    """A function that completes names for Click."""

    def complete(_context: Any, _param: Any, incomplete: str) -> list[CompletionItem]:
        return [CompletionItem(name) for name in names if name.startswith(incomplete)]

    return complete
