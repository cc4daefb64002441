"""Surface that raw frames lack: its vertices move as in the frames near in time that show it."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.model.geometry.connectivity import component_labels
from meshreel.model.sequence import Faces
from meshreel.registration.fitting import harmonic, uniform_laplacian
from meshreel.registration.graph import rotations_of
from meshreel.registration.triangle_mesh import Indices, TriangleMesh, with_rings
from meshreel.registration.verification import Tolerance, unsupported

Mask = npt.NDArray[np.bool_]

N_NEAR = 8
"""Number of frames on either side whose positions guide the vertices that a frame lacks."""

N_RINGS = 2
"""Rings of vertices around missing surface that move too: the fit pulls them toward its rim."""

VELOCITY_WEIGHTS = 10.0, 0.01
"""Weights of squared velocities, relative to squared accelerations, of a vertex that frames show
only before or only after, and of others: the first stays, the second moves as by a spline."""

ALIGNMENT_STEPS, ALIGNMENT_DAMPING = 6, 0.03
"""Gauss-Newton steps of a rigid motion, and the weight of their squares."""

SCREENING = 0.02
"""Weight of the squared offset of each vertex relative to its Laplacian: an offset decreases over
about seven edges."""

FIXED_WEIGHT = 1e6
"""Weight of the positions in frames that show a vertex."""


def shown_vertices(mesh: TriangleMesh, target: TriangleMesh, tolerance: Tolerance) -> Mask:
    """Return which vertices a raw frame shows, of shape (V,), without rings around the others.

    What bodies that touch hide counts as shown: it fits the surface around it already. So do
    regions smaller than a patch that may be beyond the tolerance.
    """
    n_verts = len(mesh.vertices)
    if not target.is_boundary.any():
        return np.ones(n_verts, bool)
    closest = target.closest(np.concatenate([mesh.vertices, mesh.centroids]))
    is_free = unsupported(mesh, target, closest, tolerance)[:n_verts]
    is_free &= ~target.encloses(mesh.vertices, closest.at(np.arange(n_verts)))
    for region in _regions(mesh.faces, is_free):
        is_free[region] = mesh.vertex_areas[region].sum() > tolerance.patch_area
    return ~with_rings(mesh.faces, is_free, N_RINGS)


def filled_frames(
    positions: Callable[[int], Floats], n_frames: int, faces: Faces, is_shown: Mapping[int, Mask]
) -> Iterator[tuple[int, Floats, Mask]]:
    """Yield frames that lack a part, positions of shape (V, 3) that fill it, and what is unknown.

    The last is a bool array of shape (V,): the vertices that no near frame shows.

    Each region that a frame lacks is interpolated over time from the near frames that show it, once
    these are moved rigidly so that the surface around the region meets that of the frame. The
    offset that remains at its rim decreases over a few edges. What no near frame shows keeps its
    shape.

    Parameters
    ----------
    positions : callable
        Returns the registered positions of a frame, of shape (V, 3).
    faces : int32 array of shape (M, 3)
    is_shown : mapping of int to bool array of shape (V,)
        The vertices that each incomplete frame shows; other frames show all.
    """
    n_verts = len(positions(0))
    laplacian, everything = uniform_laplacian(faces, n_verts), np.ones(n_verts, bool)
    for frame, shown in is_shown.items():
        near = np.arange(max(0, frame - N_NEAR), min(n_frames, frame + N_NEAR + 1))
        near = near[near != frame]
        known = np.array([is_shown.get(number, everything) for number in near.tolist()])
        others = np.array([positions(number) for number in near.tolist()])
        current = positions(frame)
        normals = TriangleMesh(current, faces).vertex_normals
        has_any: Mask = np.asarray(known.any(axis=0))
        filled = current.copy()
        for region in _regions(faces, ~shown):
            is_free = np.isin(np.arange(n_verts), region)
            verts = np.flatnonzero(_surrounded(faces, is_free, shown))
            align = partial(_aligned, current=current[verts], normals=normals[verts])
            places = align(others[:, verts], is_common=(known & shown)[:, verts])
            guess, can = current.copy(), has_any[verts]
            guess[verts[can]] = interpolated(near - frame, places[:, can], known[:, verts[can]])
            guess[verts] = align(guess[None, verts], is_common=shown[None, verts])[0]
            offsets = np.where(is_free[:, None], 0.0, current - guess)
            filled[region] = (guess + harmonic(laplacian, offsets, is_free, SCREENING))[region]
        yield frame, filled, ~(shown | has_any)


def _surrounded(faces: Faces, is_free: Mask, shown: Mask) -> Mask:
    """Return a region with rings around it of at least as many vertices that the frame shows."""
    is_chosen, n_chosen = is_free.copy(), 0
    while n_chosen < (n_chosen := int(is_chosen.sum())):
        if (is_chosen & shown).sum() >= is_free.sum():
            break
        is_chosen = with_rings(faces, is_chosen)
    return is_chosen


def _regions(faces: Faces, is_free: Mask) -> list[Indices]:
    """Return the vertices of each connected region of free vertices."""
    inside = faces[is_free[faces].all(axis=1)]
    verts = np.flatnonzero(is_free)
    labels = component_labels(inside, len(is_free))[verts]
    return [verts[labels == label] for label in np.unique(labels)]


def _aligned(others: Floats, current: Floats, normals: Floats, is_common: Mask) -> Floats:
    """Return positions of other frames after the rigid motions to a frame, of shape (W, N, 3).

    The motions reduce the squared distances of common vertices along the normals: a mesh may have
    slid along its surface (Y. Chen, G. Medioni, "Object Modelling by Registration of Multiple Range
    Images", 1992). Directions that these do not determine keep their place.

    Parameters
    ----------
    others : float64 array of shape (W, N, 3)
    current, normals : float64 arrays of shape (N, 3)
    is_common : bool array of shape (W, N)
        Whether a vertex is known in both frames.
    """
    weights = is_common / np.maximum(is_common.sum(axis=1, keepdims=True), 1)
    center = current.mean(axis=0)
    radius = np.sqrt(np.square(current - center).sum(axis=1).mean()) + 1e-100
    target, moved = (current - center) / radius, (others - center) / radius
    for _ in range(ALIGNMENT_STEPS):
        rows = np.concatenate([np.cross(moved, normals), np.broadcast_to(normals, moved.shape)], 2)
        gaps = np.einsum("nc,wnc->wn", normals, target - moved)
        matrices = np.einsum("wn,wni,wnj->wij", weights, rows, rows) + ALIGNMENT_DAMPING * np.eye(6)
        steps = np.linalg.solve(
            matrices, np.einsum("wn,wni,wn->wi", weights, rows, gaps)[..., None]
        )
        rotations = rotations_of(steps[:, :3, 0])
        moved = moved @ rotations.transpose(0, 2, 1) + steps[:, 3:, 0][:, None]
    return np.asarray(moved * radius + center)


def interpolated(times: Indices, positions: Floats, is_known: Mask) -> Floats:
    """Return positions at time 0 that change smoothly over time, of shape (N, 3).

    The sum of squared accelerations is least, as for a cubic spline.

    Parameters
    ----------
    times : integer array of shape (W,)
        Ascending, without 0.
    positions : float64 array of shape (W, N, 3)
    is_known : bool array of shape (W, N)
        Which positions count, at least one of each vertex.
    """
    span = np.arange(min(times[0], 0), max(times[-1], 0) + 1)
    identity = np.eye(len(span))
    velocities, accelerations = np.diff(identity, axis=0), np.diff(identity, 2, axis=0)
    rows = np.searchsorted(span, times)
    result = np.empty(positions.shape[1:])
    patterns, numbers = np.unique(is_known, axis=1, return_inverse=True)
    for number, pattern in enumerate(patterns.T):
        is_between = times[pattern][0] < 0 < times[pattern][-1]
        weight = VELOCITY_WEIGHTS[int(is_between)]
        smooth = accelerations.T @ accelerations + weight * velocities.T @ velocities
        fixed = np.zeros(len(span))
        fixed[rows] = FIXED_WEIGHT * pattern
        weights = np.linalg.solve(smooth + np.diag(fixed), (span == 0).astype(float)) * fixed
        verts = numbers.ravel() == number
        result[verts] = np.einsum("w,wnc->nc", weights[rows], positions[:, verts])
    return result
