"""How far a registered mesh is from its raw frame, and whether that is within the tolerance."""

from dataclasses import astuple, dataclass, replace

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.codec.targets import DEFAULT_QUALITY
from meshreel.kernel.closest import Closest
from meshreel.model.geometry.connectivity import lowest_connected
from meshreel.registration.refining import subdivided
from meshreel.registration.triangle_mesh import Indices, TriangleMesh
from meshreel.runtime.threads import in_threads

MIN_SHARE_WITHIN = 0.99
"""Share of the area of both surfaces that must be within the tolerance of the other one."""

PATCH_SIDE = 10.0
"""Side, in tolerances, of the square whose area no connected patch beyond it may exceed."""

MAX_UNSUPPORTED = 0.25
"""Largest share of the registered surface that a frame may lack."""

MIN_OUTLINE = 0.25
"""A region is a hole of the raw surface if this share of its outline is at the boundary of it."""

MIN_COSINE = 0.5
"""Smallest cosine between the normals of a registered point and the raw surface that it is on."""

SPACING = 6.0
"""Longest edge, in tolerances, between vertices at which distances are measured."""

COARSE_FACTOR = 2.0
"""Factor of `SPACING` in a first check of coarse meshes."""

CERTAIN_EXCESS = 1.25
"""Error in that check, in tolerances, that needs no second one: it was at most 1.8 times the error
of the second one, and never above this where that met the tolerance (277 fits to noisy frames)."""

PRECISION = 0.01
"""Precision of `FrameErrors.min_tolerance`, in tolerances."""

MIN_AREA_OF_COARSE = 2.0
"""Minimum mean area of the faces of a coarse mesh, in squares of `SPACING`."""


@dataclass(frozen=True)
class Tolerance:
    """The largest distance between a registered mesh and its raw frame.

    99 % of both surfaces are within it, and no connected patch beyond it is larger than a
    square whose side is ten times the tolerance. The registered surface may continue where the raw
    one ends, as at holes of a scan, and below a closed raw surface, as between bodies that touch:
    neither counts as a distance.

    Attributes
    ----------
    length : float
        In the unit of the positions.
    quality : float
        Quality at which the result is coded; keys keep more vertices for a higher one.
    """

    length: float
    quality: float = DEFAULT_QUALITY

    @property
    def patch_area(self) -> float:
        """Largest area of a patch beyond the tolerance."""
        return (PATCH_SIDE * self.length) ** 2


@dataclass(frozen=True)
class FrameErrors:
    """Distances between two surfaces; each figure is that of the worse direction.

    Attributes
    ----------
    mean, p95, p99, largest : float
        Distances of samples, weighted by area: the vertices and face centroids, after longer edges
        than `SPACING` are split. Between them, `patch_area` takes distances as linear.
    mean_square, total_mean_square : float
        Mean of the squared distances, and that of the whole surface, `unsupported` parts included.
    patch_area : float
        Area of the largest connected region beyond the tolerance.
    unsupported : float
        Share of the registered surface that is beyond the boundary of the raw one, or below it by
        more than the tolerance where it is closed.
    min_tolerance : float
        Smallest tolerance that these distances meet; infinite if they exceed the given one.
    """

    mean: float
    p95: float
    p99: float
    largest: float
    mean_square: float
    total_mean_square: float
    patch_area: float
    unsupported: float
    min_tolerance: float

    def in_tolerances(self, tolerance: Tolerance) -> float:
        """Return the factor by which the tolerance must grow to be just met."""
        if self.unsupported > MAX_UNSUPPORTED:
            return float("inf")
        patch_side = np.sqrt(self.patch_area / tolerance.patch_area)
        return float(max(self.p99 / tolerance.length, patch_side))

    def exceeds(self, tolerance: Tolerance) -> str:
        """Return why the tolerance is not met; empty if it is."""
        if self.unsupported > MAX_UNSUPPORTED:
            return f"it lacks {100 * self.unsupported:.2g} % of the surface"
        if self.p99 > tolerance.length:
            return (
                f"1 % of the surface is farther than {self.p99 / tolerance.length:.2g} tolerances"
            )
        if self.patch_area > tolerance.patch_area:
            side = self.patch_area**0.5 / tolerance.length
            return f"a patch of {side:.2g} x {side:.2g} tolerances is farther than the tolerance"
        return ""


