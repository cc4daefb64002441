"""What a reader leaves out of a file, said once and in the same words by every reader."""

from collections.abc import Iterable

LEFT_OUT = "left out: "
"""How a note begins that names something of the input that is in no output."""


def note_left_out(notes: list[str], what: str) -> None:
    """Add to the notes that something is left out, unless they say so already.

    Parameters
    ----------
    notes : list of str
    what : str
        The thing, and which, as in "fields that change over time: pressure, velocity".
    """
    note = f"{LEFT_OUT}{what}"
    if note not in notes:
        notes.append(note)


def listed(names: Iterable[str], most: int = 8) -> str:
    """The names in one line, the first of them if there are many: "a, b and 3 more"."""
    found = list(names)
    rest = f" and {len(found) - most} more" if len(found) > most else ""
    return ", ".join(found[:most]) + rest
