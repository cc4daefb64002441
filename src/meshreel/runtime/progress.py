"""How long work tells its caller how far it is, without knowing who listens."""

from collections.abc import Callable

Progress = Callable[[str, float], None]
"""Called as ``progress(stage, fraction)``: a short name, and the share of it done in 0..1.

The share may be a `Count`, which says how many of how many things are done.
"""


class Count(float):
    """The share that some things are of all: a number in 0..1 that remembers both.

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
    """Nothing: the listener of callers that do not want to know."""
