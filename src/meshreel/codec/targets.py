"""Rates and errors that a user may aim at: one target with its number."""

from dataclasses import dataclass
from enum import Enum
from functools import lru_cache

from meshreel.codec.error_bounds import ErrorBound, bound_of
from meshreel.codec.option import Range
from meshreel.errors import InvalidInputError

DEFAULT_QUALITY = 80.0


class Aim(Enum):
    """Kinds of targets; the value is the name of the option."""

    QUALITY = "quality"
    STEP = "step"
    MAX_ERROR = "max_error"
    KG = "kg"
    STED = "sted"
    BPVF = "bpvf"
    SIZE = "size"

    @property
    def is_budget(self) -> bool:
        """Whether it limits the bytes; else it limits an error, or sets a step."""
        return self in (Aim.BPVF, Aim.SIZE)


GROUP = "What to meet (give one)"
ABOVE_ZERO = Range(0, is_open=True)
QUALITIES = Range(1, 100)
DIAGONAL_OF_ALL = "of the diagonal of the bounding box of all frames"


@dataclass(frozen=True)
class Target:
    """An aim with its number, which is in the range of its option.

    Parameters
    ----------
    aim : Aim
    value : float
    is_length : bool, default False
        Of a largest error, whether it is in model units; else it is in percent of the diagonal.
    """

    aim: Aim
    value: float
    is_length: bool = False

    @property
    def bound(self) -> ErrorBound:
        """The bound of a largest error."""
        return ErrorBound(self.value, self.is_length)


@lru_cache(16)
def target_of(**numbers: float | str | None) -> Target:
    """The one aim that has a number; the default quality where none has.

    A largest error may be text that `bound_of` reads.

    Raises
    ------
    InvalidInputError
        If several have one.
    """
    given = {name: value for name, value in numbers.items() if value is not None}
    if len(given) > 1:
        names = " and ".join(f"{name}=" for name in given)
        raise InvalidInputError(f"{names} exclude each other; give one")
    for name, value in given.items():
        if Aim(name) is Aim.MAX_ERROR:
            bound = bound_of(value)
            return Target(Aim.MAX_ERROR, bound.amount, bound.is_length)
        return Target(Aim(name), float(value))
    return Target(Aim.QUALITY, DEFAULT_QUALITY)
