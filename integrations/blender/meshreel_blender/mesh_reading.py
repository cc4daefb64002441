"""Read the evaluated mesh of an object at the current frame, in world space."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.surfaces.hard_edges import find_hard_edges
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.colors import colors_of_linear
from meshreel.model.geometry.hard_edges import next_corners, remaining_edges
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Surface

from .mesh_building import MATERIALS

Matrix = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MeshReading:
    """Reads the meshes of one object in the same way in every frame.

    Parameters
    ----------
    obj : bpy.types.Object
    axes : float64 array of shape (3, 3)
        Transform from world space to the axes of the file.
    is_mirrored : bool
        Whether the object's transform mirrors it: faces are turned round then, so that they look
        the same way.
    """

    obj: Any
    axes: Matrix
    is_mirrored: bool

    def frame(self, depsgraph: Any) -> PolygonMesh:
        """Read the mesh at the frame of an evaluated depsgraph."""
        with _evaluated(self.obj, depsgraph) as mesh:
            return PolygonMesh(
                _positions(mesh, self.axes, self.obj.evaluated_get(depsgraph).matrix_world),
                _counts(mesh),
                self._corners(mesh, _ints(mesh.loops, "vertex_index")),
            )

    def surface(self, depsgraph: Any) -> Surface:
        """UV maps, color attributes, materials and hard edges, without face sizes."""
        with _evaluated(self.obj, depsgraph, with_all_layers=True) as mesh:
            uvs = [
                Attribute(layer.name, Kind.UV, Domain.CORNER, self._corners(mesh, _uv(layer)))
                for layer in mesh.uv_layers
            ]
            colors = [self._color(mesh, layer) for layer in mesh.color_attributes]
            hard_edges = self._hard_edges(mesh)
            materials = _materials(self.obj, mesh)
            return Surface(None, (*uvs, *colors), materials, hard_edges=hard_edges)

    def _hard_edges(self, mesh: Any) -> npt.NDArray[np.int32] | None:
        """Sharp edges and edges of flat faces, or edges split by custom normals."""
        counts, corners = _counts(mesh), _ints(mesh.loops, "vertex_index")
        if not len(counts):
            return None
        if mesh.has_custom_normals:
            positions = _floats(mesh.attributes["position"].data, "vector", 3)
            normals = _floats(mesh.corner_normals, "vector", 3)
            return find_hard_edges(PolygonMesh(positions, counts, corners), normals).edges
        ends = _ints_of(mesh.edges, "vertices", 2)[_flags(mesh.edges, "use_edge_sharp")]
        is_flat = ~_flags(mesh.polygons, "use_smooth")
        sides = np.stack([corners, corners[next_corners(counts)]], axis=1)
        sharp = np.concatenate([ends, sides[np.repeat(is_flat, counts)]])
        # Blender also marks boundary edges, which cannot be hard.
        return remaining_edges(sharp, counts, corners) if len(sharp) else None

    def _color(self, mesh: Any, layer: Any) -> Attribute:
        is_bytes = layer.data_type == "BYTE_COLOR"
        values = _floats(layer.data, "color_srgb" if is_bytes else "color", 4)
        values = np.rint(values * 255).astype(np.uint8) if is_bytes else colors_of_linear(values)
        if layer.domain == "POINT":
            return Attribute(layer.name, Kind.COLOR, Domain.VERTEX, values)
        return Attribute(layer.name, Kind.COLOR, Domain.CORNER, self._corners(mesh, values))

    def _corners(self, mesh: Any, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Values of corners in the order of the file."""
        return values[_turned(_counts(mesh))] if self.is_mirrored else values


def mesh_reading(obj: Any, depsgraph: Any, axes: Matrix) -> MeshReading:
    """Create the reader of an object from its transform at the frame of the depsgraph."""
    matrix = _matrix(obj.evaluated_get(depsgraph).matrix_world)
    return MeshReading(obj, axes, bool(np.linalg.det(matrix[:3, :3]) < 0))


@contextmanager
def _evaluated(obj: Any, depsgraph: Any, *, with_all_layers: bool = False) -> Iterator[Any]:
    evaluated = obj.evaluated_get(depsgraph)
    try:
        yield evaluated.to_mesh(preserve_all_data_layers=with_all_layers, depsgraph=depsgraph)
    finally:
        evaluated.to_mesh_clear()


def _positions(mesh: Any, axes: Matrix, matrix_world: Any) -> npt.NDArray[np.float32]:
    if not mesh.vertices:  # an empty mesh lacks the attribute
        return np.empty((0, 3), np.float32)
    matrix = _matrix(matrix_world)
    own = _floats(mesh.attributes["position"].data, "vector", 3).astype(np.float64)
    world = own @ matrix[:3, :3].T + matrix[:3, 3]
    return (world @ axes.T).astype(np.float32)


def _materials(obj: Any, mesh: Any) -> tuple[FaceGroups, ...]:
    """Material of each face as a face group; -1 for empty slots."""
    materials = list(mesh.materials)
    for number, slot in enumerate(obj.material_slots[: len(materials)]):
        if slot.link == "OBJECT":
            materials[number] = slot.material
    labels = tuple(dict.fromkeys(one.name for one in materials if one))
    if not labels:
        return ()
    groups = [labels.index(one.name) if one else -1 for one in materials]
    slots = _ints(mesh.polygons, "material_index").clip(0, len(groups) - 1)
    return (FaceGroups(MATERIALS, labels, np.array(groups, np.int32)[slots]),)


def _turned(counts: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Permutation of corners that reverses each face and keeps its first corner."""
    starts = np.cumsum(counts) - counts
    within = np.arange(int(counts.sum())) - np.repeat(starts, counts)
    return np.repeat(starts, counts) + -within % np.repeat(counts, counts)


def _matrix(matrix: Any) -> Matrix:
    return np.array(matrix, np.float64)


def _counts(mesh: Any) -> npt.NDArray[np.int64]:
    return _ints(mesh.polygons, "loop_total").astype(np.int64)


def _uv(layer: Any) -> npt.NDArray[np.float32]:
    return _floats(layer.uv, "vector", 2)


def _ints(items: Any, name: str) -> npt.NDArray[np.int32]:
    return _ints_of(items, name, 1)[:, 0]


def _ints_of(items: Any, name: str, width: int) -> npt.NDArray[np.int32]:
    values = np.empty(len(items) * width, np.int32)
    items.foreach_get(name, values)
    return values.reshape(-1, width)


def _flags(items: Any, name: str) -> npt.NDArray[np.bool_]:
    values = np.empty(len(items), bool)
    items.foreach_get(name, values)
    return values


def _floats(items: Any, name: str, width: int) -> npt.NDArray[np.float32]:
    values = np.empty(len(items) * width, np.float32)
    items.foreach_get(name, values)
    return values.reshape(-1, width)
