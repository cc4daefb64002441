"""Errors for an output given as an argument instead of an option, or vice versa."""

import shlex
from collections.abc import Sequence
from pathlib import Path

import click

from meshreel.runtime.stores.address import is_remote, without_query

OUTPUT_EXTENSIONS = {"output": ".reel", "out": ""}
"""Extension of the output by the name of its option; empty for a folder."""

OUTPUT_FLAGS = ("-o", "--output", "--out")


def check_output_position(command: click.Command, ctx: click.Context, args: Sequence[str]) -> None:
    """Raise UsageError with the correct command if the output is in the wrong place."""
    arguments = [param for param in command.params if isinstance(param, click.Argument)]
    outputs = [param for param in command.params if param.name in OUTPUT_EXTENSIONS]
    try:
        values, extra, _ = command.make_parser(ctx).parse_args(list(args))
    except click.NoSuchOption as error:
        if error.option_name in OUTPUT_FLAGS and not outputs:
            _refuse_option(arguments, ctx)
        return
    except click.UsageError:
        return  # Click reports it
    words = [*_words([values.get(param.name) for param in arguments]), *extra]
    n_extra = len(words) - len(arguments)
    takes_list = any(param.nargs < 0 for param in arguments)
    for output in outputs:
        if output.name not in values and (n_extra == 1 or (takes_list and n_extra > 1)):
            _refuse_argument(output, ctx, words)


def _refuse_argument(output: click.Parameter, ctx: click.Context, words: Sequence[str]) -> None:
    """Raise UsageError if the last of the arguments is probably the output.

    Parameters
    ----------
    output : Parameter
        Option of the output.
    words : sequence of str
        All arguments.
    """
    *inputs, last = words
    extension = _extension(last)
    is_new = not is_remote(last) and not Path(last).exists()
    differs = bool(inputs) and extension != _extension(inputs[-1])
    if output.required:
        is_output = is_new or differs
    else:
        expected = OUTPUT_EXTENSIONS[output.name or ""]
        # An existing folder may be another input.
        is_output = extension == expected and (is_new or (differs and expected != ""))
    if is_output:
        flag = min(output.opts, key=len)
        first_input = shlex.join(inputs[:1]) + (" ..." if len(inputs) > 1 else "")
        line = " ".join(filter(None, [ctx.command_path, first_input, flag, shlex.quote(last)]))
        raise click.UsageError(f"the output is given with {flag}: {line}", ctx)


def _refuse_option(arguments: Sequence[click.Argument], ctx: click.Context) -> None:
    """Raise UsageError if the output is one of the arguments."""
    names = [param.make_metavar(ctx) for param in arguments]
    if any(name.startswith("OUT") for name in names):
        line = " ".join([ctx.command_path, *names])
        raise click.UsageError(f"the output is an argument, not an option: {line}", ctx)


def _words(values: Sequence[object]) -> list[str]:
    """The words of arguments; the value of a missing argument is neither a string nor a tuple."""
    words: list[str] = []
    for value in values:
        if isinstance(value, str):
            words.append(value)
        elif isinstance(value, tuple):
            words.extend(value)
    return words


def _extension(word: str) -> str:
    return Path(without_query(word)).suffix.lower()
