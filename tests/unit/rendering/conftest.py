import numpy as np
import pytest

from meshreel.model.sequence import MeshSequence
from samples.meshes import waving_grid


@pytest.fixture
def grid():
    """12 frames of 99 vertices, 25 a second."""
    return waving_grid()


@pytest.fixture
def lifted(grid):
    """The grid, whose first vertices are off in every frame."""
    vertices = grid.vertices.copy()
    vertices[:, :20, 2] += np.float32(0.05)
    return MeshSequence(vertices, grid.faces, grid.fps)
