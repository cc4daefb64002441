"""Cubes, spheres and other primitives of USD as meshes, in local space.

Corners and faces of cubes and planes are in the order of UsdImaging, so that colors per face or
corner match. Round primitives consist of rings around their axis.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.formats.usd.sampling import attribute_codes
from meshreel.model.geometry.hard_edges import shared_edges
from meshreel.model.sequence import Vertices

Sizes = dict[str, float]
Points = npt.NDArray[np.float64]
Faces = Callable[[], tuple[npt.NDArray[np.int64], npt.NDArray[np.int32]]]

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
    faces : function
        Returns counts and corners of its faces, which do not depend on the sizes.
    is_round : bool
        Whether the faces approximate a curved surface.
    n_rims : int
        Number of rings, from the bottom, at which a flat end begins.
    """

    sizes: tuple[str, ...]
    points: Callable[[Sizes, str], Points]
    faces: Faces
    is_round: bool = True
    n_rims: int = 0


def _cube(sizes: Sizes, axis: str) -> Points:
    return np.array(CUBE_CORNERS) * (sizes["size"] / 2)


def _plane(sizes: Sizes, axis: str) -> Points:
    """Return a plane, with width along z and length along y around x, or x and z around y."""
    spans = (sizes["width"], sizes["length"])
    along = spans if axis == "Z" else spans[::-1]
    return np.array([(1, 1, 0), (-1, 1, 0), (-1, -1, 0), (1, -1, 0)]) * [*along, 0] / 2


def _sphere(sizes: Sizes, axis: str) -> Points:
    radius, angles = sizes["radius"], np.linspace(-np.pi / 2, np.pi / 2, 2 * N_ARCS + 1)[1:-1]
    return revolve(Rings(radius * np.cos(angles), radius * np.sin(angles), -radius, radius))


def _cylinder(sizes: Sizes, axis: str) -> Points:
    half = sizes["height"] / 2
    return revolve(Rings(np.array(_radii(sizes)), np.array([-half, half]), -half, half))


def _cone(sizes: Sizes, axis: str) -> Points:
    half = sizes["height"] / 2
    return revolve(Rings(np.array([sizes["radius"]]), np.array([-half]), -half, half))


def _capsule(sizes: Sizes, axis: str) -> Points:
    half, (low, high) = sizes["height"] / 2, _radii(sizes)
    angles = np.linspace(0, np.pi / 2, N_ARCS, endpoint=False)
    radii = np.concatenate([low * np.cos(angles[::-1]), high * np.cos(angles)])
    heights = [-half - low * np.sin(angles[::-1]), half + high * np.sin(angles)]
    return revolve(Rings(radii, np.concatenate(heights), -half - low, half + high))


def _radii(sizes: Sizes) -> tuple[float, float]:
    """Return the radii at the bottom and at the top."""
    both = sizes.get("radius", 0.0)
    return sizes.get("radiusBottom", both), sizes.get("radiusTop", both)


