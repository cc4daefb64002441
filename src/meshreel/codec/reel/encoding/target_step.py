"""Rate control: from a target to the quantisation step and the bound that meet it.

The same for a sequence that is all there and for the first block of a live one: a `Material` says
how large the model is, and which size or error a step leads to.
"""

from functools import partial
from typing import Protocol

import numpy as np

from meshreel.codec.choices import Order
from meshreel.codec.config import EncoderConfig
from meshreel.codec.reel.encoding.corrections import check_promise
from meshreel.codec.reel.encoding.effort import STEPS_OF_BOUND, checked_step, quality_step
from meshreel.codec.reel.encoding.rate_control import least_cost, meet_limit
from meshreel.codec.targets import Target, TargetKind
from meshreel.errors import InvalidInputError

FIRST_QUALITY = 75.0
"""Where the search for an error or a size begins."""


class Material(Protocol):
    """Frames that a step is to be found for. Steps are in diagonals of its bounding box."""

    @property
    def diagonal(self) -> float:
        """Of the bounding box, in model units."""

    @property
    def own_diagonal(self) -> float:
        """Of the model itself, the mean of all frames, in diagonals of the bounding box."""

    @property
    def step_share(self) -> float:
        """The step for this surface by the usual one of a quality; see `smoothness`."""

    @property
    def rounding(self) -> float:
        """Largest error of a position, in diagonals, that its number type alone makes."""

    @property
    def dtype(self) -> np.dtype[np.floating]:
        """Number type of the positions."""

    @property
    def finest_step(self) -> float:
        """The finest step that it can be coded with."""

    def size_bytes(self, step: float, bound: float) -> float:
        """Bytes with a step, corrected to keep a bound in diagonals."""

    def measured(self, step: float) -> float:
        """The number that the target limits, with a step: an error, bytes or bits."""


def aimed(
    config: EncoderConfig, material: Material, *, has_tracks: bool = False
) -> tuple[float, float | None]:
    """The step that meets the target of options, and the bound it promises, both in diagonals.

    Parameters
    ----------
    config : EncoderConfig
    material : Material
    has_tracks : bool
        Whether sizes include those of tracks, which the error then mentions.

    Raises
    ------
    InvalidInputError
        If the target cannot be met.
    """
    target = config.target
    if target.kind is TargetKind.STEP:
        return checked_step(target.value, material.finest_step), None
    if target.kind is TargetKind.QUALITY:
        step = _step_of(target.value, material) * material.step_share
        return max(material.finest_step, step), None
    if target.kind is TargetKind.MAX_ERROR:
        bound = promised_bound(target, material.diagonal, material.rounding, material.dtype)
        step = least_cost(partial(material.size_bytes, bound=bound), bound / STEPS_OF_BOUND)
        return max(material.finest_step, step), bound
    return _step_within_limit(config, material, has_tracks), None


def _step_of(quality: float, material: Material) -> float:
    return quality_step(quality) * material.own_diagonal


def promised_bound(
    target: Target, diagonal: float, rounding: float, dtype: np.dtype[np.floating]
) -> float:
    """The bound of a largest error, in diagonals, which the number type allows to promise.

    Parameters
    ----------
    target : Target
    diagonal : float
        Of the bounding box, in model units.
    rounding : float
        Largest error of a position, in diagonals, that the number type alone makes.
    dtype : dtype
        Of the positions.

    Raises
    ------
    InvalidInputError
        If it does not.
    """
    percent = target.bound.percent(diagonal)
    try:
        check_promise(percent / 100.0, rounding, dtype)
    except InvalidInputError as error:
        if not target.is_length:
            raise
        length = f"{target.value:g} model units are {percent:.3g} % of the diagonal"
        raise InvalidInputError(f"{length}: {error}") from None
    return percent / 100.0


def _step_within_limit(config: EncoderConfig, material: Material, has_tracks: bool) -> float:
    """The step that comes nearest to the target's number from below."""
    target = config.target
    found: dict[float, float] = {}

    def measured(step: float) -> float:
        if step not in found:
            found[step] = material.measured(step)
        return found[step]

    start = _step_of(FIRST_QUALITY, material)
    step = meet_limit(measured, target.value, start, rises=not target.kind.is_budget)
    if step is None:
        raise InvalidInputError(
            f"{target.kind.value} {target.value:g} cannot be met: "
            f"{_best(target.kind, min(found.values()))}; {_remedy(config, has_tracks)}"
        )
    return step


def _best(kind: TargetKind, reached: float) -> str:
    """The smallest number that was reached, in words."""
    if kind is TargetKind.SIZE:
        return f"the smallest file with these options is {reached:.0f} bytes"
    if kind is TargetKind.BPVF:
        return f"the smallest file with these options has {reached:g} bits per vertex and frame"
    return f"the smallest error is {reached:g}"


def _remedy(config: EncoderConfig, has_tracks: bool) -> str:
    if not config.target.kind.is_budget:
        return "positions come back no nearer than their number type; allow more"
    ways = ["allow more"]
    if config.order_choice is not Order.DROP:
        ways.append('leave the order out (order="drop")')
    if has_tracks:
        ways.append("drop tracks or allow larger errors of them")
    return ", or ".join(ways)
