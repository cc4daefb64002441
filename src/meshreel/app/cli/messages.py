"""Messages of the library as the command line prints them.

Options replace keywords of Python, and control characters are escaped.
"""

import re
from functools import cache

import click

from meshreel.errors import Keyword, Message

RENAMED = {
    "n_frames": "--frames",
    "n_samples": "--samples",
    "overwrite": "--force",
    "tracks": "--track",
}
"""Keywords with options of other names, in addition to those of encoding."""

_CONTROLS = re.compile(
    "[\x00-\x1f\x7f-\x9f"  # C0, DEL and C1
    "\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069"  # bidirectional
    "\u2028\u2029"  # line and paragraph separators
    "\ud800-\udfff]"  # lone surrogates, which cannot be encoded
)
_LINE_BREAK = re.compile(r"\s*\n\s*")


def with_options(text: str) -> str:
    """The text with options in place of the keywords of a message."""
    return text.naming(option_text) if isinstance(text, Message) else text


def option_text(keyword: Keyword) -> str:
    """The option of a keyword, with its value."""
    flag = flag_of(keyword.name)
    return flag if keyword.value in (None, True) else f"{flag} {keyword.value}"


def flag_of(name: str) -> str:
    """The option of a keyword's name."""
    return _flags().get(name, f"--{name.replace('_', '-')}")


@cache
def _flags() -> dict[str, str]:
    """Options by keyword: those of encoding, and `RENAMED`."""
    from meshreel.codec.options import all_options

    return {**RENAMED, **{option.name: option.flag for option in all_options()}}


def escaped(text: str) -> str:
    r"""Return the text with control characters escaped as ``\n``, ``\x1b``, ``\u202e`` etc.

    Names in hostile files could recolor or clear the terminal, or imitate lines of this program.
    """
    return _CONTROLS.sub(lambda match: ascii(match[0])[1:-1], text)


def print_line(text: str) -> None:
    """Print one line on stdout."""
    click.echo(escaped(text))


def print_error(message: str) -> None:
    """Print an error on stderr as one line, with options instead of keywords."""
    line = _LINE_BREAK.sub(" ", with_options(message).strip())
    click.echo(f"meshreel: {escaped(line)}", err=True)
