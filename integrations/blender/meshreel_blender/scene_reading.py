"""Read several objects as parts of one mesh."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.scenes.merging import merge_meshes
from meshreel.formats.scenes.scene_mesh import SceneMesh
from meshreel.formats.surfaces.polygons import PolygonMesh, triangulated
from meshreel.model.notes import Notes
from meshreel.model.surface import Surface

from .mesh_reading import Matrix, mesh_reading


class ExportError(Exception):
    """A scene cannot be exported; the message is one sentence for the user."""


class SceneReading:
    """Objects with the faces of the frame at which this is created.

    Parameters
    ----------
    objects : sequence of bpy.types.Object
        Objects with a surface; at least one.
    context : bpy.types.Context
        The context at the first frame.
    axes : float64 array of shape (3, 3)
        Transform from world space to the axes of the file.
    notes : Notes
        Receives a sentence for each attribute that only some of the objects have.

    Attributes
    ----------
    faces : int32 array of shape (M, 3)
    surface : Surface

    Raises
    ------
    ExportError
        If faces are missing.
    """

    def __init__(self, objects: Sequence[Any], context: Any, axes: Matrix, notes: Notes) -> None:
        depsgraph = context.evaluated_depsgraph_get()
        self._context = context
        self._first_frame: int = context.scene.frame_current
        self._readings = [mesh_reading(obj, depsgraph, axes) for obj in objects]
        self._first = [reading.frame(depsgraph) for reading in self._readings]
        surfaces = [reading.surface(depsgraph) for reading in self._readings]
        names = [obj.name for obj in objects]
        merged, surface = _merged(names, self._first, surfaces, notes)
        if len(merged.counts) == 0:
            raise ExportError(f"{', '.join(names)}: missing faces; a .reel file needs a surface")
        self.faces = triangulated(merged, notes)
        self.surface = replace(surface, face_sizes=merged.counts.astype(np.int32))

    def positions(self) -> npt.NDArray[np.float32]:
        """Read the positions of all vertices at the current frame, (V, 3).

        Raises
        ------
        ExportError
            If the faces of an object differ from the first frame; the message names both.
        """
        depsgraph = self._context.evaluated_depsgraph_get()
        found = [reading.frame(depsgraph) for reading in self._readings]
        for reading, first, now in zip(self._readings, self._first, found, strict=True):
            if not now.has_faces_of(first):
                raise ExportError(
                    f"the faces of {reading.obj.name} at frame "
                    f"{self._context.scene.frame_current} differ from those at frame "
                    f"{self._first_frame}; a .reel has the same faces in every frame: export fewer "
                    "frames, or take away the modifier that changes them"
                )
        return np.concatenate([mesh.vertices for mesh in found], dtype=np.float32)


def _merged(
    names: Sequence[str],
    meshes: Sequence[PolygonMesh],
    surfaces: Sequence[Surface],
    notes: Notes,
) -> tuple[PolygonMesh, Surface]:
    if len(meshes) == 1:
        return meshes[0], surfaces[0]

    def part(name: str, mesh: PolygonMesh, surface: Surface) -> SceneMesh:
        return SceneMesh(name, np.zeros(1), lambda _: mesh, lambda _: surface)

    merged = merge_meshes([*map(part, names, meshes, surfaces)], "", notes)
    return merged.frame(0), merged.surface(0)
