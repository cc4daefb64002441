"""Description of the animations of a file, as `meshreel info` lists them."""

from dataclasses import dataclass


@dataclass(frozen=True)
class AnimationInfo:
    """One of the animations of a file."""

    name: str
    """Unique in the file."""
    start_s: float = 0.0
    duration_s: float = 0.0
    """Time of the first key, and seconds to the last key; 0 if it has a problem."""
    moves_mesh: bool = False
    """Whether it animates a mesh that is read."""
    problem: str | None = None
    """Why it cannot be read; None if it can."""
