"""Key meshes with as few vertices as the tolerance and the quality need."""

import numpy as np

from meshreel.arrays import Floats
from meshreel.codec.targets import error_scale
from meshreel.kernel.decimation import decimated
from meshreel.registration.fitting import TwoSidedFit
from meshreel.registration.refining import KeyMesh
from meshreel.registration.triangle_mesh import Indices, TriangleMesh, mean_at_vertices
from meshreel.registration.verification import Tolerance, measure

RMS, MAX_RMS = 0.03, 0.12
"""Root mean square distance of the decimated surface at the default quality, in tolerances, before
the fit halves it, and the largest at any quality. Like errors of coding, it halves every 12 points
of quality: vertices of the key take bits, but with too few, no quantization step has fine normals.
"""

DISTANCE = 0.5
"""Root mean square distance around one vertex, in tolerances."""

BEND_RADIUS = 0.02
"""Radius of bends that other frames may have, in longest sides of the box. Edges are so short that
their sagitta at such a bend is at most the tolerance, even where the key is flat."""

SMOOTHING_PASSES = 6
"""Number of times that face areas and curvatures are averaged over neighbors."""

MAX_WEIGHT = 16.0
"""Largest weight of squared distances before normalization, and the inverse of the least."""

SMOOTHNESS = 0.03, 0.01, 0.003
"""Smoothness of the steps that fit the mesh."""


def decimated_key(full: KeyMesh, wedges: Indices, tolerance: Tolerance) -> KeyMesh:
    """Return a mesh with fewer vertices, fitted to the surface; `full` itself if none is near.

    Parameters
    ----------
    full : KeyMesh
        The mesh of a cleaned frame, in longest sides of the box.
    wedges : int64 array of shape (M, 3)
        Corners of a vertex have the same number if they have the same attributes.
    """
    mesh, length = full.mesh, tolerance.length
    max_edge = float(np.sqrt(8 * BEND_RADIUS * length))
    rms = min(RMS * error_scale(tolerance.quality), MAX_RMS)
    weights = detail_weights(mesh)
    faces, remaining_wedges = decimated(
        mesh.vertices, mesh.faces, wedges, rms * length, DISTANCE * length, max_edge, weights
    )
    used_vertices, numbers = np.unique(faces, return_inverse=True)
    coarse = TriangleMesh(mesh.vertices[used_vertices], numbers.reshape(-1, 3).astype(np.int32))
    rest, fit = coarse.vertices, TwoSidedFit(coarse.faces, len(used_vertices))
    for smoothness in SMOOTHNESS:
        coarse = TriangleMesh(fit.step(coarse, rest, mesh, smoothness), coarse.faces)
    if measure(coarse, mesh, tolerance).exceeds(tolerance):
        return full
    corners = np.zeros(int(wedges.max()) + 1, np.int64)
    corners[wedges.ravel()] = np.arange(wedges.size)
    kept_corners = corners[remaining_wedges]
    return KeyMesh(coarse, kept_corners // 3, np.eye(3)[kept_corners % 3])


def detail_weights(mesh: TriangleMesh) -> Floats:
    """Return weights of squared distances at the vertices, shape (V,); their mean over areas is 1.

    They are larger where the surface is curved, since a distance turns short edges more, and where
    the faces of the raw mesh are small: there a studio put detail, such as in a face. A weight is
    the square root of the curvature around a vertex over the mean area of the faces there.
    """
    n_verts = len(mesh.vertices)

    def smoothed(values: Floats) -> Floats:
        for _ in range(SMOOTHING_PASSES):
            values = mean_at_vertices(values[mesh.faces].mean(axis=1), mesh.faces, n_verts)
        return values / max(float(np.average(values, weights=mesh.vertex_areas)), 1e-300)

    sides = np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2).reshape(-1, 2)
    lengths, turns = (
        np.linalg.norm(np.diff(vectors[sides], axis=1)[:, 0], axis=1)
        for vectors in (mesh.vertices, mesh.vertex_normals)
    )
    curvatures = smoothed(mean_at_vertices(turns / np.maximum(lengths, 1e-300), sides, n_verts))
    areas = smoothed(mean_at_vertices(mesh.areas, mesh.faces, n_verts))
    weights = np.sqrt(curvatures / np.maximum(areas, 1e-300))
    weights = np.clip(weights, 1 / MAX_WEIGHT, MAX_WEIGHT)
    return np.asarray(weights / np.average(weights, weights=mesh.vertex_areas))
