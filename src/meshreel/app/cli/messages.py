"""Messages of the library as the command line prints them.

Options replace keywords of Python, and control characters are escaped.
"""

import re
from collections.abc import Iterable
from functools import cache

import click

RENAMED = {"overwrite": "--force", "n_frames": "--frames", "n_samples": "--samples"}
"""Keywords with options of other names, in addition to those of encoding."""

_BOTH = re.compile(r"(--[a-z][a-z-]*(?: [^\s()]+)?) \(\w+=\w*\)")
_CHOICE = re.compile(r"(?<![\w./'\"-])([a-z]\w*)=\"(\w+)\"")
_KEYWORD = re.compile(r"(?<![\w./'\"-])([a-z]\w*)=(?:True|False)?(?=[\s),;:.]|$)")

_CONTROLS = re.compile(
    "[\x00-\x1f\x7f-\x9f"  # C0, DEL and C1
    "\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069"  # bidirectional
    "\u2028\u2029"  # line and paragraph separators
    "\ud800-\udfff]"  # lone surrogates, which cannot be encoded
)
_LINE_BREAK = re.compile(r"\s*\n\s*")


def with_option_names(message: str) -> str:
    """The message with option names instead of keywords.

    "--force (overwrite=True)" and "overwrite=True" become "--force", "object=" becomes
    "--object", 'order="drop"' becomes "--order drop", and "max_error" "--max-error".
    """
    message = _BOTH.sub(r"\1", message)
    message = _CHOICE.sub(lambda match: f"{flag_of(match[1])} {match[2]}", message)
    message = _KEYWORD.sub(lambda match: flag_of(match[1]), message)
    return _names().sub(lambda match: flag_of(match[1]), message)


def all_with_option_names(notes: Iterable[str]) -> list[str]:
    """Notes with option names instead of keywords, without duplicates."""
    return list(dict.fromkeys(map(with_option_names, notes)))


def flag_of(keyword: str) -> str:
    """The option of a keyword."""
    return _flags().get(keyword, f"--{keyword.replace('_', '-')}")


@cache
def _flags() -> dict[str, str]:
    """Options by keyword: those of encoding, and `RENAMED`."""
    from meshreel.codec.options import all_options

    return {**RENAMED, **{option.name: option.flag for option in all_options()}}


@cache
def _names() -> re.Pattern[str]:
    """Pattern of keywords that are not English words, such as "n_modes"."""
    keywords = "|".join(name for name in _flags() if "_" in name)
    return re.compile(rf"(?<![\w./'\"=-])({keywords})(?![\w./'\"=-])")


def escaped(text: str) -> str:
    r"""Return the text with control characters escaped as ``\n``, ``\x1b``, ``\u202e`` etc.

    Names in hostile files could recolor or clear the terminal, or imitate lines of this program.
    """
    return _CONTROLS.sub(lambda match: ascii(match[0])[1:-1], text)


def print_line(text: str) -> None:
    """Print one line on stdout."""
    click.echo(escaped(text))


def print_error(message: str) -> None:
    """Print an error on stderr as one line, with option names instead of keywords."""
    line = _LINE_BREAK.sub(" ", with_option_names(message).strip())
    click.echo(f"meshreel: {escaped(line)}", err=True)
