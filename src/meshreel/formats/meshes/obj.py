"""Wavefront OBJ: reader for the mesh, attributes and groups of one frame.

Supports ``v`` (with colors: six numbers), ``f`` (``v/vt/vn``; negative indices count back from the
last row above), texture coordinates (``vt``), ``usemtl``, ``g``, ``o``, comments, and a backslash
that continues a line. Normals (``vn``) that change between frames are a track; hard edges come from
normals, or without normals from smoothing groups (``s``). Material libraries are not read.

trimesh is not used: it splits vertices at texture seams and drops unused ones, so frames could get
different vertices. A sequence needs all of them in file order.
"""

from contextlib import suppress
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.errors import FormatError
from meshreel.formats.frames.field_tracks import NORMALS, NORMALS_NAME, Field
from meshreel.formats.frames.frame import Frame, fields_of
from meshreel.formats.kinds import VERTEX_FACE_CORNER, FrameFormat
from meshreel.formats.meshes.obj_writing import STATEMENTS, obj_encoder
from meshreel.formats.surfaces.hard_edges import HardEdges, edges_between_groups, find_hard_edges
from meshreel.formats.surfaces.polygons import PolygonMesh, polygon_mesh
from meshreel.formats.text.token_lines import TokenLines, split_lines
from meshreel.model.geometry.polygons import ragged_indices
from meshreel.model.notes import Notes, note_normals
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Part, Surface

N_COLORED = 6
"""Numbers of a vertex with a color."""

LEFT_OUT = {
    "l": "lines", "p": "points", "curv": "curves", "curv2": "curves", "surf": "free-form surfaces",
    "vt": "texture coordinates of no face", "s": "smoothing groups, as there are normals",
}  # fmt: skip
"""What notes call the contents of statements that are not read; others are listed."""


@dataclass(frozen=True, eq=False)
class _Lines:
    """The lines of a file, and those of faces with the words of their corners."""

    all: TokenLines
    face_lines: Integers
    counts: Integers
    corners: Integers

    @classmethod
    def of(cls, data: bytes) -> "_Lines":
        lines = split_lines(data, continuation=True)
        face_lines = lines.beginning_with(b"f")
        counts = lines.counts[face_lines] - 1
        return cls(lines, face_lines, counts, ragged_indices(lines.first[face_lines] + 1, counts))

    def n_above(self, rows: Integers) -> Integers:
        """Return how many of the lines `rows` are above the line of each corner."""
        return np.repeat(np.searchsorted(rows, self.face_lines), self.counts)


def read_obj(data: bytes) -> Frame:
    """Read an OBJ file; positions are float64, and all other numbers float32.

    Colors that are integers beyond 1 are read as 0..255 and scaled to floats in 0..1. Corners
    without a valid texture coordinate get (0, 0) if others have one. Objects are parts if their
    faces use only their own vertices, and there are several; otherwise groups. Normals belong
    to vertices if each corner uses the same index for vertex and normal, otherwise to corners;
    corners without a normal get NaN. Normals that are not numbers are ignored.

    Raises
    ------
    FormatError
        If a line is invalid, which the error names, or vertices or faces are missing.
    """
    lines = _Lines.of(data)
    vertex_lines = lines.all.beginning_with(b"v")
    indices = lines.all.integers(lines.corners, stop_at_slash=True)
    vertices = lines.all.positions(vertex_lines, 1)
    mesh = polygon_mesh(
        vertices,
        lines.counts,
        np.where(indices < 0, lines.n_above(vertex_lines) + indices, indices - 1),
        location=lambda face: lines.all.location(lines.face_lines[face]),
        file_index=lambda corner: indices[corner],
        allowed=f"1..{len(vertices)}, or count back with -1..-{len(vertices)}",
    )
    normals = None
    with suppress(FormatError):
        normals = _normals(lines, mesh)
    attributes = [*filter(None, (_texture_coordinates(lines), _colors(lines)))]
    parts = _parts(lines, mesh)
    groups = [_groups(lines, name) for name in STATEMENTS]
    surface = Surface(
        None,
        tuple(attributes),
        tuple(group for group in groups if group.labels and not (group.name == "object" and parts)),
        parts,
    )
    fields, notes = fields_of(attributes), Notes()
    if normals is not None:
        domain, values = normals
        fields[domain, NORMALS_NAME] = values, Field(values.dtype, 3, NORMALS)
    elif len(lines.all.beginning_with(b"vn")):
        note_normals(notes)
    _note_left_out(lines, surface, notes, has_normals=normals is not None)
    has_edges = normals is not None or len(lines.all.beginning_with(b"s")) > 0
    find_edges = partial(_hard_edges, lines, mesh, normals) if has_edges else None
    return Frame(mesh, surface, fields, notes, find_edges)


