"""Limits of rigs and of their errors."""

from dataclasses import dataclass

from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.errors import InvalidInputError, Keyword
from meshreel.metrics.position_errors import position_errors
from meshreel.model.sequence import MeshSequence

MAX_BONES = 256
"""Numbers of joints are bytes."""

DEFAULT_KG_PERCENT, DEFAULT_LARGEST_PERCENT = 0.5, 1.0


@dataclass(frozen=True)
class Bounds:
    """What the errors of a rig must not exceed, in percent.

    Attributes
    ----------
    kg : float
        KG error.
    largest : float
        Largest error of a vertex, of the diagonal of the box of all frames.

    Raises
    ------
    InvalidInputError
        If a bound is not above 0.
    """

    kg: float = DEFAULT_KG_PERCENT
    largest: float = DEFAULT_LARGEST_PERCENT

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


def bounds_of(
    sequence: MeshSequence, *, quality: float | None, kg: float | None, largest: float | None
) -> Bounds:
    """Return the given bounds, or those of a quality: the position errors of a .reel.

    Parameters
    ----------
    quality : float, optional
        Quality of the .reel, 1 to 100; excludes the bounds.
    kg, largest : float, optional
        As `Bounds`, with its defaults.

    Raises
    ------
    InvalidInputError
        If a value is out of range, or a quality and a bound are given.
    """
    if quality is None:
        kg = DEFAULT_KG_PERCENT if kg is None else kg
        return Bounds(kg, DEFAULT_LARGEST_PERCENT if largest is None else largest)
    for name, bound in (("kg", kg), ("max_error", largest)):
        if bound is not None:
            raise InvalidInputError(
                Keyword("quality"), " of a rig sets its error bounds; omit it, or ", Keyword(name)
            )
    stream = encode(sequence, quality=quality, order="keep", attributes="none")
    errors = position_errors(sequence.vertices, decode(stream).vertices)
    return Bounds(max(errors.kg_error_percent, 1e-6), max(errors.max_error_percent, 1e-6))
