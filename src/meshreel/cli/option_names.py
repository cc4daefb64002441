"""Messages of the library, which name its keywords, in the words of the command line."""

import re
from collections.abc import Iterable

RENAMED = {
    "overwrite": "force",
    "n_modes": "modes",
    "n_frames": "frames",
    "n_iterations": "iterations",
}
"""Keywords whose options are not called the same."""

_BOTH = re.compile(r"(--[a-z][a-z-]*(?: [^\s()]+)?) \(\w+=\w*\)")
_CHOICE = re.compile(r"(?<![\w./'\"-])([a-z]\w*)=\"(\w+)\"")
_KEYWORD = re.compile(r"(?<![\w./'\"-])([a-z]\w*)=(?:True|False)?(?=[\s),;:.]|$)")
_NAME = re.compile(
    r"(?<![\w./'\"=-])(n_modes|n_frames|n_iterations|max_error|block_frames)(?![\w./'\"=-])"
)


def in_option_names(message: str) -> str:
    """The message with options in place of keywords.

    "--force (overwrite=True)" and "overwrite=True" become "--force", "object=" becomes
    "--object", 'order="drop"' becomes "--order drop", and "max_error" "--max-error".
    """
    message = _BOTH.sub(r"\1", message)
    message = _CHOICE.sub(lambda found: f"{_option(found[1])} {found[2]}", message)
    message = _KEYWORD.sub(lambda found: _option(found[1]), message)
    return _NAME.sub(lambda found: _option(found[1]), message)


def all_in_option_names(notes: Iterable[str]) -> list[str]:
    """Notes in the words of the command line, each only once."""
    return list(dict.fromkeys(map(in_option_names, notes)))


def _option(keyword: str) -> str:
    return f"--{RENAMED.get(keyword, keyword).replace('_', '-')}"
