"""Numbers with nouns in singular or plural, "1 frame", "2 frames", and sizes in bytes."""

PLURALS = {"vertex": "vertices", "mesh": "meshes", "entry": "entries"}
"""Plurals of nouns that do not just take an s."""

SIZE_UNITS = ("B", "kB", "MB", "GB", "TB", "PB", "EB")


def counted(number: int, noun: str) -> str:
    """The number and the noun, as in "1 vertex" and "12 vertices".

    Parameters
    ----------
    noun : str
        In the singular; of several words the last one is inflected.
    """
    return f"{number} {plural(noun) if number != 1 else noun}"


def singular(noun: str) -> str:
    """The singular of a noun that `plural` returned."""
    first, space, last = noun.rpartition(" ")
    known = {many: one for one, many in PLURALS.items()}
    return f"{first}{space}{known.get(last, last.removesuffix('s'))}"


def plural(noun: str) -> str:
    """The noun in the plural."""
    first, space, last = noun.rpartition(" ")
    return f"{first}{space}{PLURALS.get(last, f'{last}s')}"


def size_text(size_bytes: float) -> str:
    """A size in a readable unit: 1234567 gives '1.23 MB'."""
    unit = 0
    while size_bytes >= 999.5 and unit < len(SIZE_UNITS) - 1:
        size_bytes /= 1000
        unit += 1
    return f"{size_bytes:.3g} {SIZE_UNITS[unit]}"
