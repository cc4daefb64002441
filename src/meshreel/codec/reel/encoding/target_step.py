"""Rate control: the quantization step and error bound that meet a target.

A `RateModel`, of a whole sequence or of the first block of a live one, provides the size of the
model, and the size or error of a stream for each step.
"""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Protocol

import numpy as np

from meshreel.codec.reel.encoding.corrections import check_error_bound
from meshreel.codec.reel.encoding.effort import FINEST_STEP, STEPS_OF_BOUND
from meshreel.codec.reel.encoding.rate_control import least_cost, meet_limit
from meshreel.codec.reel.encoding.surface_errors import SLIDING_STEP
from meshreel.codec.reel_options import ReelOptions, Tune
from meshreel.codec.targets import Target, TargetKind
from meshreel.errors import InvalidInputError, Keyword

FIRST_STEP = 1.3e-4
"""Step at which the search for an error or a size starts, in diagonals of the model."""


class RateModel(Protocol):
    """Sizes and errors by quantization step, in diagonals of the bounding box."""

    @property
    def diagonal(self) -> float:
        """Diagonal of the bounding box, in model units."""

    @property
    def model_size(self) -> float:
        """Mean diagonal of single frames, in diagonals of the bounding box."""

    @property
    def rounding(self) -> float:
        """Largest rounding error of a position by its number type, in diagonals."""

    @property
    def dtype(self) -> np.dtype[np.floating]:
        """Number type of the positions."""

    def step_of_quality(self, quality: float) -> float:
        """Return the step of a quality; see `visibility`."""

    def size_bytes(self, step: float, bound: float) -> float:
        """Return the bytes for a step, with corrections that keep a bound in diagonals."""

    def measure(self, step: float) -> float:
        """Return the quantity that the target limits, for a step: an error or bytes."""


def step_for_target(
    config: ReelOptions, model: RateModel, *, has_tracks: bool = False
) -> tuple[float, float | None]:
    """Return the step that meets the target, and the guaranteed error bound, both in diagonals.

    Parameters
    ----------
    has_tracks : bool
        Whether sizes include those of tracks, which the error then mentions.

    Raises
    ------
    InvalidInputError
        If the target cannot be met.
    """
    target = config.target
    if target.kind is TargetKind.STEP:
        if target.value < FINEST_STEP:
            raise InvalidInputError(
                f"step {target.value:g} is too fine; at least {FINEST_STEP:.2g} is allowed"
            )
        return target.value, None
    if target.kind is TargetKind.QUALITY:
        step = model.step_of_quality(target.value)
        step *= SLIDING_STEP if config.tune == Tune.SURFACE.value else 1.0
        return max(FINEST_STEP, step), None
    if target.kind is TargetKind.MAX_ERROR:
        bound = checked_bound(target, model.diagonal, model.rounding, model.dtype)
        step = least_cost(partial(model.size_bytes, bound=bound), bound / STEPS_OF_BOUND)
        return max(FINEST_STEP, step), bound
    start = FIRST_STEP * model.model_size
    return step_within_limit(config, model.measure, start, has_tracks=has_tracks), None


def checked_bound(
    target: Target, diagonal: float, rounding: float, dtype: np.dtype[np.floating]
) -> float:
    """Return the bound of a largest error, in diagonals, if the number type allows it.

    Parameters
    ----------
    diagonal : float
        Diagonal of the bounding box, in model units.
    rounding : float
        Largest rounding error of a position by its number type, in diagonals.
    dtype : dtype
        Number type of the positions.

    Raises
    ------
    InvalidInputError
        If rounding by the number type exceeds the bound.
    """
    percent = target.bound.percent(diagonal)
    try:
        check_error_bound(percent / 100.0, rounding, dtype)
    except InvalidInputError as error:
        if not target.is_length:
            raise
        length = f"{target.value:g} model units are {percent:.3g} % of the diagonal"
        raise InvalidInputError(f"{length}: {error}") from None
    return percent / 100.0


def step_within_limit(
    config: ReelOptions,
    measure: Callable[[float], float],
    start: float,
    *,
    has_tracks: bool = False,
) -> float:
    """Find the step whose size or error is closest to the target from below.

    Parameters
    ----------
    measure : callable
        Returns the error or bytes that the target limits, for a step in diagonals.
    start : float
        First step to try.
    has_tracks : bool
        Whether sizes include those of tracks, which the error then mentions.

    Raises
    ------
    InvalidInputError
        If the target cannot be met.
    """
    target = config.target
    trials: dict[float, float] = {}

    def measured(step: float) -> float:
        if step not in trials:
            trials[step] = measure(step)
        return trials[step]

    step = meet_limit(measured, target.value, start, rises=target.kind is not TargetKind.SIZE)
    if step is None:
        best = f"the smallest error is {min(trials.values()):g}"
        if target.kind is TargetKind.SIZE:
            n_bytes = min(trials.values())
            best = f"the smallest file with these options is {n_bytes:.0f} bytes"
        raise InvalidInputError(
            Keyword(target.kind.value),
            f" {target.value:g} cannot be met: {best}; ",
            *_remedy(config, has_tracks),
        )
    return step


def _remedy(config: ReelOptions, has_tracks: bool) -> Iterator[str | Keyword]:
    is_size = config.target.kind is TargetKind.SIZE
    if not is_size:
        yield "errors cannot be below the rounding of the number type; "
    yield "allow more"
    if is_size and config.order != "drop":
        yield from (", or drop the order (", Keyword("order", "drop"), ")")
    if is_size and has_tracks:
        yield ", or drop tracks or allow larger errors of them"
