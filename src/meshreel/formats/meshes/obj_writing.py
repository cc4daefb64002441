"""Writer for Wavefront OBJ files, one frame per file.

Writes positions with vertex colors (RGB floats), texture coordinates, polygons, the groups that
`meshreel.formats.meshes.obj` reads, and parts as objects. Tracks of colors, normals and
texture coordinates are written for each frame. Hard edges become smoothing groups, or normals of
each frame if smoothing groups cannot express them.
"""

import re
from collections.abc import Container, Iterable, Iterator, Mapping

import numpy as np

from meshreel.arrays import Values
from meshreel.formats.frames.field_tracks import PLAIN_NAMES
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.kinds import Encode
from meshreel.formats.text.decimal_text import face_rows, number_rows, vertex_rows
from meshreel.model.geometry.connectivity import lowest_connected
from meshreel.model.geometry.hard_edges import RowNormals, hard_flags, shared_edges
from meshreel.model.geometry.polygons import join_triangles
from meshreel.model.notes import (
    Notes,
    note_name,
    note_track_type,
    note_unwritten,
    note_unwritten_tracks,
    note_unwritten_units,
)
from meshreel.model.sequence import Faces, Vertices
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Surface
from meshreel.model.tracks import TrackKind, TrackSource, is_color

STATEMENTS = {"material": b"usemtl", "group": b"g", "object": b"o"}
"""Statement that begins a face group, by the name of the groups."""

SMOOTHING = "s"
"""OBJ statement of smoothing groups."""

UNSUPPORTED = "tracks other than vertex colors, normals and UV coordinates"

TOO_MANY = "more than one color, normal or UV track"


def obj_encoder(stream: FrameStream) -> Encode:
    """Return a function that encodes a frame as an OBJ file.

    Float32 and float64 positions round-trip exactly. Constant text is formatted once.
    """
    faces, surface, tracks, notes = stream.faces, stream.surface, stream.tracks, stream.notes
    uv = first_attribute(surface, Kind.UV, {Domain.VERTEX, Domain.CORNER}, {2}, "f")
    colors = first_attribute(surface, Kind.COLOR, {Domain.VERTEX}, {3, 4}, "iuf")
    groups = _groups(surface)
    note_unwritten(surface, (uv, colors, *groups), ".obj", notes, parts=True, hard_edges=True)
    written_tracks = select_tracks(tracks, uv, colors, notes)
    domains = {kind: tracks[name].domain for kind, name in written_tracks.items()}

    # One-based indices of the texture coordinate and normal of each corner.
    counts, shading = surface.sizes(len(faces)), None
    corners = join_triangles(counts, faces)
    corner_numbers = np.arange(1, len(corners) + 1)
    rows_of: dict[Domain, Values] = {Domain.VERTEX: corners + 1, Domain.CORNER: corner_numbers}
    normal_rows = rows_of[domains[TrackKind.NORMAL]] if TrackKind.NORMAL in domains else None
    texture_rows = rows_of[domains[TrackKind.UV]] if TrackKind.UV in domains else None
    if uv is not None:
        rows = np.arange(len(uv.values)) if uv.indices is None else uv.indices
        texture_rows = (rows[corners] if uv.domain is Domain.VERTEX else rows) + 1
    if surface.hard_edges is not None and TrackKind.NORMAL not in written_tracks:
        smoothing = _smoothing_groups(surface, faces)
        if smoothing is not None:
            groups.append(smoothing)
        else:
            n_verts = int(max(faces.max(), surface.hard_edges.max())) + 1
            shading = RowNormals.of_surface(faces, surface, n_verts)
            normal_rows = shading.rows.of_corner + 1

    words: Iterable[str] = map(str, (corners + 1).tolist())
    if texture_rows is not None:
        words = map("{}/{}".format, words, texture_rows.tolist())
    if normal_rows is not None:
        slashes = "/" if texture_rows is not None else "//"
        words = map(f"{{}}{slashes}{{}}".format, words, normal_rows.tolist())
    face_lines = [f"f {row}\n" for row in face_rows(counts, words)]
    texture = "" if uv is None else _lines("vt", uv.values)
    objects = list(_objects(surface, face_lines, groups))
    static_colors = None if colors is None else _color_rows(colors.per_item())

    def encode(vertices: Vertices, values: Mapping[str, Values]) -> bytes:
        rows = ((kind, values[name]) for kind, name in written_tracks.items())
        track_values = {  # colors are in 0..1
            kind: (each / 255 if each.dtype == np.uint8 else each).astype(np.float32)
            for kind, each in rows
        }
        suffixes = (
            _color_rows(track_values[TrackKind.COLOR])
            if TrackKind.COLOR in track_values
            else static_colors
        )
        statements = [(TrackKind.UV, "vt"), (TrackKind.NORMAL, "vn")]
        head = texture + "".join(
            _lines(word, track_values[kind]) for kind, word in statements if kind in track_values
        )
        if shading is not None:
            head += _lines("vn", shading.of_frames(vertices[np.newaxis])[0].astype(np.float32))
        pieces = []
        for first_line, verts, face_text in objects:
            colors_of_part = None if suffixes is None else suffixes[verts]
            positions = vertex_rows(vertices[verts], prefix="v ", suffixes=colors_of_part)
            pieces += [first_line, positions, head.encode(), face_text]
            head = ""
        return b"".join(pieces)

    return encode


def _lines(word: str, values: Values) -> str:
    return "".join(f"{word} {row}\n" for row in number_rows(values))