def _flat_faces(corners: list[int]) -> Faces:
    return lambda: (np.full(len(corners) // 4, 4, np.int64), np.array(corners, np.int32))


def _round_faces(n_rings: int) -> Faces:
    return lambda: revolved_faces(n_rings)


ENDS = ("radiusBottom", "radiusTop", "height")
PRIMITIVES = {
    "Cube": Primitive(("size",), _cube, _flat_faces(CUBE_FACES), is_round=False),
    "Plane": Primitive(("width", "length"), _plane, _flat_faces([0, 1, 2, 3]), is_round=False),
    "Sphere": Primitive(("radius",), _sphere, _round_faces(2 * N_ARCS - 1)),
    "Cylinder": Primitive(("radius", "height"), _cylinder, _round_faces(2), n_rims=2),
    "Cylinder_1": Primitive(ENDS, _cylinder, _round_faces(2), n_rims=2),
    "Cone": Primitive(("radius", "height"), _cone, _round_faces(1), n_rims=1),
    "Capsule": Primitive(("radius", "height"), _capsule, _round_faces(2 * N_ARCS)),
    "Capsule_1": Primitive(ENDS, _capsule, _round_faces(2 * N_ARCS)),
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
        sizes = map(self.prim.GetAttribute, PRIMITIVES[self.kind].sizes)
        return [code for one in sizes for code in attribute_codes(one)]

    def points(self, code: float) -> Vertices:
        """Return the points at a time code, of shape (V, 3).

        Raises
        ------
        FormatError
            If a size is not a number.
        """
        primitive = PRIMITIVES[self.kind]
        axis = str(self.prim.GetAttribute("axis").Get()) if self.prim.HasAttribute("axis") else "Z"
        sizes = {name: self._size(name, code) for name in primitive.sizes}
        with np.errstate(all="ignore"):  # non-finite values are reported when frames are checked
            around_z = primitive.points(sizes, axis)
            points: Vertices = np.roll(around_z, AXIS_ROLLS.get(axis, 0), axis=1).astype(np.float32)
        return points

    def polygons(self, vertices: Vertices, code: float) -> PolygonMesh:
        """Return its faces, with these vertices."""
        return PolygonMesh(vertices, *PRIMITIVES[self.kind].faces())

    def sharp_edges(self, code: float) -> npt.NDArray[np.int64] | None:
        """Return the edges of its flat faces as pairs of vertices, or None without any."""
        primitive = PRIMITIVES[self.kind]
        if not primitive.is_round:
            return shared_edges(*primitive.faces()).ends
        return rim_edges(primitive.n_rims) if primitive.n_rims else None

    def solid_faces(self, n_faces: int, code: float) -> None:
        """Return None: primitives have no holes."""
        return

    def _size(self, name: str, code: float) -> float:
        value = self.prim.GetAttribute(name).Get(code)
        if not isinstance(value, int | float):
            raise FormatError(
                f"{self.kind} {self.prim.GetPath()} has no number as {name} at time code {code:g}"
            )
        return float(value)


@dataclass(frozen=True, eq=False)
class Rings:
    """The profile of a surface of revolution, from bottom to top.

    Attributes
    ----------
    radii, heights : float64 array of shape (R,)
        Radii and heights of the rings.
    bottom, top : float
        Heights of the poles on the axis; for a flat end, the height of its ring.
    """

    radii: npt.NDArray[np.float64]
    heights: npt.NDArray[np.float64]
    bottom: float
    top: float


def revolve(rings: Rings) -> npt.NDArray[np.float64]:
    """Return points of shape (V, 3): bottom pole, rings from bottom to top, top pole."""
    angles = np.arange(N_AROUND) * (2 * np.pi / N_AROUND)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points = np.empty((len(rings.radii), N_AROUND, 3))
    points[..., :2] = rings.radii[:, np.newaxis, np.newaxis] * circle
    points[..., 2] = rings.heights[:, np.newaxis]
    bottom, top = [[0.0, 0.0, rings.bottom]], [[0.0, 0.0, rings.top]]
    return np.concatenate([bottom, points.reshape(-1, 3), top])


def revolved_faces(n_rings: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int32]]:
    """Return counts and corners of the faces, counterclockwise from outside.

    There are triangles at the poles and quads between rings. Flat ends are triangles around a pole
    too: the fan of a single polygon would shade its first corner differently.
    """
    around = np.arange(N_AROUND)
    after = np.roll(around, -1)
    low, high = 1, 1 + N_AROUND * (n_rings - 1)
    pole = np.zeros_like(around)
    faces = [np.stack([pole, low + after, low + around], 1)]
    for ring in range(low, high, N_AROUND):
        above = ring + N_AROUND
        faces.append(np.stack([ring + around, ring + after, above + after, above + around], 1))
    faces.append(np.stack([pole + high + N_AROUND, high + around, high + after], 1))
    counts = np.concatenate([np.full(len(one), one.shape[1], np.int64) for one in faces])
    return counts, np.concatenate([one.ravel() for one in faces]).astype(np.int32)


def rim_edges(n_rings: int) -> npt.NDArray[np.int64]:
    """Return the edges of the lowest rings as pairs of points, of shape (R * N_AROUND, 2)."""
    around = np.arange(N_AROUND)
    starts = 1 + N_AROUND * np.arange(n_rings)[:, np.newaxis]
    return np.stack([starts + around, starts + np.roll(around, -1)], axis=2).reshape(-1, 2)
