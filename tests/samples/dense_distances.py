"""Distances between surfaces from dense samples: slow, and without the code of the package."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree


def edges(faces):
    """The edges as pairs of vertices, and the edges of the sides of each face."""
    sides = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1).astype(np.int64)
    keys, of_sides = np.unique(sides @ [2**32, 1], return_inverse=True)
    return np.stack([keys >> 32, keys & (2**32 - 1)], axis=1), of_sides.reshape(-1, 3)


def subdivided(vertices, faces, max_edge):
    """Split all faces into four until no edge is longer."""
    while True:
        ends, of_sides = edges(faces)
        if np.linalg.norm(vertices[ends[:, 0]] - vertices[ends[:, 1]], axis=1).max() <= max_edge:
            return vertices, faces
        (a, b, c), (ab, bc, ca) = faces.T, (len(vertices) + of_sides).T
        parts = [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
        vertices = np.concatenate([vertices, vertices[ends].mean(axis=1)])
        faces = np.concatenate([np.stack(part, axis=1) for part in parts])


def normals_of(corners):
    """Normals of triangles of shape (M, 3, 3), twice as long as their areas."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def boundary_normals(points, faces):
    """A unit normal at each vertex on a side of only one face, and zero at others."""
    ends, of_sides = edges(faces)
    is_single = np.bincount(of_sides.ravel()) == 1
    rims = np.flatnonzero(is_single[of_sides].any(axis=1))
    normals, found = normals_of(points[faces[rims]]), np.zeros_like(points)
    on_rim = np.zeros(len(points), bool)
    on_rim[ends[is_single]] = True
    found[faces[rims]] = normals[:, None] / np.linalg.norm(normals, axis=1)[:, None, None]
    return found * on_rim[:, None]


def one_way(mesh, target, length, may_end):
    """The distance within which 99 % of a surface are, and its largest connected area beyond.

    Without what is beyond the boundary of the target, if that may end.
    """
    points, parts = subdivided(target[0], target[1], length / 2.5)
    vertices, faces = subdivided(mesh[0], mesh[1], length)
    corners = vertices[faces]
    is_used = np.bincount(parts.ravel(), minlength=len(points)) > 0
    tree = cKDTree(points[is_used], balanced_tree=False)  # balancing grids takes long
    distances, closest = tree.query(corners.mean(axis=1))
    areas = np.linalg.norm(normals_of(corners), axis=1) / 2
    is_open = (np.bincount(edges(target[1])[1].ravel()) == 1).any()
    if may_end and is_open:
        rim = boundary_normals(points, parts)[is_used][closest]
        heights = np.abs(((corners.mean(axis=1) - points[is_used][closest]) * rim).sum(axis=1))
        areas[rim.any(axis=1) & (heights < 0.8 * distances)] = 0
    order = np.argsort(distances)
    reached = np.cumsum(areas[order])
    p99 = distances[order][np.searchsorted(reached, 0.99 * reached[-1])]
    is_beyond = (distances > length) & (areas > 0)
    _, of_sides = edges(faces)
    of_faces = np.repeat(np.arange(len(faces)), 3)
    touching = coo_array((is_beyond[of_faces], (of_faces, of_sides.ravel()))).tocsr()
    _, patches = connected_components(touching @ touching.T, directed=False)
    return p99, np.bincount(patches, areas * is_beyond).max()


def promised(mesh, target, length):
    """Both sides of the promise in tolerances: the 99 % distance, and the side of the patch."""
    figures = [one_way(mesh, target, length, True), one_way(target, mesh, length, False)]
    p99, area = np.max(figures, axis=0)
    return p99 / length, area**0.5 / length