def _note_left_out(lines: _Lines, surface: Surface, notes: Notes, *, has_normals: bool) -> None:
    """Name all statements and numbers that are not read."""
    kinds = {attribute.kind for attribute in surface.attributes}
    read = [b"#", b"v", b"vn", b"f", b"mtllib", *STATEMENTS.values()]  # comments are for people
    read += [b"vt"] * (Kind.UV in kinds) + [b"s"] * (not has_normals)
    others = lines.all.other_first_words(read)
    for name in others:
        notes.left_out(LEFT_OUT.get(name, "statements"), None if name in LEFT_OUT else [name])
    libraries = lines.all.beginning_with(b"mtllib").tolist()
    notes.left_out("material libraries", map(lines.all.words_after_first, libraries))
    for word, n_read, contents in (
        (b"v", N_COLORED if Kind.COLOR in kinds else 3, "weights, or colors of some vertices"),
        (b"vt", 2, "third texture coordinates"),
    ):
        rows = lines.all.beginning_with(word)
        rows = rows[lines.all.counts[rows] > n_read + 1]
        numbers = {lines.all.word(token) for token in lines.all.first[rows] + n_read + 1}
        if numbers - {"0", "1", "0.0", "1.0", "0.000000", "1.000000"}:
            notes.left_out(contents)


def _hard_edges(
    lines: _Lines, mesh: PolygonMesh, normals: tuple[Domain, npt.NDArray[np.float32]] | None
) -> HardEdges | None:
    """Hard edges from normals or smoothing groups; None if one group contains all faces."""
    if normals is not None:
        domain, values = normals
        return find_hard_edges(mesh, values[mesh.corners] if domain is Domain.VERTEX else values)
    statements = lines.all.beginning_with(b"s")
    labels = {"off": 0, "0": 0, "": 0}
    statement_labels = [
        labels.setdefault(lines.all.words_after_first(statement), len(labels))
        for statement in statements.tolist()
    ]
    last_statements = _last_above(statements, lines.face_lines)
    # The format turns smoothing off above the first statement.
    groups = np.array([*statement_labels, 0])[last_statements]
    hard_edges = edges_between_groups(mesh, groups)
    return None if hard_edges.edges is None and (groups == groups[0]).all() else hard_edges


def _normals(lines: _Lines, mesh: PolygonMesh) -> tuple[Domain, npt.NDArray[np.float32]] | None:
    """Domain and values of the normals; None if no corner has one."""
    all_lines, row_lines = lines.all, lines.all.beginning_with(b"vn")
    if not len(row_lines):
        return None
    rows, has_row = _rows(lines, row_lines, 2)
    if not has_row.any():
        return None
    is_complete = all_lines.counts[row_lines] > len("xyz")
    values = np.full((len(row_lines) + 1, 3), np.nan, np.float32)  # last row: missing normal
    tokens = all_lines.first[row_lines[is_complete]][:, None] + np.arange(1, 4)
    values[np.flatnonzero(is_complete)] = all_lines.floats(tokens)
    are_vertex_normals = has_row.all() and len(row_lines) == len(mesh.vertices)
    if are_vertex_normals and (rows == mesh.corners).all():
        return Domain.VERTEX, values[:-1]
    rows[~has_row] = len(row_lines)
    return Domain.CORNER, values[rows]


