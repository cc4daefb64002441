"""Lines of plain text on stdout and stderr, without characters that control a terminal."""

import re

import click

from meshreel.app.cli.option_names import in_option_names

_CONTROLS = re.compile(
    "[\x00-\x1f\x7f-\x9f"  # C0, DEL and C1
    "\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069"  # bidirectional
    "\u2028\u2029"  # line and paragraph separators
    "\ud800-\udfff]"  # lone surrogates, which no encoding takes
)
_LINE_BREAK = re.compile(r"\s*\n\s*")


def escaped(text: str) -> str:
    r"""Return the text with control characters as escapes, such as ``\n``, ``\x1b``, ``\u202e``.

    Names come from files that may be hostile: sequences of control characters recolor or clear a
    terminal, and a line break would begin a line that looks like output of this program.
    """
    return _CONTROLS.sub(lambda found: ascii(found[0])[1:-1], text)


def print_line(text: str) -> None:
    """Print one line on stdout."""
    click.echo(escaped(text))


def print_error(message: str) -> None:
    """Print an error on stderr as one line, in the words of the command line.

    Messages of other libraries may have several lines, which are joined.
    """
    line = _LINE_BREAK.sub(" ", in_option_names(message).strip())
    click.echo(f"meshreel: {escaped(line)}", err=True)
