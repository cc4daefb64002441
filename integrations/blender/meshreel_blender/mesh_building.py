"""Create Blender meshes from the parts of a file."""

import json
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt

from meshreel.formats.scenes.parts import PartMesh
from meshreel.model.colors import to_linear
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind

MAX_UV_MAPS = 8
MATERIALS = "material"

SLOTS = "meshreel_slots"
"""Custom property of a mesh: the material slot of each label as JSON, which stays valid if a user
puts another material into a slot."""


def new_mesh(
    name: str, part: PartMesh | None, positions: npt.NDArray[Any], notes: list[str]
) -> Any:
    """Create the mesh of a part; see `fill_mesh`."""
    mesh = bpy.data.meshes.new(object_name(name))
    fill_mesh(mesh, part, positions, notes)
    return mesh


def fill_mesh(
    mesh: Any, part: PartMesh | None, positions: npt.NDArray[Any], notes: list[str]
) -> None:
    """Replace a mesh: polygons, UV maps, color attributes, materials and sharp edges.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        Its material slots are kept, and completed.
    part : PartMesh or None
        None leaves the mesh empty.
    positions : float array of shape (V, 3)
        Positions of the vertices of all parts.
    notes : list of str
        Receives a sentence for everything that Blender cannot store.
    """
    mesh.clear_geometry()
    if part is None:
        mesh.update()
        return
    positions = positions[part.verts]
    mesh.vertices.add(len(positions))
    mesh.loops.add(len(part.corners))
    mesh.polygons.add(len(part.counts))
    mesh.loops.foreach_set("vertex_index", part.corners)
    starts = np.cumsum(part.counts, dtype=np.int64) - part.counts
    mesh.polygons.foreach_set("loop_start", starts.astype(np.int32))
    _add_uv_maps(mesh, part, notes)
    _add_colors(mesh, part, notes)
    for groups in part.surface.groups:
        _add_groups(mesh, groups, notes)
    mesh.update(calc_edges=True)
    if part.surface.hard_edges is not None:
        _mark_sharp(mesh, part.surface.hard_edges, len(positions))
    write_positions(mesh, positions)
    if mesh.validate():
        n_left_out = len(part.counts) - len(mesh.polygons)
        notes.append(
            f"{mesh.name}: left out {n_left_out} faces, which Blender does not hold: they name a "
            "vertex twice, or another face has the same vertices"
        )


def write_positions(mesh: Any, positions: npt.NDArray[Any]) -> None:
    """Set the positions of a mesh, of shape (V, 3)."""
    if len(positions) == 0:
        return  # an empty mesh lacks the attribute
    # `foreach_set` on the attribute copies a block of memory; on `vertices` it loops.
    flat = np.ascontiguousarray(positions, np.float32).ravel()
    mesh.attributes["position"].data.foreach_set("vector", flat)
    mesh.update()


def object_name(part_name: str) -> str:
    """Last component of the path of a part: "body" of "/root/body"."""
    return part_name.rstrip("/").rpartition("/")[2] or part_name


def _add_uv_maps(mesh: Any, part: PartMesh, notes: list[str]) -> None:
    for number, uv in enumerate(part.surface.of_kind(Kind.UV)):
        values = _at_corners(uv, part)
        if number >= MAX_UV_MAPS or values.shape[1] != 2:
            notes.append(f"{mesh.name}: left out {uv.name!r}; Blender has 8 UV maps of 2 numbers")
            continue
        layer = mesh.uv_layers.new(name=uv.name, do_init=False)
        layer.uv.foreach_set("vector", values.astype(np.float32).ravel())


def _add_colors(mesh: Any, part: PartMesh, notes: list[str]) -> None:
    for color in part.surface.of_kind(Kind.COLOR):
        is_point = color.domain is Domain.VERTEX
        values = color.per_item() if is_point else _at_corners(color, part)
        if values.shape[1] not in (3, 4):
            notes.append(f"{mesh.name}: left out {color.name!r}; a color has 3 or 4 numbers")
            continue
        is_bytes = values.dtype == np.uint8
        layer = mesh.color_attributes.new(
            name=color.name,
            type="BYTE_COLOR" if is_bytes else "FLOAT_COLOR",
            domain="POINT" if is_point else "CORNER",
        )
        opaque = np.ones((len(values), 4), np.float32)
        # Blender stores bytes in sRGB and floats in linear form.
        opaque[:, : values.shape[1]] = values / 255 if is_bytes else to_linear(values)
        layer.data.foreach_set("color_srgb" if is_bytes else "color", opaque.ravel())


def _mark_sharp(mesh: Any, hard_edges: npt.NDArray[np.int32], n_verts: int) -> None:
    """Mark hard edges sharp, so that Blender splits normals there in every frame."""
    ends = np.empty(2 * len(mesh.edges), np.int32)
    mesh.edges.foreach_get("vertices", ends)
    ends = np.sort(ends.reshape(-1, 2), axis=1).astype(np.int64)
    wanted = np.sort(hard_edges, axis=1).astype(np.int64)
    is_sharp = np.isin(ends @ [n_verts, 1], wanted @ [n_verts, 1])
    mesh.edges.foreach_set("use_edge_sharp", is_sharp)


def _at_corners(attribute: Attribute, part: PartMesh) -> npt.NDArray[Any]:
    """Values of an attribute at each face corner."""
    values = attribute.per_item()
    if attribute.domain is Domain.VERTEX:
        return values[part.corners]
    if attribute.domain is Domain.FACE:
        return np.repeat(values, part.counts, axis=0)
    return values


def _add_groups(mesh: Any, groups: FaceGroups, notes: list[str]) -> None:
    """Assign material slots by label; faces without a material get an empty slot."""
    if groups.name != MATERIALS:
        notes.append(f"{mesh.name}: left out face groups {groups.name!r}; only materials are read")
        return
    slots = json.loads(mesh.get(SLOTS, "{}"))
    labels = [*groups.labels, *[""] * bool((groups.numbers < 0).any())]  # number -1: the last
    for label in labels:
        if slots.get(label, len(mesh.materials)) >= len(mesh.materials):
            found = bpy.data.materials.get(label) or bpy.data.materials.new(label)
            mesh.materials.append(found if label else None)
            slots[label] = len(mesh.materials) - 1
    mesh[SLOTS] = json.dumps(slots)
    numbers = np.array([slots[label] for label in labels], np.int32)[groups.numbers]
    mesh.polygons.foreach_set("material_index", numbers)
