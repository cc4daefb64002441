"""Create Blender meshes from the parts of a file."""

from typing import Any

import bpy
import numpy as np
import numpy.typing as npt

from meshreel.formats.scenes.parts import PartMesh
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind

MAX_UV_MAPS = 8
MATERIALS = "material"


def build_mesh(part: PartMesh, positions: npt.NDArray[Any], notes: list[str]) -> Any:
    """Create the mesh of a part: polygons, UV maps, color attributes, materials and sharp edges.

    Parameters
    ----------
    part : PartMesh
    positions : float array of shape (V, 3)
        Positions of the vertices of the part.
    notes : list of str
        Receives a sentence for everything that Blender cannot store.
    """
    mesh = bpy.data.meshes.new(object_name(part))
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
    return mesh


def write_positions(mesh: Any, positions: npt.NDArray[Any]) -> None:
    """Set the positions of a mesh, of shape (V, 3)."""
    if len(positions) == 0:
        return  # an empty mesh lacks the attribute
    # `foreach_set` on the attribute copies a block of memory; on `vertices` it loops.
    flat = np.ascontiguousarray(positions, np.float32).ravel()
    mesh.attributes["position"].data.foreach_set("vector", flat)
    mesh.update()


def object_name(part: PartMesh) -> str:
    """Last component of the path of a part: "body" of "/root/body"."""
    return part.name.rstrip("/").rpartition("/")[2] or part.name


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
        opaque[:, : values.shape[1]] = values / 255 if is_bytes else values
        # Bytes are stored as sRGB, without conversion to linear.
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
    """Assign material slots by name; faces without a material get an empty last slot."""
    if groups.name != MATERIALS:
        notes.append(f"{mesh.name}: left out face groups {groups.name!r}; only materials are read")
        return
    for label in groups.labels:
        mesh.materials.append(bpy.data.materials.get(label) or bpy.data.materials.new(label))
    numbers = groups.numbers
    if (numbers < 0).any():
        mesh.materials.append(None)
        numbers = np.where(numbers < 0, len(groups.labels), numbers).astype(np.int32)
    mesh.polygons.foreach_set("material_index", numbers)