def _rows(
    lines: _Lines, row_lines: Integers, n_slashes: int
) -> tuple[Integers, npt.NDArray[np.bool_]]:
    """Row that each corner refers to after `n_slashes` slashes, and whether it exists."""
    indices, has_index = lines.all.integers_after_slash(lines.corners, n_slashes)
    rows = np.where(indices < 0, lines.n_above(row_lines) + indices, indices - 1)
    return rows, has_index & (rows >= 0) & (rows < len(row_lines))


def _texture_coordinates(lines: _Lines) -> Attribute | None:
    row_lines = lines.all.beginning_with(b"vt")
    rows, has_row = _rows(lines, row_lines, 1)
    if not has_row.any():
        return None
    first, counts = lines.all.first[row_lines], lines.all.counts[row_lines]
    values = np.zeros((len(row_lines), 2), np.float32)  # v is 0 if a line has only u
    for column in range(2):
        has_column = counts > column + 1
        values[has_column, column] = lines.all.floats(first[has_column] + column + 1)
    if not has_row.all():
        rows[~has_row] = len(values)
        values = np.concatenate([values, np.zeros((1, 2), np.float32)])
    return Attribute("uv", Kind.UV, Domain.CORNER, values, rows.astype(np.int32))


def _colors(lines: _Lines) -> Attribute | None:
    vertex_lines = lines.all.beginning_with(b"v")
    if (lines.all.counts[vertex_lines] != N_COLORED + 1).any():
        return None
    values = lines.all.floats(lines.all.first[vertex_lines][:, None] + np.arange(4, 7))
    if values.max() > 1 and (values == np.rint(values)).all():
        values /= 255
    return Attribute("color", Kind.COLOR, Domain.VERTEX, values.astype(np.float32))


def _groups(lines: _Lines, name: str) -> FaceGroups:
    statements = lines.all.beginning_with(STATEMENTS[name])
    last_statements = _last_above(statements, lines.face_lines)
    labels: dict[str, int] = {}
    numbers = np.full(len(statements) + 1, -1, np.int32)  # last row: no statement above
    for row in np.unique(last_statements[last_statements >= 0]):
        if label := lines.all.words_after_first(int(statements[row])):
            numbers[row] = labels.setdefault(label, len(labels))
    return FaceGroups(name, tuple(labels), numbers[last_statements])


def _parts(lines: _Lines, mesh: PolygonMesh) -> tuple[Part, ...]:
    """Objects as parts, if there are several and none uses vertices of another."""
    statements = lines.all.beginning_with(STATEMENTS["object"])
    vertex_objects = _last_above(statements, lines.all.beginning_with(b"v"))
    face_objects = _last_above(statements, lines.face_lines)
    names = [lines.all.words_after_first(statement) for statement in statements.tolist()]
    objects = np.unique(np.concatenate([vertex_objects, face_objects]))
    if objects[0] < 0 or len(objects) < 2:
        return ()
    labels = [names[number] for number in objects]
    if len({*labels}) < len(labels) or not all(labels):
        return ()
    if (vertex_objects[mesh.corners] != np.repeat(face_objects, mesh.counts)).any():
        return ()
    n_verts, n_faces = (
        np.bincount(rows, minlength=len(names)) for rows in (vertex_objects, face_objects)
    )
    return tuple(Part(names[row], int(n_verts[row]), int(n_faces[row])) for row in objects)


def _last_above(statements: Integers, lines: Integers) -> Integers:
    """Index of the last statement above each line; -1 if there is none."""
    return np.searchsorted(statements, lines) - 1


FORMATS = (
    FrameFormat(
        ".obj",
        "Wavefront OBJ",
        read_obj,
        obj_encoder,
        is_decimal=True,
        track_domains=VERTEX_FACE_CORNER,
    ),
)
