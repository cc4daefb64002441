"""Attributes and groups of an OBJ file.

Supports texture coordinates (``vt``, the second number of ``v/vt/vn``), vertex colors (``v`` with
six numbers), ``usemtl``, ``g``, ``o``, and normals (``vn``) that change between frames. Hard edges
come from normals, or without normals from smoothing groups (``s``). Material libraries are not
read.
"""

from contextlib import suppress
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.errors import FormatError
from meshreel.formats.frames.field_tracks import NORMALS, Field, Fields, Key
from meshreel.formats.meshes.obj import obj_mesh
from meshreel.formats.notes import note_left_out, note_normals
from meshreel.formats.surfaces.hard_edges import (
    HardEdges,
    NormalNotes,
    edges_between_groups,
    find_hard_edges,
)
from meshreel.formats.text.token_lines import TokenLines, split_lines
from meshreel.model.geometry.polygons import ragged_indices
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Part, Surface

STATEMENTS = {"material": b"usemtl", "group": b"g", "object": b"o"}
"""Statement that begins a face group, by the name of the groups."""

NORMALS_NAME = "normals"
"""Name of the track with the normals."""

N_COLORED = 6
"""How many numbers a vertex with a color has."""


LEFT_OUT = {
    b"l": "lines", b"p": "points", b"mtllib": "the material library",
    b"curv": "curves", b"curv2": "curves", b"surf": "free-form surfaces",
}  # fmt: skip
"""What notes call the contents of unsupported statements."""


def parse_obj_surface(data: bytes, notes: list[str] | None = None) -> Surface:
    """Return the attributes, groups and parts of an OBJ file that `parse_obj` can read.

    Colors that are integers beyond 1 are taken as 0..255 and scaled to floats in 0..1. Corners
    without a valid texture coordinate get (0, 0) if others have one. Objects are parts if their
    faces use only their own vertices, otherwise groups; a single object is neither.

    Raises
    ------
    FormatError
        If a line is invalid; the error names it.
    """
    lines = split_lines(data, continuation=True)
    face_lines = np.flatnonzero(lines.begins_with(b"f"))
    parts = _parts(lines, face_lines)
    attributes = (_texture_coordinates(lines, face_lines), _colors(lines))
    groups = [_groups(lines, face_lines, name) for name in STATEMENTS]
    hard = _hard_edges(lines, face_lines)
    if notes is not None:
        if hard is not None:
            NormalNotes(notes).add("", hard)
        elif lines.begins_with(b"vn").any():
            note_normals(notes)
        for what in dict.fromkeys(what for word, what in LEFT_OUT.items()
                                  if lines.begins_with(word).any()):  # fmt: skip
            note_left_out(notes, what)
    return Surface(
        None,
        tuple(one for one in attributes if one is not None),
        tuple(one for one in groups if one.labels and not _is_redundant(one, parts)),
        parts,
        hard_edges=None if hard is None else hard.edges,
    )


def _hard_edges(lines: TokenLines, face_lines: Integers) -> HardEdges | None:
    """Hard edges from normals or smoothing groups; None if the file has neither."""
    statements = np.flatnonzero(lines.begins_with(b"s"))
    if not len(statements) and not lines.begins_with(b"vn").any():
        return None
    mesh = obj_mesh(lines)
    with suppress(FormatError):
        if (normals := _normals(lines, face_lines)) is not None:
            domain, values = normals
            corner_normals = values[mesh.corners] if domain is Domain.VERTEX else values
            return find_hard_edges(mesh, corner_normals)
    if not len(statements):
        return None
    labels = {"off": 0, "0": 0, "": 0}
    statement_labels = [
        labels.setdefault(lines.words_after_first(one), len(labels)) for one in statements.tolist()
    ]
    above = _last_above(statements, face_lines)
    # The format turns smoothing off above the first statement.
    found = edges_between_groups(mesh, np.array([*statement_labels, 0])[above])
    return None if found.edges is None else found


def parse_obj_fields(data: bytes) -> Fields:
    """Return the texture coordinates, colors and normals of an OBJ file, in float32.

    Normals belong to vertices if each corner uses the same index for vertex and normal, otherwise
    to corners; corners without a normal get NaN. Normals that are not numbers are ignored.

    Raises
    ------
    FormatError
        As `parse_obj_surface`.
    """
    lines = split_lines(data, continuation=True)
    face_lines = np.flatnonzero(lines.begins_with(b"f"))
    found: dict[Key, tuple[npt.NDArray[Any], Field]] = {}
    for one in (_texture_coordinates(lines, face_lines), _colors(lines)):
        if one is not None:
            values = one.per_item()
            field = Field(values.dtype, values.shape[1], "", one.kind)
            found[one.domain, one.name] = values, field
    with suppress(FormatError):
        if (normals := _normals(lines, face_lines)) is not None:
            domain, values = normals
            found[domain, NORMALS_NAME] = values, Field(values.dtype, 3, NORMALS)
    return found


