"""The error that morph targets or textures may add to that of a decoded stream."""

import math
from dataclasses import dataclass, replace

import numpy as np

from meshreel.arrays import Floats
from meshreel.codec.error_bounds import bound_of, round_up
from meshreel.errors import InvalidInputError, Keyword
from meshreel.formats.options import Origin, WriteOptions
from meshreel.model.notes import Note, NoteKind

MARGIN = 4e-7
"""Error that float32 arithmetic may add, relative to the size of the box."""


@dataclass(frozen=True)
class ErrorBudget:
    """The error that may be added to the frames, and the error that they already have."""

    max_added: float
    """Error that may be added, in model units; 0 for as little as possible."""
    diagonal: float
    """Length that is 100 percent, in model units."""
    origin: Origin | None
    """The stream from which the frames were decoded."""

    def percent(self, length: float) -> float:
        """Return a length in model units as percent of the diagonal."""
        return 100 * length / (self.diagonal or 1.0)

    def total(self, added: float) -> float | None:
        """Return the largest error relative to the original, in model units; None if unknown."""
        error = 0.0 if self.origin is None else self.origin.error
        return error + added + MARGIN * self.diagonal if math.isfinite(error) else None

    def describe(self, max_added: float) -> list[Note]:
        """Return notes on the error relative to the original, given the error added.

        There are none if the frames are the original.
        """
        if self.origin is None:
            return []
        total = self.total(max_added)
        if total is None:
            text = (
                "errors are measured against the decoded animation, since the stream guarantees "
                "none: encode with --max-error for a guarantee, and decode all modes"
            )
            return [Note(NoteKind.RESULT, "error", text=text)]
        stream_percent = self.percent(self.origin.error)
        percent = round_up(self.percent(total))
        text = (
            f"against the original the largest error is at most {percent} % of the diagonal, "
            f"of which the stream contributes {round_up(stream_percent)} %"
        )
        return [Note(NoteKind.RESULT, "error", text=text)]


def requested_budget(
    low: Floats, high: Floats, options: WriteOptions, default: float, *, consumer: str
) -> tuple[float, ErrorBudget]:
    """Return the error bound of options in percent, and the budget of targets or textures.

    A bound of the options limits the error against the original, so the error of the stream is
    subtracted; the default limits the error added.

    Parameters
    ----------
    low, high : float arrays of shape (3,)
        Corners of the bounding box of the written frames. If the stream guarantees an error, the
        smaller of its diagonal and that of the original counts.
    default : float
        Error bound in percent of the diagonal, if the options have none.
    consumer : str
        What adds the error, for messages.

    Raises
    ------
    InvalidInputError
        If the error of the stream alone uses up the bound.
    """
    diagonal = float(np.linalg.norm(high - low))
    bound, origin = options.max_error, options.origin
    allowed_percent = default if bound is None else bound_of(bound).percent(diagonal or 1.0)
    if origin is None or not math.isfinite(origin.error):
        return allowed_percent, ErrorBudget(allowed_percent / 100 * diagonal, diagonal, origin)
    min_diagonal = min(diagonal or origin.diagonal, origin.diagonal)
    budget = ErrorBudget(allowed_percent / 100 * min_diagonal, min_diagonal, origin)
    if bound is None:
        return allowed_percent, budget
    remaining = budget.max_added - origin.error - MARGIN * min_diagonal
    if remaining <= 0:
        raise InvalidInputError(
            Keyword("max_error"),
            f" {allowed_percent:g} % leaves nothing for {consumer}: the stream itself has an "
            f"error of up to {round_up(budget.percent(origin.error))} % of the diagonal; allow a "
            "larger error, or encode the original with a smaller ",
            Keyword("max_error"),
        )
    return allowed_percent, replace(budget, max_added=remaining)
