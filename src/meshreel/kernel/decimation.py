"""Decimation of triangle meshes by the core."""

import numpy as np
import numpy.typing as npt

from meshreel.kernel.library import call, int32s

Integers = npt.NDArray[np.int32]


def decimated(
    vertices: npt.NDArray[np.float64],
    faces: npt.NDArray[np.integer],
    wedges: npt.NDArray[np.integer],
    max_rms: float,
    max_distance: float,
    max_length: float,
    weights: npt.NDArray[np.float64] | None = None,
) -> tuple[Integers, Integers]:
    """Collapse edges, the cheapest first, while the surface stays near the input.

    A vertex moves to a neighbor, so that the vertices that remain keep their attributes. Distances
    are those of quadrics (M. Garland, P. S. Heckbert, "Surface Simplification Using Quadric Error
    Metrics", 1997).

    Parameters
    ----------
    vertices : float64 array of shape (V, 3)
    faces : integer array of shape (M, 3)
    wedges : integer array of shape (M, 3)
        Corners of a vertex have the same number if they have the same attributes. Edges where these
        differ do not move; neither do boundaries.
    max_rms : float
        Maximum root mean square distance over the surface.
    max_distance : float
        Maximum root mean square distance around one vertex.
    max_length : float
        Edges may not grow beyond this length.
    weights : float64 array of shape (V,), optional
        Weights of the squared distances at each vertex, above 0. Default: 1.

    Returns
    -------
    int32 array of shape (N, 3)
        The remaining faces, as indices of the input vertices.
    int32 array of shape (N, 3)
        Their wedges.
    """
    faces, wedges = faces.astype(np.int32), wedges.astype(np.int32)
    n_remaining = call(
        "reel_decimate",
        np.ascontiguousarray(vertices, np.float64),
        np.ones(len(vertices)) if weights is None else np.ascontiguousarray(weights, np.float64),
        len(vertices),
        faces,
        wedges,
        len(faces),
        max_rms,
        max_distance,
        max_length,
        noun="faces",
        memory_of=("reel_decimate_memory", len(vertices), len(faces)),
    )
    return int32s(faces[:n_remaining]), int32s(wedges[:n_remaining])
