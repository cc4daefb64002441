"""Draco (`.drc`): the mesh of one frame, with texture coordinates, colors and normals.

Draco stores a point for each combination of values at a vertex, so that surfaces are split along
the seams of their textures. Points are welded along these seams; values that differ across a seam
become values of corners.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.frames.field_tracks import NORMALS, NORMALS_NAME, Field
from meshreel.formats.frames.frame import Frame, fields_of
from meshreel.formats.kinds import FrameFormat
from meshreel.formats.surfaces.hard_edges import find_hard_edges
from meshreel.formats.surfaces.polygons import polygon_mesh
from meshreel.formats.surfaces.welding import weld_seams
from meshreel.model.notes import Notes
from meshreel.model.surface import Kind, Surface
from meshreel.runtime.counting import counted
from meshreel.runtime.extras import DRACO_FRAMES as LIBRARY

MAGIC = b"DRACO"
GEOMETRY_TYPE = 7
"""Byte of a file that states the type of its geometry."""

POINT_CLOUD, TRIANGLE_MESH = 0, 1

POSITION, NORMAL, COLOR, UV = range(4)
"""Attribute types of Draco; 4 is generic."""

TYPE_NAMES = ("positions", "normals", "color", "uv", "generic")


def read_drc(data: bytes) -> Frame:
    """Read a Draco file, with seams welded.

    Raises
    ------
    FormatError
        If the file is damaged, contains a point cloud, or DracoPy is not installed.
    """
    if not data.startswith(MAGIC) or len(data) <= GEOMETRY_TYPE:
        raise FormatError("is not a Draco file: it does not begin with 'DRACO'")
    if data[GEOMETRY_TYPE] == POINT_CLOUD:
        raise FormatError("contains a point cloud without faces; a triangle mesh needs faces")
    if data[GEOMETRY_TYPE] != TRIANGLE_MESH:
        raise FormatError(
            f"declares geometry of type {data[GEOMETRY_TYPE]}; {TRIANGLE_MESH} is a triangle mesh"
        )
    library = LIBRARY.load()
    try:
        draco_mesh = library.decode(data)
    except Exception:  # of various types, whose messages are misleading
        raise FormatError("is damaged or incomplete: Draco cannot decode it") from None

    by_type: dict[int, list[npt.NDArray[Any]]] = {}
    notes, left_out = Notes(), list[str]()
    for attribute in draco_mesh.attributes:
        kind, values = attribute["attribute_type"], attribute["data"]
        is_second = kind in (POSITION, NORMAL) and kind in by_type
        if values is None or is_second or not _is_supported(kind, values):
            type_name = TYPE_NAMES[kind] if 0 <= kind < len(TYPE_NAMES) else "unknown"
            left_out.append(attribute.get("name") or f"{type_name} {attribute['unique_id']}")
        else:
            by_type.setdefault(kind, []).append(values + values.dtype.type(0))  # -0.0 becomes 0.0
    if POSITION not in by_type:
        raise FormatError("has no positions of three numbers that DracoPy can decode")
    points = by_type[POSITION][0]
    points = points.astype(np.result_type(np.float32, points.dtype))  # some are integers
    triangles = np.asarray(draco_mesh.faces).reshape(-1, 3).astype(np.int64)
    counts = np.full(len(triangles), 3, np.int64)
    polygon_mesh(points, counts, triangles.ravel())  # checks the indices
    split = weld_seams(points, triangles)
    mesh = polygon_mesh(points[split.first], counts, split.vertex_of[split.corners])
    n_points, n_verts = len(split.vertex_of), len(split.first)
    if n_points != n_verts:
        text = (
            f"welded {counted(n_points, 'point')} that Draco split at seams to "
            f"{counted(n_verts, 'vertex')}"
        )
        notes.changed("welded points", text)
    notes.left_out("attributes of Draco", left_out)
    attributes = tuple(
        split.attribute(name if not number else f"{name}{number}", kind, values)
        for name, kind, draco_type in (("uv", Kind.UV, UV), ("color", Kind.COLOR, COLOR))
        for number, values in enumerate(by_type.get(draco_type, []))
    )
    fields = fields_of(attributes)
    frame = Frame(mesh, Surface(None, attributes, is_ordered=False), fields, notes)
    if NORMAL not in by_type:
        return frame
    normals = split.attribute(NORMALS_NAME, Kind.OTHER, by_type[NORMAL][0])
    values, corners = normals.per_item(), mesh.items_of_corners(normals.domain)
    fields[normals.domain, NORMALS_NAME] = values, Field(values.dtype, 3, NORMALS)
    return replace(frame, find_hard_edges=lambda: find_hard_edges(mesh, values[corners]))


def _is_supported(draco_type: int, values: npt.NDArray[Any]) -> bool:
    """Whether an attribute becomes positions, normals, texture coordinates or colors."""
    width, number_type = int(values.shape[1]), values.dtype.name
    if draco_type == POSITION:
        return width == 3
    if draco_type == COLOR:
        return width in (3, 4) and number_type in ("float32", "uint8")
    return number_type == "float32" and (draco_type, width) in ((NORMAL, 3), (UV, 2))


FORMATS = (FrameFormat(".drc", "Draco", read_drc, None, extra=LIBRARY),)
