"""Progress of long work, reported to a callback of the caller."""

from collections.abc import Callable

Progress = Callable[[str, float], None]
"""Called as ``progress(stage, fraction)``: a short name, and the share of it done in 0..1.

The share may be a `Count`, which says how many of how many things are done.
"""


class Count(float):
    """The share of things that are done: a number in 0..1 that keeps both counts.

    Parameters
    ----------
    done, total : int
        At least 0; nothing of nothing is all.
    unit : str
        What is counted, in the plural.
    """

    done: int
    total: int
    unit: str

    def __new__(cls, done: int, total: int, unit: str) -> "Count":
        """The share of `done` in `total`."""
        share = super().__new__(cls, done / total if total else 1.0)
        share.done, share.total, share.unit = done, total, unit
        return share


def silent(stage: str, fraction: float) -> None:
    """Do nothing: the default of callers that ask for no progress."""
