"""Rates and errors that a user may aim at: one target with its number."""

from dataclasses import dataclass
from enum import Enum

from meshreel.codec.error_bounds import ErrorBound, bound_of
from meshreel.errors import InvalidInputError

DEFAULT_QUALITY = 80.0


class Aim(Enum):
    """What is to be met; the value is what the user calls it."""

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


@dataclass(frozen=True)
class Target:
    """An aim with its number.

    Parameters
    ----------
    aim : Aim
    value : float
    is_length : bool, default False
        Of a largest error, whether it is in model units; else it is in percent of the diagonal.

    Raises
    ------
    InvalidInputError
        If the number is out of range.
    """

    aim: Aim
    value: float
    is_length: bool = False

    @property
    def bound(self) -> ErrorBound:
        """What a largest error allows."""
        return ErrorBound(self.value, self.is_length)

    def __post_init__(self) -> None:
        if self.aim is Aim.QUALITY and not 1 <= self.value <= 100:
            raise InvalidInputError(f"quality must be in 1..100; got {self.value}")
        if self.aim is Aim.STEP and not 0 < self.value <= 1:
            raise InvalidInputError(
                f"step is in diagonals of the bounding box, above 0 and up to 1; got {self.value}"
            )
        if not 0 < self.value < float("inf"):
            raise InvalidInputError(f"{self.aim.value} must be above 0; got {self.value}")


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
