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
    """Split faces at the middle of longer edges until no edge is longer."""
    while True:
        ends, of_sides = edges(faces)
        lengths = np.linalg.norm(vertices[ends[:, 0]] - vertices[ends[:, 1]], axis=1)
        is_long = lengths > max_edge
        if not is_long.any():
            return vertices, faces
        middles = np.where(is_long, len(vertices) - 1 + np.cumsum(is_long), -1)[of_sides]
        order = (lengths[of_sides].argmax(axis=1)[:, None] + [0, 1, 2]) % 3
        faces, middles = (np.take_along_axis(of, order, axis=1) for of in (faces, middles))
        vertices = np.concatenate([vertices, vertices[ends[is_long]].mean(axis=1)])
        for _ in range(3):  # at the longest side first, which keeps angles
            is_cut = middles[:, 0] >= 0
            (a, b, c), (ab, bc, ca) = faces[is_cut].T, middles[is_cut].T
            none = np.full_like(ab, -1)
            parts = [np.stack([a, ab, c], axis=1), np.stack([ab, b, c], axis=1)]
            uncut = [np.stack([none, none, ca], axis=1), np.stack([none, bc, none], axis=1)]
            faces = np.concatenate([faces[~is_cut], *parts])[:, [1, 2, 0]]
            middles = np.concatenate([middles[~is_cut], *uncut])[:, [1, 2, 0]]


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
    if not is_beyond.any():
        return p99, 0.0
    _, of_sides = edges(faces[is_beyond])
    of_faces = np.repeat(np.arange(len(of_sides)), 3)
    touching = coo_array((np.ones(len(of_faces)), (of_faces, of_sides.ravel()))).tocsr()
    _, patches = connected_components(touching @ touching.T, directed=False)
    return p99, np.bincount(patches, areas[is_beyond]).max()


def promised(mesh, target, length):
    """Both sides of the promise in tolerances: the 99 % distance, and the side of the patch."""
    figures = [one_way(mesh, target, length, True), one_way(target, mesh, length, False)]
    p99, area = np.max(figures, axis=0)
    return p99 / length, area**0.5 / length