def check(mesh: TriangleMesh, target: TriangleMesh, tolerance: Tolerance) -> FrameErrors:
    """Measure a registered mesh; with fewer samples if those clearly exceed the tolerance."""
    spacing = SPACING * tolerance.length
    if mesh.areas.mean() > MIN_AREA_OF_COARSE * spacing**2:
        errors = measure(mesh, target, tolerance, COARSE_FACTOR * spacing)
        if errors.in_tolerances(tolerance) > CERTAIN_EXCESS:
            return errors
    return measure(mesh, target, tolerance)


def measure(
    mesh: TriangleMesh, target: TriangleMesh, tolerance: Tolerance, spacing: float | None = None
) -> FrameErrors:
    """Measure a registered mesh against the surface of its frame.

    `spacing` is the longest edge between vertices at which distances are measured.
    """
    spacing = SPACING * tolerance.length if spacing is None else spacing

    def errors(may_end: bool) -> FrameErrors:
        surfaces = (mesh, target) if may_end else (target, mesh)
        return _one_way(*surfaces, tolerance, spacing, may_end)

    forward, backward = in_threads(errors, [True, False])
    return FrameErrors(*map(max, astuple(forward), astuple(backward)))


def one_way(mesh: TriangleMesh, target: TriangleMesh, tolerance: Tolerance) -> FrameErrors:
    """Measure a registered mesh where its frame has surface."""
    spacing = SPACING * tolerance.length
    return _one_way(mesh, target, tolerance, spacing, may_end=True)


def _one_way(
    mesh: TriangleMesh, target: TriangleMesh, tolerance: Tolerance, spacing: float, may_end: bool
) -> FrameErrors:
    """Return the errors in one direction.

    If the target may end, what is beyond its boundary, or hidden below it, is unsupported.
    """
    mesh = subdivided(mesh, spacing)
    points = np.concatenate([mesh.vertices, mesh.centroids])
    closest = target.closest(points)
    # These weights integrate polynomials of degree 2 over each face exactly.
    areas, distances = (
        np.concatenate([0.25 * mesh.vertex_areas, 0.75 * mesh.areas]),
        closest.distances,
    )
    area = areas.sum()
    total_mean_square = float(np.average(distances**2, weights=areas)) if area else 0.0
    if may_end:
        ends = unsupported(mesh, target, closest, tolerance)
        distances, areas = np.where(ends, 0.0, distances), np.where(ends, 0.0, areas)
    if not areas.any():
        return FrameErrors(*[*5 * [0.0], total_mean_square, 0.0, 1.0, 0.0])
    p95, p99 = _quantiles(distances, areas, (0.95, MIN_SHARE_WITHIN))
    patch_area = largest_patch(mesh, distances - tolerance.length)
    errors = FrameErrors(
        float(np.average(distances, weights=areas)),
        p95,
        p99,
        float(distances.max()),
        float(np.average(distances**2, weights=areas)),
        total_mean_square,
        patch_area,
        float(1 - areas.sum() / area),
        float("inf"),
    )
    if errors.exceeds(tolerance):
        return errors
    return replace(errors, min_tolerance=_min_tolerance(mesh, distances, p99, tolerance))


def unsupported(
    mesh: TriangleMesh, target: TriangleMesh, closest: Closest, tolerance: Tolerance
) -> npt.NDArray[np.bool_]:
    """Return whether the raw surface lacks the vertices and centroids of a registered mesh.

    They are beyond the boundary of the raw surface, or hidden below it. A region beyond the
    tolerance is a hole if enough of its outline is beyond the boundary: inside, another part of the
    body may be nearer, or a fingertip may be high above the cut. Where it touches a surface of
    another direction, as a missing hand the hip, the region continues.

    Parameters
    ----------
    closest : Closest
        The closest points of the raw surface, of vertices and then centroids.
    """
    points = np.concatenate([mesh.vertices, mesh.centroids])
    is_unsupported = target.ends_before(points, closest)
    is_far = closest.distances > tolerance.length
    beyond = np.flatnonzero(is_far & ~is_unsupported)
    if len(beyond):
        holes = is_unsupported
        if is_unsupported.any():
            normals = np.concatenate([mesh.vertex_normals, mesh.face_normals])
            cosines = np.einsum("nc,nc->n", normals, target.face_normals[closest.faces])
            holes = _regions_within(mesh, is_far | (cosines < MIN_COSINE), is_unsupported)
        is_unsupported[beyond] = holes[beyond] | target.encloses(points[beyond], closest.at(beyond))
    return is_unsupported


