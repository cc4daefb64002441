"""How long work tells its caller how far it is, without knowing who listens."""

from collections.abc import Callable

Progress = Callable[[str, float], None]
"""Called as ``progress(stage, fraction)``: a short name, and the share of it done in 0..1."""


def silent(stage: str, fraction: float) -> None:
    """Nothing: the listener of callers that do not want to know."""
