"""Numbers with nouns in singular or plural: "1 frame", "2 frames"."""

PLURALS = {"vertex": "vertices", "mesh": "meshes", "entry": "entries"}
"""Plurals of nouns that do not just take an s."""


def counted(number: int, noun: str) -> str:
    """The number and the noun, as in "1 vertex" and "12 vertices".

    Parameters
    ----------
    number : int
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
