import numpy as np
import pytest

from meshreel.model.sequence import MeshSequence

OCTAHEDRON = np.array(
    [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]
)


@pytest.fixture
def make_sequence():
    """An octahedron whose vertices move at random, with values that need all their digits."""

    def make(n_frames=3, dtype=np.float32, offset=0.0, fps=0.0, name=""):
        rng = np.random.default_rng(7)
        vertices = (rng.standard_normal((n_frames, 6, 3)) * 0.37 + offset).astype(dtype)
        return MeshSequence(vertices, OCTAHEDRON, fps, name)

    return make