def _normals(
    lines: TokenLines, face_lines: Integers
) -> tuple[Domain, npt.NDArray[np.float32]] | None:
    """Domain and values of the normals; None if no corner has one."""
    is_row = lines.begins_with(b"vn")
    row_lines = np.flatnonzero(is_row)
    if not len(row_lines):
        return None
    rows, is_there = _rows(lines, face_lines, is_row, 2)
    if not is_there.any():
        return None
    is_whole = lines.counts[row_lines] > len("xyz")
    values = np.full((len(row_lines) + 1, 3), np.nan, np.float32)  # last row: missing normal
    places = lines.first[row_lines[is_whole]][:, None] + np.arange(1, 4)
    values[np.flatnonzero(is_whole)] = lines.floats(places)
    n_verts = int(lines.begins_with(b"v").sum())
    are_vertex_normals = is_there.all() and len(row_lines) == n_verts
    if are_vertex_normals and (rows == obj_mesh(lines).corners).all():
        return Domain.VERTEX, values[:-1]
    rows[~is_there] = len(row_lines)
    return Domain.CORNER, values[rows]


def _rows(
    lines: TokenLines, face_lines: Integers, is_row: npt.NDArray[np.bool_], n_slashes: int
) -> tuple[Integers, npt.NDArray[np.bool_]]:
    """Row that each corner refers to after `n_slashes` slashes, and whether it exists."""
    counts = lines.counts[face_lines] - 1
    words = ragged_indices(lines.first[face_lines] + 1, counts)
    written, has_one = lines.integers_after_slash(words, n_slashes)
    n_above = np.repeat(np.cumsum(is_row)[face_lines], counts)
    rows = np.where(written < 0, n_above + written, written - 1)
    return rows, has_one & (rows >= 0) & (rows < int(is_row.sum()))


def _texture_coordinates(lines: TokenLines, face_lines: Integers) -> Attribute | None:
    is_row = lines.begins_with(b"vt")
    row_lines = np.flatnonzero(is_row)
    rows, is_there = _rows(lines, face_lines, is_row, 1)
    if not is_there.any():
        return None
    values = _texture_rows(lines, row_lines)
    if not is_there.all():
        rows[~is_there] = len(values)
        values = np.concatenate([values, np.zeros((1, 2), np.float32)])
    return Attribute("uv", Kind.UV, Domain.CORNER, values, rows.astype(np.int32))


def _texture_rows(lines: TokenLines, row_lines: Integers) -> npt.NDArray[np.float32]:
    """Texture coordinates of the given lines; v is 0 if a line has only u."""
    first, counts = lines.first[row_lines], lines.counts[row_lines]
    values = np.zeros((len(row_lines), 2), np.float32)
    for column in range(2):
        has_it = counts > column + 1
        values[has_it, column] = lines.floats(first[has_it] + column + 1)
    return values


def _colors(lines: TokenLines) -> Attribute | None:
    vertex_lines = np.flatnonzero(lines.begins_with(b"v"))
    if (lines.counts[vertex_lines] != N_COLORED + 1).any():
        return None
    values = lines.floats(lines.first[vertex_lines][:, None] + np.arange(4, 7))
    if values.max() > 1 and (values == np.rint(values)).all():
        values /= 255
    return Attribute("color", Kind.COLOR, Domain.VERTEX, values.astype(np.float32))


def _groups(lines: TokenLines, face_lines: Integers, name: str) -> FaceGroups:
    statements = np.flatnonzero(lines.begins_with(STATEMENTS[name]))
    above = _last_above(statements, face_lines)
    labels: dict[str, int] = {}
    numbers = np.full(len(statements) + 1, -1, np.int32)  # last row: no statement above
    for used in np.unique(above[above >= 0]):
        if label := lines.words_after_first(int(statements[used])):
            numbers[used] = labels.setdefault(label, len(labels))
    return FaceGroups(name, tuple(labels), numbers[above])


def _is_redundant(groups: FaceGroups, parts: tuple[Part, ...]) -> bool:
    """Whether groups are objects that equal the parts, or a single object with all faces."""
    is_whole = len(groups.labels) == 1 and bool((groups.numbers == 0).all())
    return groups.name == "object" and (is_whole or bool(parts))


def _parts(lines: TokenLines, face_lines: Integers) -> tuple[Part, ...]:
    """Objects as parts, if there are several and none uses vertices of another."""
    statements = np.flatnonzero(lines.begins_with(STATEMENTS["object"]))
    vertex_objects = _last_above(statements, np.flatnonzero(lines.begins_with(b"v")))
    face_objects = _last_above(statements, face_lines)
    names = [lines.words_after_first(statement) for statement in statements.tolist()]
    used = np.unique(np.concatenate([vertex_objects, face_objects]))
    if used[0] < 0 or len(used) < 2:
        return ()
    labels = [names[number] for number in used]
    if len({*labels}) < len(labels) or not all(labels):
        return ()
    mesh = obj_mesh(lines)
    if (vertex_objects[mesh.corners] != np.repeat(face_objects, mesh.counts)).any():
        return ()
    n_verts, n_faces = (
        np.bincount(of, minlength=len(names)) for of in (vertex_objects, face_objects)
    )
    return tuple(Part(names[one], int(n_verts[one]), int(n_faces[one])) for one in used)


def _last_above(statements: Integers, lines: Integers) -> Integers:
    """Index of the last statement above each line; -1 if there is none."""
    return np.searchsorted(statements, lines) - 1
