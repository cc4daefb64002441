"""Key meshes with as few vertices as the tolerance and the quality need."""

import numpy as np

from meshreel.codec.targets import error_scale
from meshreel.kernel.decimation import decimated
from meshreel.registration.fitting import TwoSidedFit
from meshreel.registration.refining import KeyMesh
from meshreel.registration.triangle_mesh import Indices, TriangleMesh
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
    faces, remaining_wedges = decimated(
        mesh.vertices, mesh.faces, wedges, rms * length, DISTANCE * length, max_edge
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
