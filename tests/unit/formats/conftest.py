import numpy as np
import pytest

from meshreel.formats.load import load
from meshreel.model.notes import Notes
from meshreel.model.sequence import MeshSequence
from samples.meshes import octahedron_faces
from samples.opening import open_source


@pytest.fixture
def make_sequence():
    """An octahedron whose vertices move at random, with values that need all their digits."""

    def make(n_frames=3, dtype=np.float32, offset=0.0, fps=0.0, name=""):
        rng = np.random.default_rng(7)
        vertices = (rng.standard_normal((n_frames, 6, 3)) * 0.37 + offset).astype(dtype)
        return MeshSequence(vertices, octahedron_faces(), fps, name)

    return make


@pytest.fixture(params=[load, open_source])
def read(request):
    """A function that reads a file: at once, or each frame when it is needed."""
    return request.param


@pytest.fixture
def notes():
    """An empty list, which receives the notes of functions that take it."""
    return Notes()
