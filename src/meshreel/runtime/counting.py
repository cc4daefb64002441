"""Text for counts, such as "1 frame" and "2 frames", for sizes in bytes, and for durations."""

PLURALS = {
    "vertex": "vertices", "mesh": "meshes", "entry": "entries", "frequency": "frequencies",
    "tetrahedron": "tetrahedra", "hexahedron": "hexahedra",
}  # fmt: skip
"""Irregular plurals."""

SIZE_UNITS = ("B", "kB", "MB", "GB", "TB", "PB", "EB")


def counted(number: int, noun: str) -> str:
    """The number and the noun, as in "1 vertex" and "12 vertices".

    Parameters
    ----------
    noun : str
        Singular; only the last word is inflected.
    """
    return f"{number} {plural(noun) if number != 1 else noun}"


def counts_text(**numbers: int) -> str:
    """Numbers by their nouns, as in "1 frame, 12 vertices"."""
    return ", ".join(counted(number, noun) for noun, number in numbers.items())


def singular(noun: str) -> str:
    """The singular of a plural noun."""
    first, space, last = noun.rpartition(" ")
    singulars = {many: single for single, many in PLURALS.items()}
    return f"{first}{space}{singulars.get(last, last.removesuffix('s'))}"


def plural(noun: str) -> str:
    """The plural of a noun."""
    first, space, last = noun.rpartition(" ")
    return f"{first}{space}{PLURALS.get(last, f'{last}s')}"


def size_text(size_bytes: float) -> str:
    """A size in a readable unit: 1234567 gives '1.23 MB'."""
    unit = 0
    while size_bytes >= 999.5 and unit < len(SIZE_UNITS) - 1:
        size_bytes /= 1000
        unit += 1
    return f"{size_bytes:.3g} {SIZE_UNITS[unit]}"


def change_text(before: float, after: float) -> str:
    """A change of a positive size: from 460 to 100 bytes gives '4.6 x smaller'."""
    if 0 < before < after:
        return f"{after / before:.1f} x larger"
    return f"{before / after:.1f} x smaller"


def duration_text(seconds: float) -> str:
    """A duration in seconds, minutes or hours: 150 gives '2 minutes'."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} minutes" if seconds < 7200 else f"{seconds / 3600:.0f} hours"
