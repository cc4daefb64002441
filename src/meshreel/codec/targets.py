"""What the user asks of `reel`: one aim, and how it is pursued."""

import math
from dataclasses import dataclass
from enum import Enum

from meshreel.codec.error_bounds import ErrorBound, bound_of
from meshreel.errors import InvalidInputError
from meshreel.reel.encoding.analysis import FieldChoices

DEFAULT_QUALITY = 80.0
DEFAULT_EFFORT = 5

FINEST_STEP = 1e-4
"""Step of quality 100, in diagonals of the model's own bounding box, the mean of all frames."""

POINTS_PER_HALVING = 12.0

STEPS_OF_BOUND = 14.0
"""Where the search for a largest error begins: rarer errors than this are cheaply corrected."""

LARGEST_INTEGER = 2.0**29
"""Values in steps stay below this, with room for what is beyond a prediction."""


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


def quality_step(quality: float) -> float:
    """Step of a quality in 1..100, in diagonals of the model's own bounding box."""
    return float(FINEST_STEP * 2.0 ** ((100.0 - quality) / POINTS_PER_HALVING))


@dataclass(frozen=True)
class Effort:
    """What an effort switches on; the decoder's time grows with it too.

    Attributes
    ----------
    group_ends : tuple of int
        Modes after which weights are learned anew.
    stencil_size : int
        Vertices that foretell one.
    later_group_ends : tuple of int
        The same of blocks that refer to a key block.
    has_filters : bool
        Smooth decoded fields.
    """

    group_ends: tuple[int, ...]
    stencil_size: int
    later_group_ends: tuple[int, ...]
    has_filters: bool = False


class Tune(Enum):
    """What the bits are spent on."""

    VISUAL = "visual"
    GEOMETRY = "geometry"


def tune_named(name: str | None, target: Target) -> Tune:
    """The tune of this name; the one that serves the target where none is given.

    Raises
    ------
    InvalidInputError
        If there is none of this name.
    """
    if name is None:
        serves_geometry = target.aim in (Aim.MAX_ERROR, Aim.KG)
        return Tune.GEOMETRY if serves_geometry else Tune.VISUAL
    for tune in Tune:
        if tune.value == name:
            return tune
    raise InvalidInputError(
        f"tune {name!r} is unknown; choose {', '.join(tune.value for tune in Tune)}"
    )


EFFORTS = {
    1: Effort((4,), 6, ()),
    2: Effort((2, 6), 6, ()),
    3: Effort((2, 6), 8, (4,)),
    4: Effort((1, 2, 4, 10), 8, (4,)),
    5: Effort((1, 2, 3, 4, 6, 10), 10, (4,)),
    6: Effort((1, 2, 3, 4, 6, 10), 10, (1, 4, 10), has_filters=True),
    7: Effort((1, 2, 3, 4, 6, 10, 16), 12, (1, 4, 10), has_filters=True),
    8: Effort((1, 2, 3, 4, 5, 6, 8, 10, 14, 20), 14, (1, 2, 4, 6, 10, 16), has_filters=True),
    9: Effort(
        (1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 17, 20, 25),
        16,
        (1, 2, 3, 4, 6, 8, 10, 12, 14, 17, 20, 25),
        has_filters=True,
    ),
}


def choices_for(effort: int, tune: Tune, n_modes: int | None) -> FieldChoices:
    """What an effort and a tune mean for the encoder, at some step.

    Raises
    ------
    InvalidInputError
        If the effort is not 1..9.
    """
    if not isinstance(effort, int | float) or effort not in EFFORTS:
        raise InvalidInputError(f"effort must be 1..9; got {effort}")
    spent = EFFORTS[int(effort)]
    is_visual = tune is Tune.VISUAL
    return FieldChoices(
        position_step=1.0,
        n_modes=n_modes,
        basis_step=4.0 if is_visual else 2.5,
        least_rms=0.8 if is_visual else 0.5,
        carried_share=0.6 if is_visual else 0.5,
        n_carrying_scales=2 if is_visual else 1,
        has_filters=spent.has_filters,
        group_ends=spent.group_ends,
        stencil_size=spent.stencil_size,
        later_group_ends=spent.later_group_ends,
    )


def finest_step(n_verts: int) -> float:
    """Steps below this would make integers too large for the stream."""
    # No singular value exceeds the norm, and no coordinate half a diagonal.
    return 0.5 * math.sqrt(3.0 * n_verts) / LARGEST_INTEGER


def checked_step(step: float, finest: float) -> float:
    """The step itself.

    Raises
    ------
    InvalidInputError
        If it is too fine.
    """
    if step < finest:
        raise InvalidInputError(
            f"step {step:g} is finer than this sequence can be coded with; "
            f"at least {finest:.2g} is allowed"
        )
    return step
