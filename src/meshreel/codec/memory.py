"""Sizes in bytes as users write them, and the limit of the memory that decoding may take at once.

A few bytes of a stream may announce any number of values. What they announce is compared with the
limit before anything is allocated for it.
"""

import re
from dataclasses import dataclass

from meshreel.errors import InvalidInputError, MemoryLimitError
from meshreel.runtime.counting import size_text

DEFAULT_MEMORY = "8GiB"
"""The limit where none is given; the same on every machine, so that a stream is too."""

BYTES_OF_VERTEX, BYTES_OF_FACE = 512, 128
"""Of a mesh while it is decoded: connectivity, order and the hierarchy of its vertices."""


UNITS = {"": 1, "B": 1}
UNITS |= {f"{prefix}B": 1000**power for power, prefix in enumerate("kMGT", start=1)}
UNITS |= {f"{prefix}iB": 1024**power for power, prefix in enumerate("KMGT", start=1)}
"""Bytes of each unit; units are not case-sensitive."""

_SIZE = re.compile(r"((?:\d+\.?\d*|\.\d+)(?:e\+?\d{1,3})?)\s*([a-zA-Z]*)")


def bytes_of(given: float | str, name: str) -> float:
    """Return the number of bytes of a size that a user wrote.

    Parameters
    ----------
    given : float, or str
        A number of bytes, or text such as "100kB", "1 MiB" or "1e6".
    name : str
        Name of the option, for error messages.

    Raises
    ------
    InvalidInputError
        If it is not a size, or not above 0.
    """
    if not isinstance(given, str):
        return _checked(given, given, name)
    found = _SIZE.fullmatch(given.strip())
    factors = {unit.lower(): factor for unit, factor in UNITS.items()}
    if not found or found[2].lower() not in factors:
        raise InvalidInputError(
            f"{name}= takes a size such as 100kB or 1GiB, or a number of bytes; got {given!r}"
        )
    return _checked(float(found[1]) * factors[found[2].lower()], given, name)


def _checked(size_bytes: float, given: float | str, name: str) -> float:
    if not 0 < size_bytes < float("inf"):
        raise InvalidInputError(f"{name} must be above 0; got {given}")
    return size_bytes


@dataclass(frozen=True)
class MemoryLimit:
    """The largest size of what is decoded at once."""

    limit_bytes: float

    def require(self, needed_bytes: int, what: str) -> None:
        """Raise if something is larger than allowed.

        Parameters
        ----------
        what : str
            Begins the error message, such as "frames 0:12 of 300 vertices".

        Raises
        ------
        MemoryLimitError
            If it is; names both sizes, and how to raise the limit.
        """
        if needed_bytes > self.limit_bytes:
            raise MemoryLimitError(
                f"{what} would take {size_text(needed_bytes)} of memory; decoding may take "
                f"{size_text(self.limit_bytes)}; if you trust the stream, allow more with memory="
            )

    def require_mesh(self, n_verts: int, n_faces: int) -> None:
        """Raise as `require` if decoding a mesh of this size takes more than allowed."""
        needed = BYTES_OF_VERTEX * n_verts + BYTES_OF_FACE * n_faces
        self.require(needed, f"a mesh of {n_verts} vertices and {n_faces} faces")


def memory_limit(memory: float | str | None) -> MemoryLimit:
    """The limit of a size such as "2GiB" or a number of bytes; None is `DEFAULT_MEMORY`.

    Raises
    ------
    InvalidInputError
        If it is no size, or not above 0.
    """
    return DEFAULT_LIMIT if memory is None else MemoryLimit(bytes_of(memory, "memory"))


DEFAULT_LIMIT = memory_limit(DEFAULT_MEMORY)

OWN_STREAM = 2.0**62
"""The limit of a stream that this process has encoded: none."""

UNLIMITED = MemoryLimit(OWN_STREAM)
