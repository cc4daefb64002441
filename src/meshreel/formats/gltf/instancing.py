"""Copies of a mesh at a node, which `EXT_mesh_gpu_instancing` asks for, as one mesh."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import FormatError
from meshreel.formats.gltf.accessors import Accessors
from meshreel.formats.gltf.document import INSTANCING
from meshreel.formats.gltf.geometry import Geometry, turned
from meshreel.formats.gltf.interpolation import unit
from meshreel.formats.gltf.json_object import JsonObject
from meshreel.formats.gltf.motion import Matrices, compose
from meshreel.formats.notes import listed, note_left_out
from meshreel.model.geometry.hard_edges import joined_edges
from meshreel.model.surface import Attribute, Domain, Surface

AT_REST = {"TRANSLATION": (0, 0, 0), "ROTATION": (0, 0, 0, 1), "SCALE": (1, 1, 1)}
"""Attributes that move instances, and what they are where they are not given."""

TRANSFORM_BYTES = 512
"""Bytes that a transform takes while it is made."""


def read_instances(node: JsonObject, accessors: Accessors) -> Matrices | None:
    """Where the copies of the mesh of a node are, of shape (I, 4, 4); None if it is not copied.

    Raises
    ------
    FormatError
        If attributes have different numbers of rows, a number is not finite, or there are so many
        that they would fill the memory.
    """
    found = node.extension(INSTANCING)
    attributes = None if found is None else found.needed("attributes")
    given = [name for name in AT_REST if attributes is not None and name in attributes]
    if attributes is None or not given:
        return None
    count = accessors.count(attributes, given[0])
    accessors.reserve(TRANSFORM_BYTES * count, f"{node.place}, with {count} instances")
    moves, turns, scales = (_rows(attributes, name, accessors, count) for name in AT_REST)
    return compose(moves, unit(turns), scales)


def note_instances(placed: Sequence[tuple[JsonObject, Matrices | None]], notes: list[str]) -> None:
    """Tell of the instances of nodes: how many there are, and what of them is left out.

    Parameters
    ----------
    placed : sequence of JsonObject and Matrices
        Nodes that show a mesh, and the instances of each; None for one that is not copied.
    """
    counts = [len(instances) for _, instances in placed if instances is not None]
    if counts:
        where = f" of {len(counts)} nodes" if len(counts) > 1 else ""
        notes.append(f"baked {sum(counts)} instances{where}, those of a node as one mesh")
    extensions = [node.extension(INSTANCING) for node, _ in placed]
    holders = [one.needed("attributes") for one in extensions if one is not None]
    own = dict.fromkeys(name for one in holders for name in one.values if name not in AT_REST)
    if own:
        note_left_out(notes, f"values of instances: {listed(own)}")


def repeated(geometry: Geometry, instances: Matrices, accessors: Accessors, place: str) -> Geometry:
    """A mesh that no skin moves, once for each instance, one after the other.

    Faces of instances that mirror are turned.

    Raises
    ------
    FormatError
        If they would fill the memory.
    """
    n_verts, n_instances = len(geometry.positions), len(instances)
    accessors.reserve(n_instances * _size_bytes(geometry), f"{place}, with {n_instances} instances")
    if n_verts * n_instances > np.iinfo(np.int32).max:
        raise FormatError(f"{place}: {n_instances} instances of {n_verts} vertices are too many")
    linear = instances[:, :3, :3]
    is_mirrored = np.linalg.det(linear) < 0

    def moved(rows: npt.NDArray[Any]) -> Floats:
        found: Floats = rows.astype(np.float64) @ linear.transpose(0, 2, 1)
        return found

    positions = moved(geometry.positions) + instances[:, np.newaxis, :3, 3]
    starts = n_verts * np.arange(n_instances, dtype=np.int32)
    faces = geometry.faces + starts[:, np.newaxis, np.newaxis]
    return replace(
        geometry,
        positions=positions.reshape(-1, 3),
        displacements=tuple(
            None if one is None else moved(one).reshape(-1, 3) for one in geometry.displacements
        ),
        faces=np.where(is_mirrored[:, np.newaxis, np.newaxis], turned(faces), faces).reshape(-1, 3),
        surface=_repeated_surface(geometry.surface, is_mirrored, n_verts),
    )


def _rows(attributes: JsonObject, name: str, accessors: Accessors, count: int) -> Floats:
    """An attribute of every instance; one row if it is the same for all."""
    if name not in attributes:
        return np.array([AT_REST[name]], np.float64)
    kind = f"VEC{len(AT_REST[name])}"
    rows = accessors.read(attributes, name, kind, count=count).floats().astype(np.float64)
    if not np.isfinite(rows).all():
        raise FormatError(f"{attributes.place}: every {name} must be finite")
    return rows


def _size_bytes(geometry: Geometry) -> int:
    """Bytes that one copy of a mesh takes."""
    n_moved = 1 + sum(one is not None for one in geometry.displacements)
    n_rows = sum(len(_items(one)) for one in geometry.surface.attributes)
    n_rows += len(geometry.surface.groups) * len(geometry.faces)
    return 24 * n_moved * len(geometry.positions) + 2 * geometry.faces.nbytes + 4 * n_rows


def _items(attribute: Attribute) -> npt.NDArray[np.int32]:
    """The row of the values of each vertex or corner."""
    found = attribute.indices
    return np.arange(len(attribute.values), dtype=np.int32) if found is None else found


def _repeated_surface(
    surface: Surface, is_mirrored: npt.NDArray[np.bool_], n_verts: int
) -> Surface:
    n_instances = len(is_mirrored)

    def repeat(one: Attribute) -> Attribute:
        rows = np.tile(_items(one), (n_instances, 1))
        if one.domain is Domain.CORNER:
            corners = rows[is_mirrored].reshape(int(is_mirrored.sum()), -1, 3)
            rows[is_mirrored] = turned(corners).reshape(len(corners), -1)
        return replace(one, indices=rows.ravel())

    groups = (replace(one, numbers=np.tile(one.numbers, n_instances)) for one in surface.groups)
    return replace(
        surface,
        attributes=tuple(repeat(one) for one in surface.attributes),
        groups=tuple(groups),
        hard_edges=joined_edges([surface.hard_edges] * n_instances, [n_verts] * n_instances),
    )
