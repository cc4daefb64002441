"""Object File Format (OFF): the mesh and attributes of one frame.

Supports the keywords ``OFF``, ``COFF``, ``NOFF``, ``STOFF`` and their combinations, or none; counts
on the line of the keyword, with or without a blank, or on the next line; one vertex or face per
line. ``4OFF``, ``nOFF`` (other dimensions) and binary files are not supported.

A vertex line is x y z, a normal if the keyword has N, a color if it has C, and two texture
coordinates if it has ST. A face line may end with a color. Normals are ignored, and so are colors
given as an index of a color table.
"""

import re
from collections.abc import Mapping

import numpy as np

from meshreel.arrays import Integers, Values
from meshreel.errors import FormatError
from meshreel.formats.frames.frame import Frame
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.kinds import Encode, FrameFormat
from meshreel.formats.meshes.obj_writing import first_attribute
from meshreel.formats.surfaces.polygons import polygon_mesh
from meshreel.formats.text.decimal_text import face_rows, number_rows, vertex_rows
from meshreel.formats.text.token_lines import TokenLines, split_lines
from meshreel.model.geometry.polygons import join_triangles, ragged_indices
from meshreel.model.notes import Notes, note_normals, note_unwritten
from meshreel.model.sequence import Vertices
from meshreel.model.surface import Attribute, Domain, Kind, Surface
from meshreel.runtime.counting import counted

NO_BLANK = re.compile(rb"^([ \t]*(?:ST)?C?N?OFF)(?=\d)", re.MULTILINE)
"""A keyword without a blank before the number of vertices."""


def read_off(data: bytes) -> Frame:
    """Read an OFF file; positions are float64.

    Colors are bytes if none has a decimal point. They are ignored unless all vertices, or all
    faces, have three or four numbers.

    Raises
    ------
    FormatError
        If a line is invalid, which the error names, or the number of lines differs from the header.
    """
    lines = split_lines(NO_BLANK.sub(rb"\1 ", data, count=1))
    keyword, n_verts, n_faces, begin = _read_header(lines)
    n_lines = lines.n_lines - begin
    if n_verts + n_faces != n_lines:
        raise FormatError(
            f"declares {counted(n_verts, 'vertex')} and {counted(n_faces, 'face')}, one per line, "
            f"but {n_lines} lines follow; the file is truncated or damaged"
        )
    vertex_lines = np.arange(begin, begin + n_verts)
    face_lines = np.arange(begin + n_verts, lines.n_lines)
    counts = lines.integers(lines.first[face_lines])
    is_wrong = (counts < 0) | (counts >= lines.counts[face_lines])
    if is_wrong.any():
        face = int(np.argmax(is_wrong))
        line = face_lines[face]
        raise FormatError(
            f"{lines.location(line)}: declares {counts[face]} corners; "
            f"{lines.counts[line] - 1} numbers follow"
        )
    corners = lines.integers(ragged_indices(lines.first[face_lines] + 1, counts))
    vertices = lines.positions(vertex_lines)
    mesh = polygon_mesh(
        vertices, counts, corners, location=lambda face: lines.location(face_lines[face])
    )
    attributes, notes = list[Attribute | None](), Notes()
    n_texture = 2 if keyword.startswith("ST") else 0
    if "C" in keyword:
        n_before = np.full(len(vertex_lines), 6 if "N" in keyword else 3)
        attributes.append(_colors(lines, vertex_lines, n_before, n_texture, Domain.VERTEX))
    if n_texture and (lines.counts[vertex_lines] >= 5).all():
        ends = lines.first[vertex_lines] + lines.counts[vertex_lines]
        uvs = lines.floats(ends[:, None] + np.arange(-2, 0)).astype(np.float32)
        attributes.append(Attribute("uv", Kind.UV, Domain.VERTEX, uvs))
    face_colors = _colors(lines, face_lines, counts + 1, 0, Domain.FACE)
    attributes.append(face_colors)
    if "N" in keyword:
        note_normals(notes)
    if face_colors is None and (lines.counts[face_lines] > counts + 1).any():
        notes.left_out("face colors, which not all faces have as three or four numbers")
    surface = Surface(attributes=tuple(filter(None, attributes)))
    of_vertices = [one for one in surface.attributes if one.domain is Domain.VERTEX]
    n_read = 3 + 3 * ("N" in keyword) + sum(one.values.shape[1] for one in of_vertices)
    if (lines.counts[vertex_lines] > n_read).any():
        notes.left_out("further numbers of vertices")
    return Frame(mesh, surface, notes=notes)


