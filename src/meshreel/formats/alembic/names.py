"""Names and texts as Alembic files hold them."""

from collections.abc import Iterable

UNNAMED = "mesh"

IN_NAMES, IN_METADATA, IN_TEXTS = "/\0", ";=\0", "\0"
"""Characters that separate names in a path, separate entries of metadata, and end a text.

The library ends the process where one of metadata is in the name of texture coordinates.
"""


def clean(text: str, separators: str) -> str:
    """The text with ``_`` in place of separators and of halves of characters (surrogates)."""
    return "".join("_" if one in separators or "\ud800" <= one <= "\udfff" else one for one in text)


def unused_name(name: str, taken: Iterable[str]) -> str:
    """The name without slashes, and with a number behind it if another has it."""
    return numbered(clean(name, IN_NAMES) or UNNAMED, taken)


def numbered(name: str, taken: Iterable[str]) -> str:
    """The name, with a number behind it if it is taken."""
    found, number = name, 1
    while found in taken:
        number += 1
        found = f"{name}_{number}"
    return found
