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
import numpy.typing as npt

from meshreel.errors import FormatError, InvalidInputError, Keyword
from meshreel.formats.arrays.named_arrays import RESERVED_NAMES, read_description, read_surface
from meshreel.formats.frames.steps import StepFrames
from meshreel.formats.hdf import (
    Node,
    find_dataset,
    find_group,
    hdf_errors,
    open_hdf,
    read_all,
)
from meshreel.formats.kinds import OF_CELLS, SequenceFormat
from meshreel.formats.options import ReadOptions
from meshreel.formats.scenes.scene_mesh import SceneMesh, read_or_defer_error
from meshreel.formats.vtk.vtkhdf_steps import (
    MESHREEL_GROUP,
    ROOT,
    SEGMENT_STARTS,
    VtkSteps,
    read_integers,
    segment_group,
)
from meshreel.formats.vtk.vtkhdf_writer import write_vtkhdf
from meshreel.model.surface import Surface
from meshreel.runtime.extras import HDF

MESH_TYPES = ("PolyData", "UnstructuredGrid")
VERSION = 2


def read_vtkhdf(path: Path, options: ReadOptions) -> Sequence[SceneMesh]:
    """Return the meshes of a VTKHDF file: one, or one for each block of a collection.

    Raises
    ------
    FormatError
        If the file is not VTKHDF, has an unsupported type, or is damaged.
    """
    if options.dataset is not None:
        raise InvalidInputError(
            "is a VTKHDF file, where ", Keyword("dataset"), " has no effect; leave it out"
        )
    with hdf_errors():
        root = open_hdf(path)
        group = find_group(root, ROOT)
        if group is None:
            raise FormatError(f"has no group {ROOT}; expected a VTKHDF file")
        options.notes.left_out(
            "groups", (name for name in root if name not in (ROOT, MESHREEL_GROUP))
        )
        kind = _type(group)
        if kind in MESH_TYPES:
            return [_scene_mesh(group, kind, path.stem, find_group(root, MESHREEL_GROUP), options)]
        blocks = [(name, find_group(group, name)) for name in group if name != "Assembly"]

        read = hdf_errors()(_scene_mesh)
        meshes = [
            read_or_defer_error(place, partial(read, block, _type(block), place, None, options))
            for place, block in ((f"/{name}", block) for name, block in blocks)
            if block is not None and _type(block) in MESH_TYPES
        ]
        if not meshes:
            raise FormatError(
                f"is VTKHDF of type {kind or '(none)'}; {' and '.join(MESH_TYPES)} are supported"
            )
        names = (
            name for name, block in blocks if block is not None and _type(block) not in MESH_TYPES
        )
        options.notes.left_out("blocks that are not meshes", names)
        return meshes


def _type(group: Node) -> str:
    value: Any = group.attrs.get("Type", "")
    return value.decode("ascii", "replace") if isinstance(value, bytes) else str(value)


def _scene_mesh(
    group: Node, kind: str, name: str, own: Node | None, options: ReadOptions
) -> SceneMesh:
    version: Any = np.ravel(group.file[ROOT].attrs.get("Version", 0))
    if len(version) == 0 or int(version[0]) > VERSION:
        raise FormatError(f"has VTKHDF version {version.tolist()}; up to {VERSION}.x is supported")
    steps = VtkSteps(group, is_poly_data=kind == "PolyData", notes=options.notes)
    frames = StepFrames(steps.step, options.notes)
    fps = None
    described = _meshreel_arrays(own)
    if own is not None:
        about = read_description(described | {"faces": np.empty((0, 3))}, name, ReadOptions())
        name, fps = about.name, about.timing.fps

    @hdf_errors()
    def surface(index: int) -> Surface:
        steps.note_field_data()
        if own is None:
            return frames.surface(index)
        surface = read_surface(described | _meshreel_arrays(_segment_of(own, index)))
        steps.note_other_data(frames.constant_arrays(index), surface)
        return surface

    frame, tracks = hdf_errors()(frames.frame), hdf_errors()(frames.tracks)
    return SceneMesh(name, steps.times_s, frame, surface, fps, tracks)


def _segment_of(own: Node, step: int) -> Node | None:
    """Return the group with the surface of a step, if there are several segments."""
    starts = find_dataset(own, SEGMENT_STARTS)
    if starts is None:
        return None
    number = int(np.searchsorted(read_integers(starts).ravel(), step, side="right")) - 1
    return find_group(own, segment_group(number))


def _meshreel_arrays(own: Node | None) -> dict[str, npt.NDArray[Any]]:
    if own is None:
        return {}
    datasets = {name: find_dataset(own, name) for name in own if RESERVED_NAMES.fullmatch(name)}
    return {name: read_all(dataset) for name, dataset in datasets.items() if dataset is not None}


FORMATS = (
    SequenceFormat(
        ".vtkhdf",
        "VTKHDF",
        read_meshes=read_vtkhdf,
        extra=HDF,
        write=write_vtkhdf,
        holds_segments=True,
        holds_tracks=OF_CELLS,
    ),
)
