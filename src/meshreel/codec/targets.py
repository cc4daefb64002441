"""Rates and errors that a user may aim at: one target with its number."""

from dataclasses import dataclass
from enum import Enum

from meshreel.codec.error_bounds import METRES, ErrorBound, bound_of
from meshreel.codec.option import Option, Range
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

LOSSLESS = Option(
    "lossless",
    bool,
    "Every number comes back bit for bit: positions and tracks. The order of vertices and faces "
    "stays as well, unless order= says otherwise.",
    default=False,
    group=GROUP,
    more='The same as method="lossless". `tracks` may still name bounds, or drop tracks.',
)
MAX_ERROR = Option(
    Aim.MAX_ERROR.value,
    float | str,
    "No vertex of any frame farther from the original than this. Promised. 0.1 or 0.1%: "
    f"percent {DIAGONAL_OF_ALL}; 0.5u: model units; 0.5mm: a length, see unit=.",
    range=ABOVE_ZERO,
    unit="in percent",
    group=GROUP,
    metavar="BOUND",
)
UNIT = Option(
    "unit",
    str,
    "How long one unit of the model is, for a max_error= that is a length.",
    names=tuple(METRES),
    group=GROUP,
    metavar="|".join(METRES),
)
TARGET_OPTIONS = (
    Option(
        Aim.QUALITY.value,
        float,
        f"{QUALITIES.words}; every 12 points halve the error, which is relative to the model's "
        "size, the diagonal of a frame's bounding box, the mean of all frames, and smaller on "
        "smooth surfaces.",
        default_text=f"{DEFAULT_QUALITY:g}, if nothing else is asked for",
        range=QUALITIES,
        group=GROUP,
    ),
    MAX_ERROR,
    UNIT,
    Option(
        Aim.KG.value,
        float,
        "Smallest file of at most this KG error, a share of the shape's extent.",
        range=ABOVE_ZERO,
        unit="in percent",
        group=GROUP,
        metavar="PERCENT",
        more="In percent.",
    ),
    Option(
        Aim.STED.value,
        float,
        "Smallest file of at most this STED.",
        range=ABOVE_ZERO,
        group=GROUP,
    ),
    Option(
        Aim.BPVF.value,
        float,
        "Best quality within so many bits for each vertex and frame.",
        range=ABOVE_ZERO,
        unit="in bits per vertex and frame",
        group=GROUP,
        more="The whole stream counts.",
    ),
    Option(
        Aim.SIZE.value,
        float | str,
        "Best quality within this size, as in 100kB, 1MiB or 100000 (bytes).",
        range=ABOVE_ZERO,
        unit="in bytes",
        group=GROUP,
        metavar="SIZE",
    ),
    Option(
        Aim.STEP.value,
        float,
        "Step of rounding as it acts on a position, in diagonals of the bounding box of all "
        "frames.",
        range=Range(0, 1, is_open=True),
        unit="in diagonals of the bounding box",
        group=GROUP,
    ),
)
"""The options that say what is to be met."""


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
