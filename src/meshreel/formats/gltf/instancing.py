"""Instances of a mesh at a node (`EXT_mesh_gpu_instancing`), baked into one mesh."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import FormatError
from meshreel.formats.gltf.accessors import Accessors
from meshreel.formats.gltf.animation import Matrices, compose, unit
from meshreel.formats.gltf.document import INSTANCING, JsonObject
from meshreel.formats.gltf.geometry import Geometry, reversed_triangles
from meshreel.formats.notes import listed, note_left_out
from meshreel.model.geometry.hard_edges import merged_edges
from meshreel.model.surface import Attribute, Domain, Surface

DEFAULTS: dict[str, tuple[int, ...]] = {
    "TRANSLATION": (0, 0, 0),
    "ROTATION": (0, 0, 0, 1),
    "SCALE": (1, 1, 1),
}
"""Attributes that transform instances, and their defaults."""

TRANSFORM_BYTES = 512
"""Memory per transform during its computation."""


def read_instances(node: JsonObject, accessors: Accessors) -> Matrices | None:
    """Return the transforms of the instances at a node, of shape (I, 4, 4), or None without any.

    Raises
    ------
    FormatError
        If attributes differ in length, a number is not finite, or there are too many instances for
        the memory.
    """
    extension = node.extension(INSTANCING)
    attributes = None if extension is None else extension.required_child("attributes")
    stored = [name for name in DEFAULTS if attributes is not None and name in attributes]
    if attributes is None or not stored:
        return None
    count = accessors.count(attributes, stored[0])
    accessors.reserve(TRANSFORM_BYTES * count, f"{node.place}, with {count} instances")
    translations, rotations, scales = (
        _rows(attributes, name, accessors, count) for name in DEFAULTS
    )
    return compose(translations, unit(rotations), scales)


def note_instances(placed: Sequence[tuple[JsonObject, Matrices | None]], notes: list[str]) -> None:
    """Note the instances of nodes: their number, and attributes that are left out.

    Parameters
    ----------
    placed : sequence of JsonObject and Matrices
        Nodes with a mesh, and the instances of each, or None.
    notes : list of str
        Gains the sentences.
    """
    counts = [len(instances) for _, instances in placed if instances is not None]
    if counts:
        where = f" of {len(counts)} nodes" if len(counts) > 1 else ""
        notes.append(f"baked {sum(counts)} instances{where}, one mesh per node")
    extensions = [node.extension(INSTANCING) for node, _ in placed]
    holders = [one.required_child("attributes") for one in extensions if one is not None]
    names = [name for one in holders for name in one.values]
    custom = dict.fromkeys(name for name in names if name not in DEFAULTS)
    if custom:
        note_left_out(notes, f"attributes of instances: {listed(custom)}")


def repeat_geometry(
    geometry: Geometry, instances: Matrices, accessors: Accessors, place: str
) -> Geometry:
    """Return a mesh without skin repeated once per instance, concatenated.

    Faces of mirroring instances are reversed.

    Raises
    ------
    FormatError
        If the result would fill the memory.
    """
    n_verts, n_instances = len(geometry.positions), len(instances)
    accessors.reserve(n_instances * _size_bytes(geometry), f"{place}, with {n_instances} instances")
    if n_verts * n_instances > np.iinfo(np.int32).max:
        raise FormatError(f"{place}: {n_instances} instances of {n_verts} vertices are too many")
    linear = instances[:, :3, :3]
    is_mirrored = np.linalg.det(linear) < 0

    def transformed(rows: npt.NDArray[Any]) -> Floats:
        vectors: Floats = rows.astype(np.float64) @ linear.transpose(0, 2, 1)
        return vectors

    positions = transformed(geometry.positions) + instances[:, np.newaxis, :3, 3]
    starts = n_verts * np.arange(n_instances, dtype=np.int32)
    faces = geometry.faces + starts[:, np.newaxis, np.newaxis]
    return replace(
        geometry,
        positions=positions.reshape(-1, 3),
        displacements=tuple(
            None if one is None else transformed(one).reshape(-1, 3)
            for one in geometry.displacements
        ),
        faces=np.where(
            is_mirrored[:, np.newaxis, np.newaxis], reversed_triangles(faces), faces
        ).reshape(-1, 3),
        surface=_repeated_surface(geometry.surface, is_mirrored, n_verts),
    )


def _rows(attributes: JsonObject, name: str, accessors: Accessors, count: int) -> Floats:
    """Return an attribute of all instances; a single row for the default."""
    if name not in attributes:
        return np.array([DEFAULTS[name]], np.float64)
    kind = f"VEC{len(DEFAULTS[name])}"
    rows = accessors.read(attributes, name, kind, count=count).floats().astype(np.float64)
    if not np.isfinite(rows).all():
        raise FormatError(f"{attributes.place}: every {name} must be finite")
    return rows


def _size_bytes(geometry: Geometry) -> int:
    """Return the memory that an instance of a mesh needs, in bytes."""
    n_arrays = 1 + sum(one is not None for one in geometry.displacements)
    n_rows = sum(len(_items(one)) for one in geometry.surface.attributes)
    n_rows += len(geometry.surface.groups) * len(geometry.faces)
    return 24 * n_arrays * len(geometry.positions) + 2 * geometry.faces.nbytes + 4 * n_rows


def _items(attribute: Attribute) -> npt.NDArray[np.int32]:
    """Return the value row of each vertex or corner."""
    indices = attribute.indices
    return np.arange(len(attribute.values), dtype=np.int32) if indices is None else indices


def _repeated_surface(
    surface: Surface, is_mirrored: npt.NDArray[np.bool_], n_verts: int
) -> Surface:
    n_instances = len(is_mirrored)

    def repeat(one: Attribute) -> Attribute:
        rows = np.tile(_items(one), (n_instances, 1))
        if one.domain is Domain.CORNER:
            corners = rows[is_mirrored].reshape(int(is_mirrored.sum()), -1, 3)
            rows[is_mirrored] = reversed_triangles(corners).reshape(len(corners), -1)
        return replace(one, indices=rows.ravel())

    groups = (replace(one, numbers=np.tile(one.numbers, n_instances)) for one in surface.groups)
    return replace(
        surface,
        attributes=tuple(repeat(one) for one in surface.attributes),
        groups=tuple(groups),
        hard_edges=merged_edges([surface.hard_edges] * n_instances, [n_verts] * n_instances),
    )
