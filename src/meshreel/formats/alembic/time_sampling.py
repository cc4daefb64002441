"""Sample times of Alembic properties, and interpolation between samples."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.formats.alembic.ogawa import damage_error

Times = npt.NDArray[np.float64]

MAX_TIME_S, MIN_INTERVAL_S = 1e12, 1e-9
"""Limits of times and of mean sample intervals; values beyond them mean a damaged file."""
SNAP_TOLERANCE = 1e-3
"""Fraction of an interval within which a time snaps to a sample."""


@dataclass(frozen=True, eq=False)
class TimeSampling:
    """The times of samples: uniform, cyclic or acyclic.

    Parameters
    ----------
    stored_s : float64 array of shape (N,)
        Times of the first cycle, or of all samples if acyclic, in seconds.
    cycle_s : float, optional
        Length of a cycle; None if acyclic.
    """

    stored_s: Times
    cycle_s: float | None

    @property
    def is_uniform(self) -> bool:
        """Whether all samples are evenly spaced."""
        return self.cycle_s is not None and len(self.stored_s) == 1

    def times(self, n_samples: int) -> Times:
        """Return the times of the first samples, ascending, of shape (n_samples,).

        Raises
        ------
        FormatError
            If fewer times are stored, or they do not ascend.
        """
        if self.cycle_s is not None:
            cycles, phases = np.divmod(np.arange(n_samples), len(self.stored_s))
            with np.errstate(all="ignore"):
                times = self.stored_s[phases] + cycles * self.cycle_s
        elif n_samples <= len(self.stored_s):
            times = self.stored_s[:n_samples]
        else:
            raise damage_error(f"it lists {len(self.stored_s)} times for {n_samples} samples")
        if not (np.abs(times) < MAX_TIME_S).all() or (np.diff(times) < 0).any():
            raise damage_error("sample times do not ascend")
        if 0 < times[-1] - times[0] < MIN_INTERVAL_S * (n_samples - 1):
            raise damage_error(
                f"{n_samples} samples span only {times[-1] - times[0]:.2g} s; "
                f"expected at least {MIN_INTERVAL_S:g} s per interval"
            )
        return times


def bracketing_samples(times_s: Times, time_s: float) -> tuple[int, int, float]:
    """Return the samples before and after a time, and the interpolation weight of the latter.

    Outside the sampled range, both are the nearest sample.
    """
    after = int(np.searchsorted(times_s, time_s))
    if after == 0 or after == len(times_s):
        nearest = min(after, len(times_s) - 1)
        return nearest, nearest, 0.0
    before = after - 1
    weight = float((time_s - times_s[before]) / (times_s[after] - times_s[before]))
    if weight > 1 - SNAP_TOLERANCE:
        return after, after, 0.0
    if weight < SNAP_TOLERANCE:
        return before, before, 0.0
    return before, after, weight
