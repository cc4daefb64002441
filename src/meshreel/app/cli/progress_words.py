"""Progress as text: number of finished items, pace, remaining time."""

import time
from collections.abc import Callable

from meshreel.runtime.counting import singular
from meshreel.runtime.progress import Count

MIN_ELAPSED_S = 2.0
"""Elapsed time before the remaining time is shown, because early estimates are unstable."""


class PaceClock:
    """Measures the pace of the current stage.

    Parameters
    ----------
    now_s : callable, optional
        Returns the time in seconds, from any origin.
    """

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._counted = ("", 0)
        self._began_s, self._n_at_first, self._n_last = now_s(), 0, 0

    def words(self, fraction: float) -> str:
        """Text such as "12 of 175 frames, 8.4 frames/s, 0:19 left"; empty if nothing is counted.

        The pace restarts when the unit or total changes, or the count falls.

        Parameters
        ----------
        fraction : float
            A `Count` if items are counted.
        """
        if not isinstance(fraction, Count):
            self._counted = ("", 0)
            return ""
        counted = fraction.unit, fraction.total
        if counted != self._counted or fraction.done < self._n_last:
            self._began_s, self._n_at_first = self._now_s(), fraction.done
        self._counted, self._n_last = counted, fraction.done
        unit = singular(fraction.unit) if fraction.total == 1 else fraction.unit
        text = f"{fraction.done} of {fraction.total} {unit}"
        elapsed_s, n_since = self._now_s() - self._began_s, fraction.done - self._n_at_first
        if elapsed_s < MIN_ELAPSED_S or n_since == 0:
            return text
        pace = n_since / elapsed_s
        left_s = (fraction.total - fraction.done) / pace
        return f"{text}, {pace_text(pace, fraction.unit)}, {clock_text(left_s)} left"


def pace_text(per_second: float, unit: str) -> str:
    """Text such as "8.4 frames/s", or "3.1 s each" for items that take more than a second."""
    if per_second < 1:
        return f"{1 / per_second:.3g} s each"
    pace = f"{per_second:.3g}"
    return f"{pace} {singular(unit) if pace == '1' else unit}/s"


def clock_text(seconds: float) -> str:
    """Text such as "0:19", "12:05" and "3:07:00"."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
