import numpy as np
import pytest


@pytest.fixture
def rng():
    return np.random.default_rng(20)


@pytest.fixture
def soup(rng):
    """14 frames of 12 vertices and 15 random faces: non-manifold, longer than a window of STED."""
    original = rng.normal(size=(14, 12, 3))
    decoded = original + 0.1 * rng.normal(size=original.shape)
    faces = np.array([rng.permutation(12)[:3] for _ in range(15)], np.int32)
    return original, decoded, faces


@pytest.fixture
def tube(rng):
    """9 frames of a closed torus of 40 vertices that moves and bends."""
    rows, columns = np.divmod(np.arange(40), 8)
    u, v = 2 * np.pi * rows / 5, 2 * np.pi * columns / 8
    right, down = (rows + 1) % 5 * 8 + columns, rows * 8 + (columns + 1) % 8
    across = (rows + 1) % 5 * 8 + (columns + 1) % 8
    faces = np.concatenate(
        [np.column_stack([rows * 8 + columns, right, across]),
         np.column_stack([rows * 8 + columns, across, down])]
    ).astype(np.int32)  # fmt: skip
    radius = 3 + np.cos(v)
    rest = np.column_stack([radius * np.cos(u), radius * np.sin(u), np.sin(v)])
    time = np.arange(9)[:, None, None]
    original = rest * (1 + 0.02 * time) + 0.3 * np.sin(time + rest)
    decoded = original + 0.01 * rng.normal(size=original.shape)
    return original, decoded, faces
