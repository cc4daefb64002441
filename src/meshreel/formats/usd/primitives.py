"""Cubes, spheres and other primitives of USD as meshes, in their own space.

Cubes and planes have their corners and faces in the order that imaging with USD has them, so that
colours of each fit. What is round is made of rings around its axis.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.formats.usd.revolution import Rings, revolved, revolved_faces, rims
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
"""From the equator of a sphere, or of half of one, to its pole."""


@dataclass(frozen=True)
class Primitive:
    """A kind of primitive.

    Parameters
    ----------
    sizes : tuple of str
        The attributes that say how large it is.
    points : function of the sizes and the axis
        Gives points about the axis z.
    faces : function
        Gives the counts and corners of its faces, whatever the sizes.
    is_round : bool
        Whether the faces are only near the surface.
    n_rims : int
        Of round ones, rings at which a flat end begins.
    """

    sizes: tuple[str, ...]
    points: Callable[[Sizes, str], Points]
    faces: Faces
    is_round: bool = True
    n_rims: int = 0


def _cube(sizes: Sizes, axis: str) -> Points:
    return np.array(CUBE_CORNERS) * (sizes["size"] / 2)


def _plane(sizes: Sizes, axis: str) -> Points:
    """About x, the width is along z and the length along y; about y, along x and z."""
    spans = (sizes["width"], sizes["length"])
    along = spans if axis == "Z" else spans[::-1]
    return np.array([(1, 1, 0), (-1, 1, 0), (-1, -1, 0), (1, -1, 0)]) * [*along, 0] / 2


def _sphere(sizes: Sizes, axis: str) -> Points:
    radius, angles = sizes["radius"], np.linspace(-np.pi / 2, np.pi / 2, 2 * N_ARCS + 1)[1:-1]
    return revolved(Rings(radius * np.cos(angles), radius * np.sin(angles), -radius, radius))


def _cylinder(sizes: Sizes, axis: str) -> Points:
    half = sizes["height"] / 2
    return revolved(Rings(np.array(_radii(sizes)), np.array([-half, half]), -half, half))


def _cone(sizes: Sizes, axis: str) -> Points:
    half = sizes["height"] / 2
    return revolved(Rings(np.array([sizes["radius"]]), np.array([-half]), -half, half))


def _capsule(sizes: Sizes, axis: str) -> Points:
    half, (low, high) = sizes["height"] / 2, _radii(sizes)
    angles = np.linspace(0, np.pi / 2, N_ARCS, endpoint=False)
    radii = np.concatenate([low * np.cos(angles[::-1]), high * np.cos(angles)])
    heights = [-half - low * np.sin(angles[::-1]), half + high * np.sin(angles)]
    return revolved(Rings(radii, np.concatenate(heights), -half - low, half + high))


def _radii(sizes: Sizes) -> tuple[float, float]:
    """At the bottom and at the top."""
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
"""By the names of their types."""

TURNS = {"X": 1, "Y": -1, "Z": 0}
"""By how many places coordinates about z move along to be about another axis."""


@dataclass(frozen=True, eq=False)
class PrimitiveShape:
    """The shape of a primitive in its own space, at any time code; as `MeshShape` is for a mesh.

    Parameters
    ----------
    prim : Usd.Prim
        Of one of the types of `PRIMITIVES`.
    """

    prim: Any

    has_one_topology = True
    is_left_handed = False
    is_subdivided = False

    @property
    def kind(self) -> str:
        """The name of its type."""
        return str(self.prim.GetTypeName())

    @property
    def stored(self) -> list[float]:
        """None: no points are stored."""
        return []

    @property
    def keys(self) -> list[float]:
        """The time codes where its sizes have samples."""
        sizes = map(self.prim.GetAttribute, PRIMITIVES[self.kind].sizes)
        return [code for one in sizes for code in attribute_codes(one)]

    def points(self, code: float) -> Vertices:
        """Points at a time code.

        Raises
        ------
        FormatError
            If a size is no number.
        """
        primitive = PRIMITIVES[self.kind]
        axis = str(self.prim.GetAttribute("axis").Get()) if self.prim.HasAttribute("axis") else "Z"
        sizes = {name: self._size(name, code) for name in primitive.sizes}
        with np.errstate(all="ignore"):  # what is not finite is found where frames are looked at
            about_z = primitive.points(sizes, axis)
            points: Vertices = np.roll(about_z, TURNS.get(axis, 0), axis=1).astype(np.float32)
        return points

    def polygons(self, vertices: Vertices, code: float) -> PolygonMesh:
        """Its faces, with these vertices."""
        return PolygonMesh(vertices, *PRIMITIVES[self.kind].faces())

    def sharp_edges(self, code: float) -> npt.NDArray[np.int64] | None:
        """Edges of flat faces, as pairs of vertices; None if it has none."""
        primitive = PRIMITIVES[self.kind]
        if not primitive.is_round:
            return shared_edges(*primitive.faces()).ends
        return rims(primitive.n_rims) if primitive.n_rims else None

    def solid_faces(self, n_faces: int, code: float) -> None:
        """None: no face is a hole."""
        return

    def _size(self, name: str, code: float) -> float:
        value = self.prim.GetAttribute(name).Get(code)
        if not isinstance(value, int | float):
            raise FormatError(
                f"{self.kind} {self.prim.GetPath()} has no number as {name} at time code {code:g}"
            )
        return float(value)