def _read_header(lines: TokenLines) -> tuple[str, int, int, int]:
    """Return keyword and counts of the header, and the index of the first line after it."""
    if lines.n_lines == 0:
        raise FormatError("is empty; expected the word OFF")
    keyword = lines.word(0)
    n_words = 0 if keyword.lstrip("+").isdigit() else 1
    if n_words and not re.fullmatch(r"(?:ST)?C?N?OFF", keyword):
        raise FormatError(
            f"{lines.location(0)}: expected OFF (with C, N or ST before it); got {keyword!r}"
        )
    line = 1 if lines.counts[0] == n_words else 0
    offset = 0 if line else n_words
    if line == lines.n_lines or lines.counts[line] < offset + 2:
        raise FormatError(f"{lines.location(0)}: expected the numbers of vertices and faces next")
    n_verts, n_faces = lines.integers(lines.first[line] + offset + np.arange(2)).tolist()
    if n_verts < 0 or n_faces < 0:
        raise FormatError(f"{lines.location(line)}: counts must not be negative")
    return keyword if n_words else "OFF", n_verts, n_faces, line + 1


def off_encoder(stream: FrameStream) -> Encode:
    """Return a function that encodes a frame as an OFF file.

    Float32 and float64 positions round-trip exactly. All other text is formatted once.
    """
    surface = stream.surface
    colors, face_colors = (
        first_attribute(surface, Kind.COLOR, {domain}, {3, 4}, "uf")
        for domain in (Domain.VERTEX, Domain.FACE)
    )
    uv = first_attribute(surface, Kind.UV, {Domain.VERTEX}, {2}, "f")
    note_unwritten(surface, (colors, uv, face_colors), ".off", stream.notes)
    keyword = f"{'ST' if uv else ''}{'C' if colors else ''}OFF"
    columns = [number_rows(column.per_item()) for column in (colors, uv) if column]
    suffixes = [" ".join(words) for words in zip(*columns, strict=True)] if columns else None

    counts = surface.sizes(len(stream.faces))
    rows = face_rows(counts, map(str, join_triangles(counts, stream.faces).tolist()))
    ends = ["\n"] * len(rows)
    if face_colors is not None:
        ends = [f" {row}\n" for row in number_rows(face_colors.per_item())]
    pieces = zip(counts.tolist(), rows, ends, strict=True)
    face_text = "".join(f"{count} {row}{end}" for count, row, end in pieces).encode("ascii")

    def encode(vertices: Vertices, values: Mapping[str, Values]) -> bytes:
        header = f"{keyword}\n{len(vertices)} {len(rows)} 0\n".encode("ascii")
        return header + vertex_rows(vertices, suffixes=suffixes) + face_text

    return encode


def _colors(
    lines: TokenLines, line_indices: Integers, n_before: Integers, n_after: int, domain: Domain
) -> Attribute | None:
    """Colors on the given lines, after `n_before` and before `n_after` words."""
    lengths = lines.counts[line_indices] - n_before - n_after
    if lengths[0] not in (3, 4) or (lengths != lengths[0]).any():
        return None
    words = (lines.first[line_indices] + n_before)[:, None] + np.arange(lengths[0])
    values = lines.floats(words)
    is_whole = (values == np.rint(values)) & (values >= 0) & (values <= 255)
    is_bytes = bool(is_whole.all()) and not lines.have_points(words)
    return Attribute("color", Kind.COLOR, domain, values.astype("u1" if is_bytes else "f4"))


FORMATS = (FrameFormat(".off", "OFF", read_off, off_encoder, is_decimal=True),)
