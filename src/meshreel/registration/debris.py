"""Debris of scans: small components that neither the frame before theirs nor the one after has."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.kernel.closest import TriangleTree
from meshreel.metrics.closest_points import k_d_tree
from meshreel.model.geometry.connectivity import face_components
from meshreel.registration.cleaning import CleanMesh
from meshreel.registration.triangle_mesh import Indices, TriangleMesh

Mask = npt.NDArray[np.bool_]

MAX_DEBRIS_AREA = 0.05
"""Largest area of the debris of a frame, as a share of its surface: more is no debris."""

MIN_FRAMES = 3
"""A component is no debris if this many frames in a row have it."""

MIN_SHARE = 0.5
"""A frame has a component if it has surface near this share of it."""

MIN_COSINE = 0.5
"""Smallest cosine between the normals of a component and of that surface."""

REACH = 2.0
"""Largest distance to that surface, in radii of a sphere of the component's area; half of it to
small components."""

MAX_MOTION = 16.0
"""Largest motion between frames, in these radii, of a component that moves steadily."""

MAX_TURN = 0.25
"""Largest change of this motion, as a share of it; a change of one radius is allowed, too."""

MAX_AREA_RATIO = 2.0
"""Largest ratio between the areas of such a component in two frames."""

N_CANDIDATES = 8
"""Number of nearest components of the next frame that may continue a motion."""


class _Frame:
    """A frame, and of its components: labels of faces, areas, centroids, and radii of spheres."""

    def __init__(self, mesh: TriangleMesh) -> None:
        self.mesh, self.labels = mesh, face_components(mesh.faces, len(mesh.vertices))
        moments = (mesh.areas[:, None] * mesh.centroids).T
        self.areas, *sums = (np.bincount(self.labels, sizes) for sizes in (mesh.areas, *moments))
        self.centroids: Floats = np.stack(sums, axis=1) / self.areas[:, None]
        self.radii: Floats = np.sqrt(self.areas / (4 * np.pi))
        self.is_small: Mask = self.areas <= MAX_DEBRIS_AREA * self.areas.sum()


def debris_faces(get_mesh: Callable[[int], CleanMesh | None], number: int) -> Mask:
    """Return whether each face of a frame belongs to debris, of shape (M,).

    A small component is no debris if three frames have it, or two at an end of the sequence. A
    frame has it if there is surface near most of it, as where it moves slowly; it may be a part of
    more, as where it merges, or where holes cut it off. Or it moves steadily.

    Parameters
    ----------
    get_mesh : callable
        Returns a frame with its debris; None for numbers before the first and after the last.
    """

    def load(step: int) -> _Frame | None:
        mesh = get_mesh(number + step)
        if mesh is None or mesh.is_empty:
            return None
        return _Frame(TriangleMesh(mesh.vertices, mesh.faces))

    own = load(0)
    if own is None or not own.is_small.any():
        return np.zeros(0 if own is None else len(own.labels), bool)
    others = {step: other for step in (-2, -1, 1, 2) if (other := load(step))}
    neighbors = {-1, 1} & set(others)
    n_frames = np.full(len(own.areas), MIN_FRAMES - len(neighbors))  # with those beyond an end
    for step in neighbors:
        other, beyond = others[step], others.get(2 * step)
        found = _counterparts(own, own.is_small, other)
        continues = ~other.is_small
        if beyond:
            is_found = np.isin(np.arange(len(continues)), found)
            continues |= _counterparts(other, other.is_small & is_found, beyond) >= 0
        n_frames += np.where(found >= 0, 1 + (continues[found] if beyond else 1), 0)
    is_debris = own.is_small & (n_frames < MIN_FRAMES)
    for first, second in ((-1, -2), (-1, 1), (1, 2)):
        if is_debris.any() and first in others and second in others:
            is_debris &= ~_move_steadily(own, others[first], others[second], second / first)
    is_debris &= own.areas[is_debris].sum() <= MAX_DEBRIS_AREA * own.areas.sum()
    return np.asarray(is_debris[own.labels])


def _counterparts(own: _Frame, chosen: Mask, other: _Frame) -> Indices:
    """Return the largest component of another frame near most of each chosen one, else -1, (C,)."""
    faces = np.flatnonzero(chosen[own.labels])
    labels, found = own.labels[faces], np.full(len(own.areas), -1)
    reach = REACH * own.radii[labels]
    sign = -1 if own.mesh.orientation * other.mesh.orientation < 0 else 1
    directions = sign / MIN_COSINE * own.mesh.face_normals[faces]
    tree = TriangleTree(other.mesh.vertices, other.mesh.faces)
    closest = tree.closest(own.mesh.centroids[faces], directions, reach.max(initial=0.0))
    counterparts = other.labels[closest.faces]
    near = np.flatnonzero(
        closest.distances <= np.where(other.is_small, 0.5, 1)[counterparts] * reach
    )
    areas = np.bincount(labels[near], own.mesh.areas[faces[near]], len(own.areas))
    counterparts = counterparts[near]
    order = np.argsort(other.areas[counterparts], kind="stable")
    found[labels[near[order]]] = counterparts[order]  # the last one, which is the largest, stays
    found[areas <= MIN_SHARE * own.areas] = -1
    return found


def _move_steadily(own: _Frame, first: _Frame, second: _Frame, ratio: float) -> Mask:
    """Return whether each component has counterparts at steadily changing places, of shape (C,).

    `ratio` is the step from the frame to the second one, relative to the first one.
    """
    reach, places = MAX_MOTION * own.radii[:, None], own.centroids[:, None]
    lengths, near = k_d_tree(first.centroids).query(
        own.centroids, np.arange(1, N_CANDIDATES + 1), distance_upper_bound=reach.max()
    )
    near = np.minimum(near, len(first.areas) - 1)  # it is one more where there is none
    expected = places + ratio * (first.centroids[near] - places)
    gaps, next_ = k_d_tree(second.centroids).query(expected)
    is_steady = (lengths <= reach) & (gaps <= own.radii[:, None] + MAX_TURN * lengths)
    areas = np.broadcast_arrays(own.areas[:, None], first.areas[near], second.areas[next_])
    is_similar = np.ptp(np.log(areas), axis=0) <= np.log(MAX_AREA_RATIO)
    return np.asarray((is_steady & is_similar).any(axis=1))
