"""How far a registered mesh is from its raw frame, and whether that is within the tolerance."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.model.geometry.hard_edges import lowest_connected
from meshreel.registration.triangle_mesh import TriangleMesh

WITHIN = 0.99
"""Share of the area of both surfaces that must be within the tolerance of the other one."""

PATCH_SIDE = 10.0
"""Side, in tolerances, of the square whose area no connected patch beyond it may exceed."""


@dataclass(frozen=True)
class Tolerance:
    """The largest distance between a registered mesh and its raw frame.

    99 % of both surfaces are within it, and no connected patch of faces beyond it is larger than a
    square whose side is ten times the tolerance.

    Attributes
    ----------
    length : float
        In the unit of the positions.
    """

    length: float

    @property
    def patch_area(self) -> float:
        """Largest area of a patch beyond the tolerance."""
        return (PATCH_SIDE * self.length) ** 2


@dataclass(frozen=True)
class FrameErrors:
    """Distances between two surfaces in both directions; of each figure the worse direction.

    Attributes
    ----------
    mean, p95, p99, largest : float
        Distances of samples: the vertices and face centroids, weighted by area.
    mean_square : float
        Mean of the squared distances.
    patch_area : float
        Area of the largest connected patch of faces whose centroids are beyond the tolerance.
    """

    mean: float
    p95: float
    p99: float
    largest: float
    mean_square: float
    patch_area: float

    def in_tolerances(self, tolerance: Tolerance) -> float:
        """Return by which factor the tolerance should be larger to be just met."""
        patch_side = np.sqrt(self.patch_area / tolerance.patch_area)
        return float(max(self.p99 / tolerance.length, patch_side))

    def exceeds(self, tolerance: Tolerance) -> str:
        """Return why the tolerance is not met; empty if it is."""
        if self.p99 > tolerance.length:
            return (
                f"1 % of the surface is farther than {self.p99 / tolerance.length:.2g} tolerances"
            )
        if self.patch_area > tolerance.patch_area:
            side = self.patch_area**0.5 / tolerance.length
            return f"a patch of {side:.2g} x {side:.2g} tolerances is farther than the tolerance"
        return ""


def measure(mesh: TriangleMesh, target: TriangleMesh, tolerance: Tolerance) -> FrameErrors:
    """Measure a registered mesh against the surface of its frame."""
    ways = _one_way(mesh, target, tolerance), _one_way(target, mesh, tolerance)
    return FrameErrors(*map(max, *ways))


def _one_way(
    mesh: TriangleMesh, target: TriangleMesh, tolerance: Tolerance
) -> tuple[float, float, float, float, float, float]:
    """Return the figures of `FrameErrors` in one direction."""
    of_faces = target.closest(mesh.vertices[mesh.faces].mean(axis=1))
    of_vertices = target.closest(mesh.vertices)
    distances = np.concatenate([of_faces.distances, of_vertices.distances])
    # These weights integrate polynomials of degree 2 over each face exactly.
    areas = np.concatenate([0.75 * mesh.areas, 0.25 * mesh.vertex_areas])
    return (
        float(np.average(distances, weights=areas)),
        *_quantiles(distances, areas, (0.95, WITHIN)),
        float(distances.max()),
        float(np.average(distances**2, weights=areas)),
        largest_patch(mesh, of_faces.distances > tolerance.length),
    )


def _quantiles(values: Floats, weights: Floats, shares: tuple[float, float]) -> tuple[float, float]:
    """Return the values that these shares of the weight do not exceed."""
    order = np.argsort(values)
    reached = np.cumsum(weights[order])
    places = np.searchsorted(reached, np.multiply(shares, reached[-1]))
    low, high = values[order[np.minimum(places, len(values) - 1)]]
    return float(low), float(high)


def largest_patch(mesh: TriangleMesh, is_chosen: npt.NDArray[np.bool_]) -> float:
    """Return the area of the largest set of chosen faces that are connected across sides."""
    if not is_chosen.any():
        return 0.0
    first = np.repeat(np.arange(len(mesh.faces)), 3)
    second = mesh.neighbors
    both = is_chosen[first] & is_chosen[second]
    patches = lowest_connected(len(mesh.faces), first[both], second[both])
    return float(np.bincount(patches[is_chosen], mesh.areas[is_chosen]).max())
