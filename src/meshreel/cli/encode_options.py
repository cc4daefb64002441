"""The options of encoding as options of commands, made from their table."""

import inspect
from collections.abc import Callable, Sequence
from functools import wraps
from typing import Annotated, Any, get_origin

import typer
from typer.models import OptionInfo

from meshreel.cli.completing import names_of
from meshreel.cli.option_names import in_option_names
from meshreel.codec.option import Option
from meshreel.codec.options import all_options

Encoding = dict[str, Any]
"""The options of encoding that a command was given, by their names in Python."""

PARAMETER = "encoding"

CommandFunction = Callable[..., None]


def with_encode_options(**instead: Any) -> Callable[[CommandFunction], CommandFunction]:
    """A decorator that gives a command all options of encoding.

    They stand where the command has the parameter `encoding`, which gets them as a dictionary.

    Parameters
    ----------
    **instead
        By name, annotations of options that mean more in this command than in others.
    """

    def decorate(command: CommandFunction) -> CommandFunction:
        options = all_options()
        signature = inspect.signature(command)
        parameters: list[inspect.Parameter] = []
        for parameter in signature.parameters.values():
            if parameter.name == PARAMETER:
                parameters += [_parameter(option, instead.get(option.name)) for option in options]
            else:
                parameters.append(parameter)

        @wraps(command)
        def with_encoding(**given: Any) -> None:
            encoding = {option.name: _value(option, given.pop(option.name)) for option in options}
            command(**given, **{PARAMETER: encoding})

        # Typer reads both.
        with_encoding.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
        with_encoding.__annotations__ = {one.name: one.annotation for one in parameters}
        return with_encoding

    return decorate


def option_info(option: Option) -> OptionInfo:
    """Typer's description of an option: its flag, help, default, panel and completion."""
    help_text = option.help
    if option.names and not option.metavar:
        help_text = help_text.replace(".", f": {', '.join(option.names)}.", 1)
    if option.default_text:
        help_text += f" [default: {option.default_text}]"
    info: OptionInfo = typer.Option(
        option.flag,
        help=in_option_names(help_text),
        show_default=not option.default_text,
        metavar=option.metavar or None,
        autocompletion=names_of(option.names) if option.names else None,
        rich_help_panel=option.group or None,
    )
    return info


def _parameter(option: Option, annotation: Any) -> inspect.Parameter:
    return inspect.Parameter(
        option.name,
        inspect.Parameter.KEYWORD_ONLY,
        default=option.default,
        annotation=annotation or Annotated[_type_typed(option), option_info(option)],
    )


def _type_typed(option: Option) -> Any:
    """The type that is read from a command line: text, where numbers have units or are several."""
    typed = option.type if len(option.types) == 1 else str
    return typed | None if option.default is None else typed


def _value(option: Option, typed: Any) -> Any:
    """The value of an option for Python."""
    is_list = any(get_origin(one) is Sequence for one in option.types)
    return _numbers(option, typed) if is_list and typed is not None else typed


def _numbers(option: Option, text: str) -> float | list[int]:
    """One number, or several whole ones, from '8' or '8,8,6'."""
    single = float if float in option.types else int
    try:
        if "," in text:
            return [int(number) for number in text.split(",") if number.strip()]
        return single(text)
    except ValueError:
        one = "a number" if single is float else "a whole number"
        raise typer.BadParameter(
            f"{option.flag} takes {one}, or several whole ones as in 8,8,6; got {text!r}"
        ) from None
