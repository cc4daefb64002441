"""Faces of a mesh that are holes, which are left out, with what they carry."""

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.surface import Attribute, Domain, FaceGroups, Surface

Mask = npt.NDArray[np.bool_]


def solid_faces(holes: Any, n_faces: int, path: str) -> Mask | None:
    """Which faces are no holes; None if none is a hole.

    Parameters
    ----------
    holes : array of int or None
        Numbers of the faces that are; those of no face say nothing.
    path : str
        Of the mesh.

    Raises
    ------
    FormatError
        If all are holes.
    """
    numbers = np.asarray([] if holes is None else holes)
    numbers = numbers[(numbers >= 0) & (numbers < n_faces)]
    if not len(numbers):
        return None
    solid = np.ones(n_faces, bool)
    solid[numbers] = False
    if not solid.any():
        raise FormatError(f"mesh {path} has {n_faces} faces, which are all holes")
    return solid


def faces_of(mesh: PolygonMesh, solid: Mask) -> PolygonMesh:
    """The mesh with these faces only; all its vertices stay."""
    counts = mesh.counts[solid]
    return PolygonMesh(mesh.vertices, counts, mesh.corners[np.repeat(solid, mesh.counts)])


def surface_of(surface: Surface, solid: Mask, counts: npt.NDArray[np.int64]) -> Surface:
    """The surface of these faces, of that of all faces, which have so many corners."""
    kept = {Domain.FACE: solid, Domain.CORNER: np.repeat(solid, counts)}
    return replace(
        surface,
        attributes=tuple(_attribute_of(one, kept) for one in surface.attributes),
        groups=tuple(FaceGroups(g.name, g.labels, g.numbers[solid]) for g in surface.groups),
    )


def _attribute_of(attribute: Attribute, kept: dict[Domain, Mask]) -> Attribute:
    if attribute.domain not in kept:
        return attribute
    items = kept[attribute.domain]
    if attribute.indices is not None:
        return replace(attribute, indices=attribute.indices[items])
    return replace(attribute, values=attribute.values[items])