def _objects(
    surface: Surface, face_lines: list[str], groups: list[FaceGroups]
) -> Iterator[tuple[bytes, slice, bytes]]:
    """Yield sections of the file: first line, if any, vertices, and the text after them."""
    if not surface.parts:
        yield b"", slice(None), _face_text(slice(0, None), face_lines, groups)
    vertex = face = 0
    for part in surface.parts:
        verts, faces = slice(vertex, vertex + part.n_verts), slice(face, face + part.n_faces)
        text = _face_text(faces, face_lines, groups)
        yield _statement("object", part.name).encode(), verts, text
        vertex, face = verts.stop, faces.stop


def _face_text(faces: slice, face_lines: list[str], groups: list[FaceGroups]) -> bytes:
    """Lines of the given faces, with a statement wherever the group changes."""
    lines = face_lines[faces]
    for group in groups:
        previous = -2 if faces.start else -1  # -2 restates a group that continues from above
        changed = np.flatnonzero(np.diff(group.numbers[faces], prepend=previous))
        for face, number in zip(changed, group.numbers[faces][changed], strict=True):
            label = group.labels[number] if number >= 0 else ""
            lines[face] = _statement(group.name, label) + lines[face]
    return "".join(lines).encode()


def _statement(name: str, label: str) -> str:
    """Line that begins a group or object; without a label it ends the current one."""
    words = re.sub(r"[#\\]", "_", label).split()
    word = SMOOTHING if name == SMOOTHING else STATEMENTS[name].decode()
    return " ".join([word, *words]) + "\n"


def _smoothing_groups(surface: Surface, faces: Faces) -> FaceGroups | None:
    """Smoothing groups: numbered sets of faces connected across soft edges; "off" for single faces.

    None if a hard edge separates two faces of the same set, which smoothing groups cannot express.
    """
    counts = surface.sizes(len(faces))
    edges = shared_edges(counts, join_triangles(counts, faces))
    is_hard = hard_flags(surface.hard_edges, edges)
    sides = np.flatnonzero(edges.of_side >= 0)
    side_faces, edge = np.repeat(np.arange(len(counts)), counts)[sides], edges.of_side[sides]
    _, first = np.unique(edge, return_index=True)
    first_faces = side_faces[first][edge]
    is_soft = ~is_hard[edge]
    number = lowest_connected(len(counts), side_faces[is_soft], first_faces[is_soft])
    if (number[side_faces] == number[first_faces])[~is_soft & (side_faces != first_faces)].any():
        return None
    sets, row, sizes = np.unique(number, return_inverse=True, return_counts=True)
    numbers = np.where(sizes == 1, 0, np.cumsum(sizes > 1))[row]
    labels = ("off", *map(str, range(1, len(sets) + 1)))
    return FaceGroups(SMOOTHING, labels, numbers.astype(np.int32))


def first_attribute(
    surface: Surface, kind: Kind, domains: Container[Domain], widths: Container[int], types: str
) -> Attribute | None:
    """Return the first attribute of a kind, domain, number of components and kind of NumPy type."""
    return next(
        (
            attribute
            for attribute in surface.of_kind(kind)
            if attribute.domain in domains
            and attribute.values.shape[1] in widths
            and attribute.values.dtype.kind in types
        ),
        None,
    )


def _color_rows(colors: Values) -> list[str]:
    values = colors[:, :3]
    if values.dtype.kind != "f":
        values = (values / 255).astype(np.float32)
    return number_rows(values)


def _groups(surface: Surface) -> list[FaceGroups]:
    """Groups that have an OBJ statement; parts use the object statement."""
    by_name = {group.name: group for group in reversed(surface.groups)}
    names = [name for name in STATEMENTS if name != "object" or not surface.parts]
    return [by_name[name] for name in names if name in by_name]


def select_tracks(
    tracks: Mapping[str, TrackSource],
    uv: Attribute | None,
    colors: Attribute | None,
    notes: Notes,
) -> dict[TrackKind, str]:
    """Return the names of the tracks that an OBJ file can store, at most one of each kind.

    Parameters
    ----------
    uv, colors : Attribute or None
        Attributes that it stores.
    notes : Notes
        Receives sentences on tracks that are left out, renamed, converted, or lose their unit.
    """
    attributes = {TrackKind.UV: uv, TrackKind.COLOR: colors}
    used_kinds = {kind for kind, attribute in attributes.items() if attribute is not None}
    name_of_kind: dict[TrackKind, str] = {}
    unwritten: dict[str, list[str]] = {}
    for name, track in tracks.items():
        if not _is_supported(track):
            unwritten.setdefault(UNSUPPORTED, []).append(name)
        elif track.kind in used_kinds:
            unwritten.setdefault(TOO_MANY, []).append(name)
        else:
            used_kinds.add(track.kind)
            name_of_kind[track.kind] = name
            note_name("track", name, PLAIN_NAMES[track.kind], ".obj", notes)
            note_track_type(name, track.dtype, np.dtype(np.float32), notes)
            if track.kind is TrackKind.COLOR and track.shape[2] > len("rgb"):
                notes.unwritten(name, f"alpha of track {name!r} left out: .obj does not store it")
    for reason, names in unwritten.items():
        note_unwritten_tracks(names, ".obj", notes, reason)
    units = {name: tracks[name].unit for name in name_of_kind.values()}
    note_unwritten_units(units, ".obj", notes)
    return name_of_kind


def _is_supported(track: TrackSource) -> bool:
    if track.kind is TrackKind.COLOR:
        return track.domain is Domain.VERTEX and is_color(track.kind, track.dtype)
    return track.kind in (TrackKind.UV, TrackKind.NORMAL) and track.domain is not Domain.FACE
