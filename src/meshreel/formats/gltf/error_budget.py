"""The error that targets or textures may add to that of decoded frames, and the total."""

import math
from dataclasses import dataclass

from meshreel.errors import InvalidInputError
from meshreel.formats.gltf.moving_mesh import MARGIN
from meshreel.formats.options import Origin


@dataclass(frozen=True)
class ErrorBudget:
    """How far off targets or textures may be, and what else frames are off by.

    Parameters
    ----------
    added : float
        What they may add, in model units; 0 for as little as may be.
    diagonal : float
        What percents are of, in model units.
    origin : Origin, optional
        What the frames were decoded from.
    """

    added: float
    diagonal: float
    origin: Origin | None

    def percent(self, length: float) -> float:
        """A length in model units as percent of the diagonal."""
        return 100 * length / (self.diagonal or 1.0)

    def describe(self, added: float) -> list[str]:
        """Sentences on the error against the original, where so much is added to that of frames.

        None where the frames are the original.
        """
        if self.origin is None:
            return []
        if not math.isfinite(self.origin.error):
            return [
                "errors are measured against the decoded animation, for which no promise of the "
                "stream holds: encode with --max-error for one, and decode all modes"
            ]
        total = self.percent(self.origin.error + added + MARGIN * self.diagonal)
        return [
            f"against the original no vertex is off by more than {_up(total)} % of the diagonal, "
            f"{_up(self.percent(self.origin.error))} % of which the stream may be off"
        ]


def share_budget(
    allowed: float,
    diagonal: float,
    origin: Origin | None,
    *,
    is_total: bool,
    spender: str = "morph targets",
) -> ErrorBudget:
    """The budget of targets or textures; what the stream may be off is taken from the total.

    Parameters
    ----------
    allowed : float
        In percent of the diagonal.
    diagonal : float
        Of the bounding box of the frames to write, in model units. Where the error of the stream
        is known, percents are of that of the original if it is smaller.
    is_total : bool
        Whether the error against the original must keep what is allowed, or only what is added.
    spender : str, default "morph targets"
        What adds the error, for messages.

    Raises
    ------
    InvalidInputError
        If the stream alone may be as far off as is allowed.
    """
    if origin is None or not math.isfinite(origin.error):
        return ErrorBudget(allowed / 100 * diagonal, diagonal, origin)
    smaller = min(diagonal or origin.diagonal, origin.diagonal)
    budget = ErrorBudget(allowed / 100 * smaller, smaller, origin)
    if not is_total:
        return budget
    left = budget.added - origin.error - MARGIN * smaller
    if left <= 0:
        raise InvalidInputError(
            f"max_error {allowed:g} % leaves nothing for {spender}: the stream may be "
            f"{_up(budget.percent(origin.error))} % of the diagonal off itself; allow more than "
            "that, or encode the original with a smaller max_error"
        )
    return ErrorBudget(left, smaller, origin)


def _up(percent: float, n_digits: int = 4) -> str:
    """A number in as many digits as given, rounded up: a bound stays one."""
    if percent <= 0:
        return "0"
    unit = 10.0 ** (math.floor(math.log10(percent)) + 1 - n_digits)
    # A hair below the next unit is that unit, but for the rounding of numbers.
    return f"{math.ceil(percent / unit - 1e-9) * unit:.{n_digits}g}"
