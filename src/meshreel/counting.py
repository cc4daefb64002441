"""Things and their number in words: "1 frame", "2 frames"."""

PLURALS = {"vertex": "vertices", "mesh": "meshes", "entry": "entries"}
"""Of nouns that do not just gain an s."""


def counted(number: int, noun: str) -> str:
    """How many of what, as in "1 vertex" and "12 vertices".

    Parameters
    ----------
    number : int
    noun : str
        In the singular; of several words the last is the one that changes.
    """
    return f"{number} {plural(noun) if number != 1 else noun}"


def singular(noun: str) -> str:
    """The noun of a plural that `plural` gives."""
    first, space, last = noun.rpartition(" ")
    known = {many: one for one, many in PLURALS.items()}
    return f"{first}{space}{known.get(last, last.removesuffix('s'))}"


def plural(noun: str) -> str:
    """The noun in the plural."""
    first, space, last = noun.rpartition(" ")
    return f"{first}{space}{PLURALS.get(last, f'{last}s')}"
