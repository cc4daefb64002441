import numpy as np
import pytest

from meshreel.model.sequence import MeshSequence
from samples.meshes import waving_grid


@pytest.fixture
def grid():
    """12 frames of 99 vertices at 25 fps."""
    return waving_grid()


@pytest.fixture
def lifted(grid):
    """The grid with displaced first vertices in every frame."""
    vertices = grid.vertices.copy()
    vertices[:, :20, 2] += np.float32(0.05)
    return MeshSequence(vertices, grid.faces, grid.fps)
