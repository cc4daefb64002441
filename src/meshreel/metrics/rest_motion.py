"""Motion of decoded vertices where the original rests: surfaces that seem to crawl."""

from dataclasses import dataclass

import numpy as np

from meshreel.arrays import Floats
from meshreel.metrics.reference import shared_reference
from meshreel.model.sequence import Vertices

REST_PERCENT = 0.001
"""Vertices rest where they move by less from one frame to the next, in percent of the mean
diagonal of the frames: a tenth of the quantization step of the default quality."""


@dataclass(frozen=True)
class RestMotion:
    """How far decoded vertices move from frame to frame where the original ones rest.

    Percentages are of the mean diagonal of the bounding boxes of single frames of the original, so
    that a path that a model walks does not hide its motion.

    Attributes
    ----------
    n_pairs : int
        Pairs of a vertex and a frame, other than the first, at which the original rests: it moves
        by less than `REST_PERCENT` from the frame before.
    median_percent, p99_percent : float
        Median and 99th percentile of the decoded motion over these pairs; 0 if there are none.
    """

    n_pairs: int
    median_percent: float
    p99_percent: float


@np.errstate(over="ignore", invalid="ignore")
def rest_motion(original: Vertices, decoded: Vertices) -> RestMotion:
    """Median and 99th percentile of decoded motion where the original rests.

    Parameters
    ----------
    original, decoded : float arrays of shape (T, V, 3), in model units, all finite

    Raises
    ------
    InvalidInputError
        If the shapes differ.
    """
    scale = shared_reference(original, decoded).scale
    sides = [np.ptp(frame.astype(np.float64) * scale, axis=0) for frame in original]
    diagonal = float(np.linalg.norm(sides, axis=1).mean())
    threshold = REST_PERCENT / 100.0 * diagonal
    found = [np.empty(0, np.float32)]
    for number in range(1, len(original)):
        rests = _steps(original, number, scale) < threshold
        if rests.any():
            steps = _steps(decoded, number, scale)[rests]
            found.append((100.0 / diagonal * steps).astype(np.float32))
    moved = np.concatenate(found)
    if not len(moved):
        return RestMotion(0, 0.0, 0.0)
    median, p99 = np.percentile(moved, [50, 99])
    return RestMotion(len(moved), float(median), float(p99))


def _steps(vertices: Vertices, number: int, scale: float) -> Floats:
    """How far each vertex moves to a frame from the one before, in scaled units."""
    moved = np.subtract(vertices[number], vertices[number - 1], dtype=np.float64) * scale
    return np.asarray(np.sqrt(np.einsum("na,na->n", moved, moved)))
