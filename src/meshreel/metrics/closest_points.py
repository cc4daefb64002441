"""Closest points among points, by SciPy."""

from typing import Any

from meshreel.arrays import Floats
from meshreel.runtime.extras import SURFACES


def k_d_tree(points: Floats, **options: Any) -> Any:
    """Return SciPy's k-d tree of the points.

    Raises
    ------
    InvalidInputError
        If SciPy, the extra [surfaces], is not installed.
    """
    return SURFACES.load("spatial").cKDTree(points, **options)
