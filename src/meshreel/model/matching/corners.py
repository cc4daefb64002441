"""The corners of triangles, identified by values that do not change over time."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import rows_as_bytes
from meshreel.kernel.order import opposite_sides
from meshreel.model.sequence import Faces, MeshSequence
from meshreel.model.surface import Attribute, Domain, Surface

Integers = npt.NDArray[np.signedinteger[Any]]
Rows = npt.NDArray[np.void]

NONE = -1
"""Corner or vertex that a segment does not have."""

MISSING_SHARE = 0.02
"""Largest share of faces that a segment may lack."""


@dataclass(frozen=True)
class Corners:
    """The corners of a segment's triangles, identified by values that do not change over time."""

    segment: MeshSequence
    values: Rows
    """Distinct values of all corners as bytes, ascending."""
    faces: Integers
    """int32 array of shape (M, 3). Numbers of the values at the corners of each face, rotated to
    the lexicographically smallest order.
    """
    opposite: Integers
    """int32 array of shape (M, 3). Number of the value opposite to the half-edge from each corner,
    in the face across it.
    """
    corners: Integers
    """int32 array of shape (M, 3). Number of each of these corners in the segment."""

    def has_faces_of(self, other: "Corners") -> bool:
        """Whether both segments may have the same mesh: the values of most faces are in both."""
        segment, other_segment = self.segment, other.segment
        if segment.dtype != other_segment.dtype or describe_surface(
            segment.surface
        ) != describe_surface(other_segment.surface):
            return False
        numbers = joint_numbers([self, other])
        pairs = zip(numbers, (self, other), strict=True)
        faces = [of_values[corners.faces] for of_values, corners in pairs]
        groups = distinct_faces(np.concatenate(faces))[1]
        counts = [len(np.unique(groups[: len(faces[0])])), len(np.unique(groups[len(faces[0]) :]))]
        return int(groups.max()) < (1.0 + MISSING_SHARE) * min(counts)


def distinct_faces(faces: Integers) -> tuple[Integers, Integers]:
    """Return the first of each group of equal faces, and the group of each face."""
    n_values = np.int64(faces.max()) + 1
    _, pairs = np.unique(faces[:, 0] * n_values + faces[:, 1], return_inverse=True)
    _, first, groups = np.unique(
        pairs * n_values + faces[:, 2], return_index=True, return_inverse=True
    )
    return first, groups


def joint_numbers(run: Sequence[Corners]) -> list[Integers]:
    """Number the values of several segments; return the number of each of their values."""
    if all(np.array_equal(corners.values, run[0].values) for corners in run[1:]):
        return [np.arange(len(corners.values)) for corners in run]
    _, numbers = np.unique(np.concatenate([corners.values for corners in run]), return_inverse=True)
    return np.split(numbers, np.cumsum([len(corners.values) for corners in run])[:-1])


def corners_of(segment: MeshSequence) -> Corners:
    """Return the corners of a segment, by its attributes and groups, or else its positions."""
    columns = columns_at_corners(segment.surface, segment.faces)
    if not segment.surface.attributes:
        columns.append(segment.vertices[0][segment.faces.ravel()])
    values, numbers = np.unique(rows_as_bytes(*columns), return_inverse=True)
    rows = numbers.reshape(-1, 3)
    twins = opposite_sides(segment.faces, segment.n_verts).astype(np.int64)
    across = numbers[3 * (twins // 3) + (twins + 2) % 3].reshape(-1, 3)
    # If two corners have the lowest number, the face begins with the one before the other.
    turns = np.argmin(rows * np.int64(len(values)) + np.roll(rows, -1, axis=1), axis=1)
    turns = (turns[:, None] + np.arange(3)) % 3
    corners = 3 * np.arange(len(rows))[:, None] + turns
    faces, opposite = (np.take_along_axis(table, turns, axis=1) for table in (rows, across))
    return Corners(
        segment, values, *(table.astype(np.int32) for table in (faces, opposite, corners))
    )


def columns_at_corners(surface: Surface, faces: Faces) -> list[npt.NDArray[np.generic]]:
    """Return the values of each attribute and group at the corners of triangles."""
    of_attributes = [values_at_corners(attribute, faces) for attribute in surface.attributes]
    return of_attributes + [np.repeat(group.numbers, 3)[:, None] for group in surface.groups]


def values_at_corners(attribute: Attribute, faces: Faces) -> npt.NDArray[np.generic]:
    """Return the values of an attribute at the corners of triangles, of shape (3 M, C)."""
    values = attribute.per_item()
    if attribute.domain is Domain.CORNER:
        return values
    return values[faces.ravel()] if attribute.domain is Domain.VERTEX else np.repeat(values, 3, 0)


def is_of_triangles(surface: Surface) -> bool:
    """Whether a surface has no polygons, cells or parts, which another order would change."""
    return surface.face_sizes is None and surface.cells is None and not surface.parts


def describe_surface(surface: Surface) -> tuple[object, ...]:
    """Everything about a surface except values and groups of faces and hard edges."""
    attributes = [
        (
            attribute.name,
            attribute.kind,
            attribute.domain,
            attribute.values.dtype,
            attribute.values.shape[1],
        )
        for attribute in surface.attributes
    ]
    groups = [(group.name, group.labels) for group in surface.groups]
    has_hard_edges = surface.hard_edges is not None
    return attributes, groups, surface.materials, surface.images, has_hard_edges
