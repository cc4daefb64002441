"""What a reader leaves out of a file, said once and in the same words by every reader."""

from collections.abc import Iterable, Sequence

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


def note_moving(notes: list[str], names: Iterable[str]) -> None:
    """Add to the notes that fields are left out because they change over time."""
    if found := list(dict.fromkeys(names)):
        note_left_out(notes, f"fields that change over time: {listed(found)}")


def note_frozen(notes: list[str], names: Iterable[str]) -> None:
    """Add to the notes that attributes stay as they are in the first frame."""
    if found := list(dict.fromkeys(names)):
        note_left_out(notes, f"changes over time of {listed(found)}, kept as in the first frame")


def note_kinds(notes: list[str], kind: str, names: Iterable[str]) -> None:
    """Add to the notes that things of a kind are left out: "curves: /a, /b"; nothing for none."""
    if found := list(dict.fromkeys(names)):
        note_left_out(notes, f"{kind}: {listed(found)}")


def note_normals(notes: list[str]) -> None:
    """Add to the notes that stored normals are left out."""
    note_left_out(notes, "normals, which programs compute")


def describe_cages(names: Sequence[str]) -> str:
    """The sentence on subdivision surfaces, of which the cage is read: for a `GatheredNote`."""
    cages = "whose cage is read" if len(names) == 1 else "whose cages are read"
    return f"{LEFT_OUT}subdivision of {listed(names)}, {cages}"
