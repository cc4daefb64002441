"""Names of the arrays that store a sequence in NumPy archives and HDF5 files.

==============================  ===========  ===========================================
name                            shape        contents
==============================  ===========  ===========================================
``vertices``                    (T, V, 3)    positions, float32 or float64; or (V, 3, T)
``faces``                       (M, 3)       vertex indices of each triangle; not with cells
``cells``                       (n,)         vertex indices of the nodes of all cells
``cell_types``                  (N,)         type of each cell, a number of VTK
``fps``, ``start_s``            ()           frames per second; time of the first frame
``name``                        ()           text
``face_sizes``                  (P,)         corners of each face, triangulated as a fan
``hard_edges``                  (H, 2)       vertices of edges with separate normals on both sides
``part_names``                  (N,)         text: names of the merged meshes
``part_sizes``                  (N, 2)       vertices and faces of each
``attribute_names``             (A,)         text
``attribute_kinds``             (A,)         text: uv, color or other
``attribute_domains``           (A,)         text: vertex, face, corner or cell
``attribute_0_values`` ...      (N, C)       values of each attribute, numbered from 0
``attribute_0_indices`` ...     (n_items,)   row of the values for each item, if indexed
``group_names``                 (G,)         text: names of the face groups, such as "material"
``group_0_labels`` ...          (L,)         text
``group_0_numbers`` ...         (P,)         label of each face; -1 is none
``track_names``                 (K,)         text
``track_kinds``                 (K,)         text: scalar, vector, velocity, ...
``track_domains``               (K,)         text: vertex, face, corner or cell
``track_units``                 (K,)         text, such as Pa
``tracks/NAME`` ...             (T, N, C)    values of each track
==============================  ===========  ===========================================

A file has ``vertices``, and either ``faces`` or ``cells``, whose surface has the faces; ``cells``
may have the shape (N, k), a row for each, and ``cell_types`` one number for all. Any other array of
shape (T, N) or (T, N, C), for T frames and N vertices, faces, corners or cells, is a track. HDF5
files describe tracks by attributes instead of arrays.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from enum import Enum
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import native
from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.frames.stored_frames import Description
from meshreel.formats.options import Reading
from meshreel.model.cells import Cells
from meshreel.model.surface import (
    Attribute,
    Domain,
    FaceGroups,
    Kind,
    Part,
    Surface,
    surface_of_cells,
)
from meshreel.model.timing import Timing

Array = npt.NDArray[Any]

RESERVED_NAMES = re.compile(
    r"faces|cells|cell_types|fps|start_s|times|name|face_sizes|hard_edges|part_(names|sizes)|attribute_(names|kinds|domains)"
    r"|attribute_\d+_(values|indices)|group_names|group_\d+_(labels|numbers)"
    r"|track_(names|kinds|domains|units)"
)
"""Names of all arrays other than the positions."""


def described_arrays(stream: FrameStream) -> dict[str, Array]:
    """Return the arrays of the mesh, times and name of a sequence; a start of 0 is omitted."""
    surface, timing = stream.surface, stream.timing
    arrays: dict[str, Array] = {"faces": stream.faces}
    if surface.cells is not None:
        arrays = {"cells": surface.cells.nodes, "cell_types": surface.cells.types}
    elif surface.face_sizes is not None:
        arrays["face_sizes"] = surface.face_sizes
    if surface.hard_edges is not None:
        arrays["hard_edges"] = surface.hard_edges
    if surface.parts:
        arrays["part_names"] = text_array([part.name for part in surface.parts])
        sizes = [(part.n_verts, part.n_faces) for part in surface.parts]
        arrays["part_sizes"] = np.array(sizes, np.int64)
    if attributes := surface.attributes:
        arrays["attribute_names"] = text_array([attribute.name for attribute in attributes])
        arrays["attribute_kinds"] = text_array([attribute.kind for attribute in attributes])
        arrays["attribute_domains"] = text_array([attribute.domain for attribute in attributes])
    for index, attribute in enumerate(surface.attributes):
        arrays[f"attribute_{index}_values"] = attribute.values
        if attribute.indices is not None:
            arrays[f"attribute_{index}_indices"] = attribute.indices
    if surface.groups:
        arrays["group_names"] = text_array([group.name for group in surface.groups])
    for index, group in enumerate(surface.groups):
        arrays[f"group_{index}_labels"] = text_array(group.labels)
        arrays[f"group_{index}_numbers"] = group.numbers
    arrays["fps"] = np.asarray(np.float64(timing.fps))
    if timing.times is not None:
        arrays["times"] = timing.times
    elif timing.start_s:
        arrays["start_s"] = np.asarray(np.float64(timing.start_s))
    return {**arrays, "name": np.asarray(np.str_(stream.name))}


READ_ELSEWHERE = re.compile(r"fps|start_s|times|name|track_\w+")
"""Times and names, which options may replace, and descriptions of tracks."""


class _ReadArrays(dict[str, Array]):
    """Named arrays that know which of them were not read."""

    def __init__(self, arrays: Mapping[str, Array]) -> None:
        super().__init__(arrays)
        names = filter(RESERVED_NAMES.fullmatch, arrays)
        self.unread = {name for name in names if not READ_ELSEWHERE.fullmatch(name)}

    def __getitem__(self, name: str) -> Array:
        """Return an array, and record it."""
        self.unread.discard(name)
        return super().__getitem__(name)

    def get(self, name: str, default: Any = None) -> Any:
        """Return an array, if it exists, and record it."""
        self.unread.discard(name)
        return super().get(name, default)


def read_description(
    arrays: Mapping[str, Array],
    name: str,
    reading: Reading,
    n_frames: int | None = None,
    n_verts: int = 0,
) -> Description:
    """Return faces, times and surface of a sequence from its named arrays.

    Parameters
    ----------
    arrays : mapping of names to arrays
        Must contain ``faces`` or ``cells``.
    name : str
        Default name of the sequence.
    n_frames : int, optional
        Required number of times.
    n_verts : int
        Number of vertices of a mesh of cells.

    Raises
    ------
    FormatError
        If an array is missing or invalid; the message names it.
    InvalidInputError
        If there are not `n_frames` times, or they do not ascend.
    """
    arrays = _ReadArrays(arrays)
    surface = _read_surface(arrays)
    if "cells" in arrays:
        if "cell_types" not in arrays:
            raise FormatError(
                "has `cells` without `cell_types`: add the VTK type of each cell, or one number "
                "for all, such as 10 for tetrahedra or 12 for hexahedra"
            )
        nodes, types = arrays["cells"], arrays["cell_types"]
        if nodes.ndim == 2:
            types = np.full(len(nodes), types.item()) if types.size == 1 else types
            nodes = nodes.reshape(-1)
        faces, cell_surface = surface_of_cells(Cells(types, nodes), n_verts)
        surface = replace(surface, face_sizes=cell_surface.face_sizes, cells=cell_surface.cells)
    else:
        faces = arrays.get("faces", np.empty((0, 3), np.int32))
    reading.notes.left_out("arrays that no other refers to", sorted(arrays.unread))
    stored_name, start_s, times = (
        arrays.get("name"),
        _number(arrays, "start_s"),
        arrays.get("times"),
    )
    if stored_name is not None and stored_name.dtype.kind == "U" and stored_name.size == 1:
        name = str(stored_name.ravel()[0]) or name
    if times is not None:
        timing = Timing.of_times(times, n_frames).at_rate(reading.fps)
    else:
        fps = _number(arrays, "fps") if reading.fps is None else reading.fps
        timing = Timing.of_rate(fps, start_s)
    return Description(faces, name, timing, surface)


def vertex_numbers(arrays: Mapping[str, Array]) -> Array:
    """Return the vertex numbers of the cells or faces of named arrays."""
    return arrays["cells"] if "cells" in arrays else arrays["faces"]


def _read_surface(arrays: Mapping[str, Array]) -> Surface:
    """Return the surface of named arrays, without checking that it fits a mesh."""
    names, kinds, domains = (
        text_list(arrays, f"attribute_{field}") for field in ("names", "kinds", "domains")
    )
    if not len(names) == len(kinds) == len(domains):
        raise FormatError(
            f"has {len(names)} attribute_names, {len(kinds)} attribute_kinds and "
            f"{len(domains)} attribute_domains; the numbers must be equal"
        )
    attributes = tuple(
        Attribute(
            name,
            _parse_enum(Kind, kinds[index], "attribute_kinds"),
            _parse_enum(Domain, domains[index], "attribute_domains"),
            native(_required(arrays, f"attribute_{index}_values")),
            arrays.get(f"attribute_{index}_indices"),
        )
        for index, name in enumerate(names)
    )
    groups = tuple(
        FaceGroups(
            name,
            tuple(text_list(arrays, f"group_{index}_labels")),
            _required(arrays, f"group_{index}_numbers"),
        )
        for index, name in enumerate(text_list(arrays, "group_names"))
    )
    part_names = text_list(arrays, "part_names")
    sizes = arrays.get("part_sizes", np.empty((0, 2), np.int64))
    if sizes.shape != (len(part_names), 2) or sizes.dtype.kind not in "iu":
        raise FormatError(
            f"part_sizes must be integers of shape ({len(part_names)}, 2), for {len(part_names)} "
            f"part_names; got {sizes.dtype} of {sizes.shape}"
        )
    rows = zip(part_names, sizes.tolist(), strict=True)
    parts = tuple(Part(name, *row) for name, row in rows)
    hard_edges = arrays.get("hard_edges")
    return Surface(arrays.get("face_sizes"), attributes, groups, parts, hard_edges=hard_edges)


def text_array(texts: Sequence[str]) -> Array:
    """Return strings as an array of shape (N,)."""
    return np.array([str(text) for text in texts], dtype=np.str_)


def text_list(arrays: Mapping[str, Array], name: str) -> list[str]:
    """Return the strings of a named array; empty if it is missing.

    Raises
    ------
    FormatError
        If it is not text of shape (N,).
    """
    array = arrays.get(name)
    if array is None:
        return []
    if array.ndim != 1 or (array.dtype.kind != "U" and array.size):
        raise FormatError(f"{name} must be text of shape (N,); got {array.dtype} of {array.shape}")
    return [str(text) for text in array]


def _number(arrays: Mapping[str, Array], name: str) -> float:
    array = arrays.get(name)
    if array is None:
        return 0.0
    if array.dtype.kind not in "iuf" or array.size != 1:
        raise FormatError(f"{name} must be one number; got {array.dtype} of shape {array.shape}")
    return float(array.ravel()[0])


def _required(arrays: Mapping[str, Array], name: str) -> Array:
    if name not in arrays:
        raise FormatError(f"has no array {name!r}, which other arrays refer to")
    return arrays[name]


def _parse_enum(kind: Any, text: str, name: str) -> Any:
    try:
        return kind(text)
    except ValueError:
        raise FormatError(f"{name} must be one of {', '.join(kind)}; got {text!r}") from None


class Layout(Enum):
    """Axis order of the positions of T frames and V vertices."""

    FRAMES_FIRST = "(T, V, 3)"
    FRAMES_LAST = "(V, 3, T)"  # as in registered body scans

    def sizes(self, shape: tuple[int, ...]) -> tuple[int, int]:
        """Return the number of frames and vertices of an array of the given shape."""
        return (shape[0], shape[1]) if self is Layout.FRAMES_FIRST else (shape[2], shape[0])


def has_positions(shape: tuple[int, ...] | None) -> bool:
    """Whether an array of the given shape can be positions of frames."""
    return shape is not None and len(shape) == 3 and 3 in shape[1:] and min(shape) > 0


def find_layout(
    shape: tuple[int, ...], faces: npt.NDArray[np.integer], name: str, *, is_documented: bool
) -> Layout:
    """Return the layout of an array of positions.

    The axis of size 3 decides. If two axes have size 3, the largest vertex index of the faces does:
    it must be in range, and if it is in both layouts, it should be the last vertex.

    Parameters
    ----------
    faces : integer array
    name : str
        Name of the array, for messages.
    is_documented : bool
        Whether the array has the documented name, which means (T, V, 3) if that is possible.

    Raises
    ------
    InvalidInputError
        If no axis has size 3, or both layouts fit equally well.
    """
    if not has_positions(shape):
        if len(shape) == 3 and 0 in shape[:2] and shape[2] == 3:
            return Layout.FRAMES_FIRST  # empty: the caller reports it
        raise InvalidInputError(f"{name} must have shape (T, V, 3) or (V, 3, T); got {shape}")
    axes = {Layout.FRAMES_FIRST: shape[2], Layout.FRAMES_LAST: shape[1]}
    possible = [layout for layout, size in axes.items() if size == 3]
    if len(possible) == 1:
        return possible[0]
    largest = int(faces.max()) if faces.size and faces.dtype.kind in "iu" else 0
    fitting = [layout for layout in possible if layout.sizes(shape)[1] > largest]
    if len(fitting) == 1 or (is_documented and Layout.FRAMES_FIRST in fitting):
        return fitting[0]
    exact_fits = [layout for layout in fitting if layout.sizes(shape)[1] == largest + 1]
    if len(exact_fits) == 1:
        return exact_fits[0]
    raise InvalidInputError(
        f"{name} has shape {shape} and faces use vertices up to {largest}: it may be "
        "(T, V, 3) or (V, 3, T); store it as (T, V, 3) under the name vertices"
    )
