"""Meshes with all kinds of defects of face lists."""

import numpy as np
import pytest

from samples.meshes import grid_faces, irregular_sequence, octahedron_faces, torus_faces


def shuffled(faces, seed):
    """The same surface with vertices, faces and first corners in random order."""
    rng = np.random.default_rng(seed)
    renamed = rng.permutation(faces.max() + 1)[faces][rng.permutation(len(faces))]
    turned = (rng.integers(0, 3, len(faces))[:, None] + np.arange(3)) % 3
    return np.take_along_axis(renamed, turned, axis=1).astype(np.int32)


def damaged(faces, seed):
    """Remove a tenth of the faces; flip, duplicate or collapse others."""
    rng = np.random.default_rng(seed)
    faces = faces[rng.random(len(faces)) > 0.1].copy()
    pick = rng.permutation(len(faces))[:24]
    faces[pick[:6]] = faces[pick[:6], ::-1]
    faces[pick[6:12], 1] = faces[pick[6:12], 0]
    extra = np.concatenate([faces[pick[12:18]], np.roll(faces[pick[18:]], 1, axis=1)])
    return rng.permutation(np.concatenate([faces, extra]))


def crowded(seed=27):
    """Random faces among close vertices, with rare valences that make Draco tag symbols."""
    rng = np.random.default_rng(seed)
    return (rng.integers(0, 500, (2000, 1)) + rng.integers(0, 10, (2000, 3))) % 500


def make_meshes():
    grid, torus = grid_faces(25, 33), torus_faces(40, 30)
    irregular = irregular_sequence()
    rng = np.random.default_rng(3)
    two = np.concatenate([octahedron_faces(), octahedron_faces() + 6])
    lists = {
        "triangle": [[0, 1, 2]],
        "turned triangle": [[2, 0, 1]],
        "two turned alike": [[1, 2, 0], [2, 3, 1]],
        "degenerate only": [[0, 0, 1], [2, 2, 2], [1, 0, 1]],
        "degenerate and good": [[0, 0, 1], [3, 1, 2], [1, 0, 1], [2, 2, 2]],
        "repeated": [[0, 1, 2], [0, 1, 2], [1, 2, 0], [2, 1, 3]],
        "repeated only": [[4, 4, 1], [4, 1, 4], [4, 4, 1]],
        "both sides": [[0, 1, 2], [2, 1, 0]],
        "three on an edge": [[0, 1, 2], [1, 0, 3], [0, 1, 4], [1, 0, 5]],
        "bowtie": [[0, 1, 2], [0, 3, 4], [2, 1, 5]],
        "inconsistent": [[0, 1, 2], [1, 2, 3], [3, 2, 4], [4, 3, 5]],
        "octahedron": octahedron_faces(),
        "two octahedra": two,
        "pinched": np.where(two == 6, 0, two),
        "grid": grid,
        "torus": torus,
        "shuffled torus": shuffled(torus, 1),
        "damaged grid": damaged(grid, 2),
        "damaged torus": damaged(shuffled(torus, 3), 4),
        "irregular": irregular.faces,
        "scattered": np.arange(300).reshape(-1, 3),
        "random": rng.integers(0, 20, (150, 3)),
        "crowded": crowded(),
        "sparse": rng.integers(0, 4000, (50, 3)),
    }
    meshes = {name: np.array(faces, np.int32) for name, faces in lists.items()}
    return {name: (faces, int(faces.max()) + 1) for name, faces in meshes.items()}


MESHES = make_meshes()


@pytest.fixture(params=[*MESHES, "unused vertices"])
def mesh(request):
    """A mesh: faces of shape (M, 3), and the number of vertices."""
    if request.param == "unused vertices":
        return MESHES["octahedron"][0] * 3 + 2, 25
    return MESHES[request.param]


@pytest.fixture
def meshes():
    """A mesh with its name."""
    return MESHES
