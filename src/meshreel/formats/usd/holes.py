"""Removal of faces that are holes, and of their attributes."""

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.surface import Attribute, Domain, FaceGroups, Surface

Mask = npt.NDArray[np.bool_]


def solid_faces(holes: Any, n_faces: int, path: str) -> Mask | None:
    """Return a mask of the faces that are not holes, or None without holes.

    Parameters
    ----------
    holes : array of int or None
        Indices of faces that are holes; indices out of range are ignored.
    path : str
        Path of the mesh.

    Raises
    ------
    FormatError
        If all faces are holes.
    """
    numbers = np.asarray([] if holes is None else holes)
    numbers = numbers[(numbers >= 0) & (numbers < n_faces)]
    if not len(numbers):
        return None
    solid = np.ones(n_faces, bool)
    solid[numbers] = False
    if not solid.any():
        raise FormatError(f"mesh {path} has {n_faces} faces, and all of them are holes")
    return solid


def select_faces(mesh: PolygonMesh, solid: Mask) -> PolygonMesh:
    """Return the mesh with the selected faces and all of its vertices."""
    counts = mesh.counts[solid]
    return PolygonMesh(mesh.vertices, counts, mesh.corners[np.repeat(solid, mesh.counts)])


def select_surface(surface: Surface, solid: Mask, counts: npt.NDArray[np.int64]) -> Surface:
    """Return the surface of the selected faces; `counts` are the corners of all faces."""
    kept = {Domain.FACE: solid, Domain.CORNER: np.repeat(solid, counts)}
    return replace(
        surface,
        attributes=tuple(_select_items(one, kept) for one in surface.attributes),
        groups=tuple(FaceGroups(g.name, g.labels, g.numbers[solid]) for g in surface.groups),
    )


def _select_items(attribute: Attribute, kept: dict[Domain, Mask]) -> Attribute:
    if attribute.domain not in kept:
        return attribute
    items = kept[attribute.domain]
    if attribute.indices is not None:
        return replace(attribute, indices=attribute.indices[items])
    return replace(attribute, values=attribute.values[items])
