"""Metrics match an independent implementation of the same definitions.

Decoded = round(v / q) q with q = 1e-3 of the diagonal of the whole sequence. The figures have
six decimals, so half of the last one is added to the relative tolerance.
"""

import numpy as np
import pytest

from meshreel.metrics.compare import compare
from meshreel.model.sequence import MeshSequence

pytestmark = pytest.mark.real

FIGURES = ("diagonal", "kg_error_percent", "sted_spatial", "sted_temporal", "sted",
           "max_error_percent")  # fmt: skip
EXPECTED = {
    "cow": (6.301508, 0.396417, 0.078474, 0.026654, 0.078474, 0.086061),
    "samba": (2.873780, 0.294317, 0.076309, 0.303553, 0.076309, 0.086444),
    "chicken": (19.068631, 1.438135, 0.284383, 0.470420, 0.284383, 0.086402),
}


@pytest.mark.parametrize("name", EXPECTED)
def test_compare_agrees_with_the_cross_check(sequence_named, name):
    sequence = sequence_named(name)
    vertices, faces = sequence.vertices.astype(np.float64), sequence.faces
    step = 1e-3 * np.linalg.norm(np.ptp(vertices, axis=(0, 1)))
    decoded = np.round(vertices / step) * step
    quality = compare(MeshSequence(vertices, faces), MeshSequence(decoded, faces))
    for figure, expected in zip(FIGURES, EXPECTED[name], strict=True):
        result = getattr(quality, figure)
        assert result == pytest.approx(expected, rel=1e-5, abs=5.1e-7), figure
