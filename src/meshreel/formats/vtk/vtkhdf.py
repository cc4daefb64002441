"""Reader for VTKHDF: polygons or cells of VTK in HDF5, with time steps.

Supports the types PolyData and UnstructuredGrid with any number of partitions, and collections
of them, where each block is a mesh. Each step stores the offsets of its points and cells, so
connectivity that stays the same is stored and read once.
"""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from meshreel.errors import FormatError, InvalidInputError, Keyword
from meshreel.formats.frames.steps import StepFrames
from meshreel.formats.hdf import Node, find_group, hdf_errors, open_hdf, read_text_attribute
from meshreel.formats.kinds import VERTEX_FACE_CELL, SequenceFormat
from meshreel.formats.options import Reading
from meshreel.formats.scenes.scene_mesh import SceneMesh, read_or_defer_error
from meshreel.formats.vtk.vtkhdf_steps import ROOT, VtkSteps
from meshreel.formats.vtk.vtkhdf_writer import write_vtkhdf
from meshreel.model.surface import Surface
from meshreel.runtime.extras import HDF

MESH_TYPES = ("PolyData", "UnstructuredGrid")
VERSION = 2


def read_vtkhdf(path: Path, reading: Reading) -> Sequence[SceneMesh]:
    """Return the meshes of a VTKHDF file: one, or one for each block of a collection.

    Raises
    ------
    FormatError
        If the file is not VTKHDF, has an unsupported type, or is damaged.
    """
    if reading.dataset is not None:
        raise InvalidInputError(
            "is a VTKHDF file, where ", Keyword("dataset"), " has no effect; leave it out"
        )
    with hdf_errors():
        root = open_hdf(path)
        group = find_group(root, ROOT)
        if group is None:
            raise FormatError(f"has no group {ROOT}; expected a VTKHDF file")
        reading.notes.left_out("groups", (name for name in root if name != ROOT))
        kind = _type(group)
        if kind in MESH_TYPES:
            name = read_text_attribute(group, "name") or path.stem
            return [_scene_mesh(group, kind, name, reading)]
        blocks = [(name, find_group(group, name)) for name in group if name != "Assembly"]

        read = hdf_errors()(_scene_mesh)
        meshes = [
            read_or_defer_error(mesh_path, partial(read, block, _type(block), mesh_path, reading))
            for mesh_path, block in ((f"/{name}", block) for name, block in blocks)
            if block is not None and _type(block) in MESH_TYPES
        ]
        if not meshes:
            raise FormatError(
                f"is VTKHDF of type {kind or '(none)'}; {' and '.join(MESH_TYPES)} are supported"
            )
        names = (name for name, block in blocks if block is None or _type(block) not in MESH_TYPES)
        reading.notes.left_out("blocks that are not meshes", names)
        return meshes


def _type(group: Node) -> str:
    value: Any = group.attrs.get("Type", "")
    return value.decode("ascii", "replace") if isinstance(value, bytes) else str(value)


def _scene_mesh(group: Node, kind: str, name: str, reading: Reading) -> SceneMesh:
    version: Any = np.ravel(group.file[ROOT].attrs.get("Version", 0))
    if len(version) == 0 or int(version[0]) > VERSION:
        raise FormatError(f"has VTKHDF version {version.tolist()}; up to {VERSION}.x is supported")
    steps = VtkSteps(group, is_poly_data=kind == "PolyData", notes=reading.notes)
    frames = StepFrames(steps.step, reading.notes)

    @hdf_errors()
    def surface(index: int) -> Surface:
        result = frames.surface(index)
        steps.note_unread()
        return result

    frame, tracks = hdf_errors()(frames.frame), hdf_errors()(frames.tracks)
    return SceneMesh(name, steps.times_s, frame, surface, tracks=tracks)


FORMATS = (
    SequenceFormat(
        ".vtkhdf",
        "VTKHDF",
        read_meshes=read_vtkhdf,
        extra=HDF,
        write=write_vtkhdf,
        holds_segments=True,
        track_domains=VERTEX_FACE_CELL,
    ),
)
