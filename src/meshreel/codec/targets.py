"""Targets of encoding: a rate, an error or a step, with its value."""

from dataclasses import dataclass
from enum import Enum
from functools import lru_cache

from meshreel.codec.error_bounds import ErrorBound, bound_of
from meshreel.codec.option import Range
from meshreel.errors import InvalidInputError, Keyword

DEFAULT_QUALITY, POINTS_PER_HALVING = 80.0, 12.0


class TargetKind(Enum):
    """Kinds of targets; the value is the name of the option."""

    QUALITY = "quality"
    STEP = "step"
    MAX_ERROR = "max_error"
    KG = "kg"
    SIZE = "size"


GROUP = "Target (give one)"
ABOVE_ZERO = Range(0, is_open=True)
QUALITIES = Range(1, 100)
DIAGONAL_OF_ALL = "of the diagonal of the bounding box of all frames"


def error_scale(quality: float) -> float:
    """Return the errors of a quality in 1..100 relative to those of the default quality."""
    return float(2.0 ** ((DEFAULT_QUALITY - quality) / POINTS_PER_HALVING))


@dataclass(frozen=True)
class Target:
    """A kind of target with its value, which is in the range of its option."""

    kind: TargetKind
    value: float
    is_length: bool = False
    """Whether a largest error is in model units, and not in percent of the diagonal."""

    @property
    def bound(self) -> ErrorBound:
        """The value as an error bound."""
        return ErrorBound(self.value, self.is_length)


@lru_cache(16)
def target_of(**numbers: float | str | None) -> Target:
    """Return the only target that has a value, or the default quality.

    A largest error may be text that `bound_of` parses.

    Raises
    ------
    InvalidInputError
        If several targets have a value.
    """
    requested = {name: value for name, value in numbers.items() if value is not None}
    if len(requested) > 1:
        first, second, *_ = map(Keyword, requested)
        raise InvalidInputError(first, " and ", second, " exclude each other; give one")
    for name, value in requested.items():
        if TargetKind(name) is TargetKind.MAX_ERROR:
            bound = bound_of(value)
            return Target(TargetKind.MAX_ERROR, bound.amount, bound.is_length)
        return Target(TargetKind(name), float(value))
    return Target(TargetKind.QUALITY, DEFAULT_QUALITY)
