"""Reconstruction systems of meshes that are as irregular as they come, deterministic."""

import numpy as np
from scipy.sparse import csc_array, diags_array
from scipy.spatial import Delaunay

from meshreel.geometry.connectivity import component_labels
from meshreel.geometry.laplacian import uniform_laplacian
from samples.meshes import grid_faces, octahedron_faces


def irregular_faces(n_points=900):
    """Random triangles with holes, a strip, small bodies, a hub, long edges, odd faces."""
    rng = np.random.default_rng(3)
    faces = Delaunay(rng.random((n_points, 2))).simplices
    faces = faces[rng.random(len(faces)) > 0.2]
    strip = grid_faces(2, 60) + n_points
    bodies = [octahedron_faces() + n_points + 120 + 6 * k for k in range(20)]
    hub = n_points + 240
    ring = rng.choice(n_points, 60, replace=False)
    spokes = np.stack([np.full(59, hub), ring[:-1], ring[1:]], axis=1)
    odd = [[5, 5, 5], [7, 7, 9], [1, 2, 3], [1, 2, 3]]
    long = rng.integers(0, n_points, (5, 3))
    faces = np.concatenate([faces, strip, *bodies, spokes, odd, long])
    return np.random.default_rng(4).permutation(hub + 3)[faces], hub + 3


def system_of(faces, n_verts, *, normalized=True, share=0.0):
    """The Laplacian, and the matrix of Eq. 12 with one anchor in each component and some more."""
    laplacian = uniform_laplacian(faces, n_verts, normalized=normalized)
    selected = np.random.default_rng(5).random(n_verts) < share
    _, labels = component_labels(faces, n_verts)
    selected[np.unique(labels, return_index=True)[1]] = True
    return laplacian, csc_array(laplacian.T @ laplacian + diags_array(selected.astype(float)))
