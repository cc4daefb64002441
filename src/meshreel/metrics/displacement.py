"""Distances between original and decoded vertices, against the size of the sequence."""

import math
from dataclasses import dataclass

import numpy as np

from meshreel.metrics.reference import paired_frames, relative, shared_reference
from meshreel.sequence import Vertices


@dataclass(frozen=True)
class DisplacementErrors:
    """Vertex displacements in percent of the diagonal of the whole original sequence.

    Attributes
    ----------
    rms_percent : float
        Root of the mean squared displacement over all vertices and frames.
    max_percent : float
        Largest displacement of any vertex in any frame.
    """

    rms_percent: float
    max_percent: float


@np.errstate(over="ignore", invalid="ignore")
def displacement_errors_percent(original: Vertices, decoded: Vertices) -> DisplacementErrors:
    """RMS and largest vertex displacement, in percent of the bounding-box diagonal.

    The box is that of all frames of the original together. Where it has no extent, an error is
    infinite and no error is 0.

    Parameters
    ----------
    original, decoded : float arrays of shape (T, V, 3), in model units, all finite

    Raises
    ------
    InvalidInputError
        If the shapes differ.
    """
    reference = shared_reference(original, decoded)
    total = largest = 0.0
    for _, displacement in paired_frames(original, decoded, reference):
        squares = np.einsum("va,va->v", displacement, displacement)
        total += float(squares.sum())
        largest = max(largest, float(squares.max()))
    n_positions = original.shape[0] * original.shape[1]
    diagonal = reference.diagonal_scaled
    return DisplacementErrors(
        rms_percent=100 * relative(math.sqrt(total / n_positions), diagonal),
        max_percent=100 * relative(math.sqrt(largest), diagonal),
    )
