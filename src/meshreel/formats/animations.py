"""The animations of a file that holds several, as `meshreel info` lists them."""

from dataclasses import dataclass


@dataclass(frozen=True)
class AnimationInfo:
    """One of the animations of a file.

    Attributes
    ----------
    name : str
        No other animation of the file has it.
    start_s, duration_s : float
        Time of the first key, and seconds from there to the last key; 0 for one with a problem.
    moves_mesh : bool
        Whether it moves a mesh that is read.
    problem : str or None
        Why it cannot be read.
    """

    name: str
    start_s: float = 0.0
    duration_s: float = 0.0
    moves_mesh: bool = False
    problem: str | None = None
