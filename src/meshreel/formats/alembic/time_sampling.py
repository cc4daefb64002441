"""When the samples of an Alembic property are, and what lies between them."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.formats.alembic.ogawa import damaged

Times = npt.NDArray[np.float64]

LATEST_S, SHORTEST_S = 1e12, 1e-9
"""Times and intervals beyond these are those of a damaged file."""
SAME = 1e-3
"""Share of an interval within which a time is that of a sample."""


@dataclass(frozen=True, eq=False)
class TimeSampling:
    """Times that repeat after a cycle, or are listed one by one.

    Parameters
    ----------
    stored_s : float64 array of shape (N,)
        Times of the first cycle, or of all samples, in seconds.
    cycle_s : float, optional
        How long a cycle takes; None if all times are listed.
    """

    stored_s: Times
    cycle_s: float | None

    @property
    def is_uniform(self) -> bool:
        """Whether all samples are equally far apart."""
        return self.cycle_s is not None and len(self.stored_s) == 1

    def times(self, n_samples: int) -> Times:
        """Times of the first samples, ascending, of shape (n_samples,).

        Raises
        ------
        FormatError
            If fewer are listed, or they do not ascend.
        """
        if self.cycle_s is not None:
            cycles, places = np.divmod(np.arange(n_samples), len(self.stored_s))
            with np.errstate(all="ignore"):
                found = self.stored_s[places] + cycles * self.cycle_s
        elif n_samples <= len(self.stored_s):
            found = self.stored_s[:n_samples]
        else:
            raise damaged(f"{len(self.stored_s)} times are listed for {n_samples} samples")
        if not (np.abs(found) < LATEST_S).all() or (np.diff(found) < 0).any():
            raise damaged("the times of samples do not ascend")
        if 0 < found[-1] - found[0] < SHORTEST_S * (n_samples - 1):
            raise damaged(f"{n_samples} samples are {found[-1] - found[0]:.2g} s apart")
        return found


def between(times_s: Times, time_s: float) -> tuple[int, int, float]:
    """The samples before and after a time, and its share of the way between them.

    Before the first sample and behind the last, that one is both.
    """
    after = int(np.searchsorted(times_s, time_s))
    if after == 0 or after == len(times_s):
        only = min(after, len(times_s) - 1)
        return only, only, 0.0
    share = float((time_s - times_s[after - 1]) / (times_s[after] - times_s[after - 1]))
    if share > 1 - SAME:
        return after, after, 0.0
    return after - 1, after - 1 if share < SAME else after, share if share >= SAME else 0.0
