"""Parsing of sizes in bytes, and the memory limit of decoding.

A few bytes of a stream may announce any number of values, so announced sizes are checked against
the limit before memory is allocated.
"""

import re
from dataclasses import dataclass

from meshreel.errors import InvalidInputError, Keyword, MemoryLimitError
from meshreel.runtime.counting import size_text

DEFAULT_MEMORY = "2GiB"
"""Default limit; the same on every machine, so that a stream decodes everywhere or nowhere."""


UNITS = {"": 1, "B": 1}
UNITS |= {f"{prefix}B": 1000**power for power, prefix in enumerate("kMGT", start=1)}
UNITS |= {prefix: 1000**power for power, prefix in enumerate("kMGT", start=1)}
UNITS |= {f"{prefix}iB": 1024**power for power, prefix in enumerate("KMGT", start=1)}
"""Bytes of each unit; units are not case-sensitive."""

_SIZE = re.compile(r"((?:\d+\.?\d*|\.\d+)(?:e\+?\d{1,3})?)\s*([a-zA-Z]*)")


def bytes_of(size: float | str, name: str) -> float:
    """Parse a size.

    Parameters
    ----------
    size : float, or str
        A number of bytes, or text such as "100kB", "1 MiB" or "1e6".
    name : str
        Name of the option, for error messages.

    Raises
    ------
    InvalidInputError
        If it is not a size, or not above 0.
    """
    if isinstance(size, str):
        match = _SIZE.fullmatch(size.strip())
        factors = {unit.lower(): factor for unit, factor in UNITS.items()}
        if not match or match[2].lower() not in factors:
            raise InvalidInputError(
                Keyword(name),
                f" takes a size such as 100kB or 1GiB, or a number of bytes; got {size!r}",
            )
        size_bytes = float(match[1]) * factors[match[2].lower()]
    else:
        size_bytes = size
    if not 0 < size_bytes < float("inf"):
        raise InvalidInputError(Keyword(name), f" must be above 0; got {size}")
    return size_bytes


@dataclass(frozen=True)
class MemoryLimit:
    """Memory that decoding may take at a time."""

    limit_bytes: float

    def require(self, needed_bytes: int, subject: str) -> None:
        """Raise MemoryLimitError if more memory is needed than allowed.

        `subject` begins the message, as in "frames 0:12 of 300 vertices".
        """
        if needed_bytes > self.limit_bytes:
            raise MemoryLimitError(
                f"{subject} would take {size_text(needed_bytes)} of memory; decoding may take "
                f"{size_text(self.limit_bytes)}; if you trust the stream, allow more with ",
                Keyword("memory"),
            )


def memory_limit(memory: float | str | None) -> MemoryLimit:
    """Parse a limit such as "2GiB" or a number of bytes; None means `DEFAULT_MEMORY`.

    Raises
    ------
    InvalidInputError
        If it is not a size, or not above 0.
    """
    return DEFAULT_LIMIT if memory is None else MemoryLimit(bytes_of(memory, "memory"))


DEFAULT_LIMIT = memory_limit(DEFAULT_MEMORY)

OWN_STREAM = 2.0**62
"""Limit for streams that this process has encoded: in effect, none."""

UNLIMITED = MemoryLimit(OWN_STREAM)
