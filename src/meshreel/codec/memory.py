"""How much memory decoding may take at once: a limit that the caller sets.

A few bytes of a stream may announce any number of values. What they announce is compared with the
limit before anything is allocated for it.
"""

from dataclasses import dataclass

from meshreel.codec.byte_sizes import bytes_of
from meshreel.errors import MemoryLimitError
from meshreel.runtime.counting import size_text

DEFAULT_MEMORY = "8GiB"
"""The limit where none is given; the same on every machine, so that a stream is too."""

BYTES_OF_VERTEX, BYTES_OF_FACE = 512, 128
"""Of a mesh while it is decoded: connectivity, order and the hierarchy of its vertices."""


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
