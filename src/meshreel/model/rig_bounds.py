"""Limits of rigs and of their errors."""

from dataclasses import dataclass

from meshreel.errors import InvalidInputError

MAX_BONES = 256
"""Numbers of joints are bytes."""

DEFAULT_KG_PERCENT, DEFAULT_LARGEST_PERCENT = 0.5, 1.0


@dataclass(frozen=True)
class Bounds:
    """Largest allowed errors of a rig, in percent.

    Raises
    ------
    InvalidInputError
        If a bound is not above 0.
    """

    kg: float = DEFAULT_KG_PERCENT
    """KG error."""
    largest: float = DEFAULT_LARGEST_PERCENT
    """Largest error of a vertex, of the diagonal of the box of all frames."""

    def __post_init__(self) -> None:
        if not (self.kg > 0 and self.largest > 0):
            raise InvalidInputError(
                "the error bounds of a rig must be above 0 %; got a KG error of "
                f"{self.kg:g} % and a largest error of {self.largest:g} %"
            )

    def excess(self, kg: float, largest: float) -> float:
        """Return the factor by which an error exceeds its bound; up to 1 if none does."""
        return max(kg / self.kg, largest / self.largest)


DEFAULT_BOUNDS = Bounds()
