"""Cubes, spheres and other primitives of USD as meshes, in local space.

Corners and faces of cubes and planes are in the order of UsdImaging, so that colors per face or
corner match. Round primitives consist of rings around their axis.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import FormatError
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.formats.usd.sampling import sample_codes
from meshreel.model.geometry.hard_edges import shared_edges
from meshreel.model.sequence import Vertices

Sizes = dict[str, float]
Faces = tuple[npt.NDArray[np.int64], npt.NDArray[np.int32]]

CUBE_CORNERS = [
    (1, 1, 1), (-1, 1, 1), (-1, -1, 1), (1, -1, 1),
    (-1, -1, -1), (-1, 1, -1), (1, 1, -1), (1, -1, -1),
]  # fmt: skip
CUBE_FACES = [0, 1, 2, 3, 4, 5, 6, 7, 0, 6, 5, 1, 4, 7, 3, 2, 0, 3, 7, 6, 4, 2, 1, 5]

N_ARCS = 8
"""Number of arcs from the equator of a sphere to a pole."""

N_AROUND = 32
"""Number of points in a ring."""


@dataclass(frozen=True)
class Primitive:
    """A primitive type.

    Parameters
    ----------
    sizes : tuple of str
        Names of its size attributes.
    points : function of the sizes and the axis
        Returns points around the z axis.
    corners : list of int, optional
        Corners of its quads. Default: it is round, and its faces approximate a curved surface.
    n_rims : int
        Number of rings, from the bottom, at which a flat end begins.
    """

    sizes: tuple[str, ...]
    points: Callable[[Sizes, str], Floats]
    corners: list[int] | None = None
    n_rims: int = 0

    @property
    def is_round(self) -> bool:
        """Whether its points are rings around its axis."""
        return self.corners is None

    def faces(self, n_points: int) -> Faces:
        """Return counts and corners of its faces."""
        if self.corners is None:
            return revolved_faces((n_points - 2) // N_AROUND)
        return np.full(len(self.corners) // 4, 4, np.int64), np.array(self.corners, np.int32)


def _cube(sizes: Sizes, axis: str) -> Floats:
    return np.array(CUBE_CORNERS) * (sizes["size"] / 2)


def _plane(sizes: Sizes, axis: str) -> Floats:
    """Return a plane, with width along z and length along y around x, or x and z around y."""
    spans = (sizes["width"], sizes["length"])
    along = spans if axis == "Z" else spans[::-1]
    return np.array([(1, 1, 0), (-1, 1, 0), (-1, -1, 0), (1, -1, 0)]) * [*along, 0] / 2


def _sphere(sizes: Sizes, axis: str) -> Floats:
    radius, angles = sizes["radius"], np.linspace(-np.pi / 2, np.pi / 2, 2 * N_ARCS + 1)[1:-1]
    return revolve(radius * np.cos(angles), radius * np.sin(angles), -radius, radius)


def _cylinder(sizes: Sizes, axis: str) -> Floats:
    half = sizes["height"] / 2
    return revolve(np.array(_radii(sizes)), np.array([-half, half]), -half, half)


def _cone(sizes: Sizes, axis: str) -> Floats:
    half = sizes["height"] / 2
    return revolve(np.array([sizes["radius"]]), np.array([-half]), -half, half)


def _capsule(sizes: Sizes, axis: str) -> Floats:
    half, (low, high) = sizes["height"] / 2, _radii(sizes)
    angles = np.linspace(0, np.pi / 2, N_ARCS, endpoint=False)
    radii = np.concatenate([low * np.cos(angles[::-1]), high * np.cos(angles)])
    heights = [-half - low * np.sin(angles[::-1]), half + high * np.sin(angles)]
    return revolve(radii, np.concatenate(heights), -half - low, half + high)


def _radii(sizes: Sizes) -> tuple[float, float]:
    """Return the radii at the bottom and at the top."""
    both = sizes.get("radius", 0.0)
    return sizes.get("radiusBottom", both), sizes.get("radiusTop", both)


def revolve(radii: Floats, heights: Floats, bottom: float, top: float) -> Floats:
    """Return points of shape (V, 3): bottom pole, rings from bottom to top, top pole.

    Parameters
    ----------
    radii, heights : float64 array of shape (R,)
        Radii and heights of the rings.
    bottom, top : float
        Heights of the poles on the axis; for a flat end, the height of its ring.
    """
    angles = np.arange(N_AROUND) * (2 * np.pi / N_AROUND)
    points = np.empty((len(radii), N_AROUND, 3))
    points[..., :2] = radii[:, np.newaxis, np.newaxis] * np.stack(
        [np.cos(angles), np.sin(angles)], 1
    )
    points[..., 2] = heights[:, np.newaxis]
    return np.concatenate([[[0.0, 0.0, bottom]], points.reshape(-1, 3), [[0.0, 0.0, top]]])


def revolved_faces(n_rings: int) -> Faces:
    """Return counts and corners of the faces, counterclockwise from outside.

    There are triangles at the poles and quads between rings. Flat ends are triangles around a pole
    too: the fan of a single polygon would shade its first corner differently.
    """
    around = np.arange(N_AROUND)
    after, pole = np.roll(around, -1), np.zeros_like(around)
    low, high = 1, 1 + N_AROUND * (n_rings - 1)
    faces = [np.stack([pole, low + after, low + around], 1)]
    for ring in range(low, high, N_AROUND):
        above = ring + N_AROUND
        faces.append(np.stack([ring + around, ring + after, above + after, above + around], 1))
    faces.append(np.stack([pole + high + N_AROUND, high + around, high + after], 1))
    counts = np.concatenate([np.full(len(face), face.shape[1], np.int64) for face in faces])
    return counts, np.concatenate([face.ravel() for face in faces]).astype(np.int32)


ENDS = ("radiusBottom", "radiusTop", "height")
PRIMITIVES = {
    "Cube": Primitive(("size",), _cube, CUBE_FACES),
    "Plane": Primitive(("width", "length"), _plane, [0, 1, 2, 3]),
    "Sphere": Primitive(("radius",), _sphere),
    "Cylinder": Primitive(("radius", "height"), _cylinder, n_rims=2),
    "Cylinder_1": Primitive(ENDS, _cylinder, n_rims=2),
    "Cone": Primitive(("radius", "height"), _cone, n_rims=1),
    "Capsule": Primitive(("radius", "height"), _capsule),
    "Capsule_1": Primitive(ENDS, _capsule),
}
"""Primitive types by name."""

AXIS_ROLLS = {"X": 1, "Y": -1, "Z": 0}
"""Rotation of the coordinate order that turns the z axis into another axis."""


@dataclass(frozen=True, eq=False)
class PrimitiveShape:
    """Points and faces of a primitive in local space; the counterpart of `MeshShape`.

    Parameters
    ----------
    prim : Usd.Prim
        Of a type in `PRIMITIVES`.
    """

    prim: Any

    has_constant_topology = True
    is_left_handed = False
    is_subdivided = False

    @property
    def kind(self) -> str:
        """The type name of the prim."""
        return str(self.prim.GetTypeName())

    @property
    def stored(self) -> list[float]:
        """Time codes of stored points, which a primitive does not have."""
        return []

    @property
    def keys(self) -> list[float]:
        """Time codes where its sizes have samples."""
        return sample_codes(self.prim, PRIMITIVES[self.kind].sizes)

    def points(self, code: float) -> Vertices:
        """Return the points at a time code, of shape (V, 3).

        Raises
        ------
        FormatError
            If a size is not a number.
        """
        primitive, sizes = PRIMITIVES[self.kind], {}
        for name in primitive.sizes:
            sizes[name] = value = self.prim.GetAttribute(name).Get(code)
            if not isinstance(value, int | float):
                path = self.prim.GetPath()
                raise FormatError(
                    f"{self.kind} {path} has no number as {name} at time code {code:g}"
                )
        axis = str(self.prim.GetAttribute("axis").Get()) if self.prim.HasAttribute("axis") else "Z"
        with np.errstate(all="ignore"):  # non-finite values are reported when frames are checked
            around_z = primitive.points(sizes, axis)
            points: Vertices = np.roll(around_z, AXIS_ROLLS.get(axis, 0), axis=1).astype(np.float32)
        return points

    def polygons(self, vertices: Vertices, code: float) -> PolygonMesh:
        """Return its faces, with these vertices."""
        return PolygonMesh(vertices, *PRIMITIVES[self.kind].faces(len(vertices)))

    def sharp_edges(self, code: float) -> npt.NDArray[np.int64] | None:
        """Return the edges of its flat faces as pairs of vertices, or None without any."""
        primitive = PRIMITIVES[self.kind]
        if not primitive.is_round:
            return shared_edges(*primitive.faces(0)).ends
        around, starts = (
            np.arange(N_AROUND),
            1 + N_AROUND * np.arange(primitive.n_rims)[:, np.newaxis],
        )
        ends = np.stack([starts + around, starts + np.roll(around, -1)], axis=2).reshape(-1, 2)
        return ends if primitive.n_rims else None

    def solid_faces(self, n_faces: int, code: float) -> None:
        """Return None: primitives have no holes."""
        return
