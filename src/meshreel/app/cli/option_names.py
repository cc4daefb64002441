"""Messages of the library, which name its keywords, in the words of the command line."""

import re
from collections.abc import Iterable
from functools import cache

RENAMED = {"overwrite": "--force", "n_frames": "--frames"}
"""Keywords whose options are not called the same, beside those of encoding."""

_BOTH = re.compile(r"(--[a-z][a-z-]*(?: [^\s()]+)?) \(\w+=\w*\)")
_CHOICE = re.compile(r"(?<![\w./'\"-])([a-z]\w*)=\"(\w+)\"")
_KEYWORD = re.compile(r"(?<![\w./'\"-])([a-z]\w*)=(?:True|False)?(?=[\s),;:.]|$)")


def in_option_names(message: str) -> str:
    """The message with options in place of keywords.

    "--force (overwrite=True)" and "overwrite=True" become "--force", "object=" becomes
    "--object", 'order="drop"' becomes "--order drop", and "max_error" "--max-error".
    """
    message = _BOTH.sub(r"\1", message)
    message = _CHOICE.sub(lambda found: f"{flag_of(found[1])} {found[2]}", message)
    message = _KEYWORD.sub(lambda found: flag_of(found[1]), message)
    return _names().sub(lambda found: flag_of(found[1]), message)


def all_in_option_names(notes: Iterable[str]) -> list[str]:
    """Notes in the words of the command line, each only once."""
    return list(dict.fromkeys(map(in_option_names, notes)))


def flag_of(keyword: str) -> str:
    """The option of a keyword."""
    return _flags().get(keyword, f"--{keyword.replace('_', '-')}")


@cache
def _flags() -> dict[str, str]:
    """The options of encoding by their keywords, and `RENAMED`."""
    from meshreel.codec.config import all_options

    return {**RENAMED, **{option.name: option.flag for option in all_options()}}


@cache
def _names() -> re.Pattern[str]:
    """A pattern of keywords that cannot be English words, such as "n_modes"."""
    keywords = "|".join(name for name in _flags() if "_" in name)
    return re.compile(rf"(?<![\w./'\"=-])({keywords})(?![\w./'\"=-])")