def _regions_within(
    mesh: TriangleMesh, is_inside: npt.NDArray[np.bool_], is_outline: npt.NDArray[np.bool_]
) -> npt.NDArray[np.bool_]:
    """Return the connected regions with enough of an outline, of shape (V + M,)."""
    _, first, second = _links(mesh, is_inside)
    is_internal = is_inside[first] & is_inside[second]
    regions = lowest_connected(len(is_inside), first[is_internal], second[is_internal])
    crossing = np.flatnonzero(is_inside[first] != is_inside[second])
    first, second = first[crossing], second[crossing]
    owners = regions[np.where(is_inside[first], first, second)]
    n_links = np.bincount(owners, minlength=len(is_inside))
    n_outline = np.bincount(owners, is_outline[first] | is_outline[second], len(is_inside))
    return np.asarray(is_inside & (n_outline > MIN_OUTLINE * n_links)[regions])


def _links(
    mesh: TriangleMesh, is_chosen: npt.NDArray[np.bool_]
) -> tuple[Indices, Indices, Indices]:
    """Return faces with chosen samples, and the ends of the sides of their parts.

    A face has three parts, of shape (3 N, 3) in all: two corners and the centroid.
    """
    n_verts = len(mesh.vertices)
    is_touched = is_chosen[mesh.faces].any(axis=1) | is_chosen[n_verts:]
    numbers = np.flatnonzero(is_touched)
    corners, centroids = mesh.faces[numbers], np.repeat(n_verts + numbers, 3).reshape(-1, 3)
    parts = np.stack([corners, np.roll(corners, -1, axis=1), centroids], axis=2).reshape(-1, 3)
    return numbers, parts.ravel(), np.roll(parts, -1, axis=1).ravel()


def _quantiles(values: Floats, weights: Floats, shares: tuple[float, float]) -> tuple[float, float]:
    """Return the values that these shares of the weight do not exceed."""
    order = np.argsort(values)
    cumulative = np.cumsum(weights[order])
    ranks = np.searchsorted(cumulative, np.multiply(shares, cumulative[-1]))
    low, high = values[order[np.minimum(ranks, len(values) - 1)]]
    return float(low), float(high)


def largest_patch(mesh: TriangleMesh, values: Floats) -> float:
    """Return the area of the largest connected region where interpolated values are positive.

    Parameters
    ----------
    values : float64 array of shape (V + M,)
        At the vertices, and at the centroids of the faces; linear in the three parts of each face
        around its centroid.
    """
    is_positive = values > 0
    if not is_positive.any():
        return 0.0
    numbers, first, second = _links(mesh, is_positive)
    parts, areas = first.reshape(-1, 3), np.repeat(mesh.areas[numbers] / 3, 3)
    is_internal = is_positive[first] & is_positive[second]
    regions = lowest_connected(len(values), first[is_internal], second[is_internal])
    highest = np.take_along_axis(parts, values[parts].argmax(axis=1)[:, np.newaxis], axis=1)[:, 0]
    return float(
        np.bincount(regions[highest], areas * _positive_share(values[parts])).max(initial=0.0)
    )


def _min_tolerance(
    mesh: TriangleMesh, distances: Floats, p99: float, tolerance: Tolerance
) -> float:
    """Return the smallest tolerance that is met, from the 99 % quantile up to the given one.

    Parameters
    ----------
    distances : float64 array of shape (V + M,)
        At the vertices, and at the centroids of the faces.
    """
    numbers, _, _ = _links(mesh, distances > p99)
    part = TriangleMesh(mesh.vertices, mesh.faces[numbers])
    n_verts = len(mesh.vertices)
    distances = np.concatenate([distances[:n_verts], distances[n_verts + numbers]])
    low, high, candidate = p99, tolerance.length, p99
    while high - low > PRECISION * tolerance.length:
        if largest_patch(part, distances - candidate) > Tolerance(candidate).patch_area:
            low = candidate
        else:
            high = candidate
        candidate = (low + high) / 2
    return high


def _positive_share(values: Floats) -> Floats:
    """Return the share of each triangle where values are positive, given those at its corners."""
    low, middle, high = np.sort(values, axis=1).T
    with np.errstate(divide="ignore", invalid="ignore"):
        tip = high**2 / ((high - middle) * (high - low))
        rest = 1 - low**2 / ((middle - low) * (high - low))
    return np.select([high <= 0, low >= 0, middle > 0], [0.0, 1.0, rest], tip)
