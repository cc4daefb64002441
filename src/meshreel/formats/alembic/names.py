"""Valid and unique names for the objects and properties of an Alembic file."""

from collections.abc import Iterable

UNNAMED = "mesh"

IN_NAMES, IN_METADATA, IN_TEXTS = "/\0", ";=\0", "\0"
"""Reserved characters of path components, of metadata, and of strings.

The Alembic library aborts the process if the name of texture coordinates contains a reserved
character of metadata.
"""


def clean(text: str, reserved: str) -> str:
    """Return the text with ``_`` in place of reserved characters and lone surrogates."""
    return "".join("_" if one in reserved or "\ud800" <= one <= "\udfff" else one for one in text)


def clean_unique_name(name: str, used: Iterable[str]) -> str:
    """Return the name without slashes, with a number appended if it is in use."""
    return unique_name(clean(name, IN_NAMES) or UNNAMED, used)


def unique_name(name: str, used: Iterable[str]) -> str:
    """Return the name, with a number appended if it is in use."""
    unique, number = name, 1
    while unique in used:
        number += 1
        unique = f"{name}_{number}"
    return unique
