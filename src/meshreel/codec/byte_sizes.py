"""Sizes in bytes as users write them: 100000, 100kB, 1MiB."""

import re

from meshreel.errors import InvalidInputError

UNITS = {"": 1, "B": 1}
UNITS |= {f"{prefix}B": 1000**power for power, prefix in enumerate("kMGT", start=1)}
UNITS |= {f"{prefix}iB": 1024**power for power, prefix in enumerate("KMGT", start=1)}
"""Bytes of each unit; units are not case-sensitive."""

_SIZE = re.compile(r"((?:\d+\.?\d*|\.\d+)(?:e\+?\d{1,3})?)\s*([a-zA-Z]*)")


def bytes_of(given: float | str, name: str) -> float:
    """The number of bytes of a size.

    Parameters
    ----------
    given : float, or str
        A number of bytes, or text such as "100kB", "1 MiB" or "1e6".
    name : str
        Name of the option, for error messages.

    Raises
    ------
    InvalidInputError
        If it is no size, or not above 0.
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
