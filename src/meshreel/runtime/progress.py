"""Progress of long work, reported to a callback."""

from collections.abc import Callable

Progress = Callable[[str, float], None]
"""Called as ``progress(stage, fraction)``: a short name and its completed fraction, 0..1.

The fraction may be a `Count`.
"""


USUAL_TRIES, MAX_SHARE = 6, 0.95
"""Number of tries of most searches, and the share of the progress that they report at most."""


class Count(float):
    """A completed fraction, 0..1, with the number of items done and their total."""

    done: int
    total: int
    """At least 0; the fraction of 0 items is 1."""
    unit: str
    """Name of the items, in the plural."""

    def __new__(cls, done: int, total: int, unit: str) -> "Count":
        """The fraction `done` / `total`."""
        fraction = super().__new__(cls, done / total if total else 1.0)
        fraction.done, fraction.total, fraction.unit = done, total, unit
        return fraction


class _Silent:
    """A callback that ignores progress; its `repr` keeps documented signatures short."""

    def __call__(self, stage: str, fraction: float) -> None:
        """Do nothing."""

    def __repr__(self) -> str:
        return "silent"

    def __reduce__(self) -> str:
        return "silent"  # pickled and copied by reference, as the function of a module


silent: Progress = _Silent()
"""The default callback, which ignores progress."""


def report_try(progress: Progress, number: int, share: float = 0.0) -> None:
    """Report the share of a try of a search, numbered from 1, as a share of all tries."""
    usual = f" of about {USUAL_TRIES}" if number <= USUAL_TRIES else ""
    progress(f"encoding, try {number}{usual}", min((number - 1 + share) / USUAL_TRIES, MAX_SHARE))
