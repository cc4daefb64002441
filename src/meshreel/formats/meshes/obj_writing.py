"""A frame to the bytes of a Wavefront OBJ file.

Written: positions, with colours of vertices if there are any; texture coordinates; polygons; the
groups that `meshreel.formats.meshes.obj_surface` reads; and parts as objects. Colours are floats of
three numbers. Of tracks, colours and normals of each frame, and its texture coordinates. Hard edges
are smoothing groups, or where these cannot say them, normals of each frame.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from meshreel.arrays import Values
from meshreel.formats.meshes.obj_surface import NORMALS_NAME, STATEMENTS
from meshreel.formats.notes import (
    note_track_name,
    note_track_type,
    note_unwritten,
    note_unwritten_tracks,
    note_unwritten_units,
)
from meshreel.formats.text.decimal_text import face_rows, number_rows, vertex_rows
from meshreel.model.geometry.fans import join_fans
from meshreel.model.geometry.hard_edges import RowNormals, hard_flags, joined_labels, shared_edges
from meshreel.model.sequence import Faces, Vertices
from meshreel.model.surface import PLAIN, Attribute, Domain, FaceGroups, Kind, Surface
from meshreel.model.tracks import TrackKind, TrackSource

SMOOTHING = "s"
"""The statement of smoothing groups."""

READ_AS = {TrackKind.COLOR: "color", TrackKind.UV: "uv", TrackKind.NORMAL: NORMALS_NAME}
"""What tracks of a kind are called when they are read again."""

NO_PLACE = "tracks but colours of vertices, normals and texture coordinates"

TOO_MANY = "more than one colour, normal or texture coordinate at a place"


@dataclass(frozen=True)
class ObjTrack:
    """A track as an OBJ file has it: float32, colours of 0..1.

    Attributes
    ----------
    name : str
        Of the track.
    """

    name: str
    domain: Domain

    def shown(self, values: Values) -> Values:
        """Values of a frame, of shape (N, C), as they are written."""
        scaled = values / 255 if values.dtype == np.uint8 else values
        return scaled.astype(np.float32)


def obj_encoder(
    faces: Faces,
    surface: Surface = PLAIN,
    notes: list[str] | None = None,
    tracks: Mapping[str, TrackSource] | None = None,
) -> Callable[..., bytes]:
    """A function from the positions and track values of a frame to the bytes of its OBJ file.

    Float32 and float64 positions read back exactly. What does not change is written out once.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)
    notes : list of str, optional
        Gains a sentence on what an OBJ file does not hold.
    tracks : mapping of str to TrackSource, optional
        The function takes their values, of shape (N, C), by their names, beside positions of
        shape (V, 3).
    """
    told = notes if notes is not None else []
    uv, colors, groups = _texture_coordinates(surface), _colors(surface), _groups(surface)
    note_unwritten(surface, (uv, colors, *groups), ".obj", notes, parts=True, hard_edges=True)
    moving = held_tracks(tracks or {}, uv, colors, told)
    rows, shading = _Rows.of(surface, faces, uv, moving), None
    if surface.hard_edges is not None and TrackKind.NORMAL not in moving:
        smoothing = _smoothing_groups(surface, faces)
        if smoothing is not None:
            groups.append(smoothing)
        else:
            counts = surface.sizes(len(faces))
            n_verts = int(max(faces.max(), surface.hard_edges.max())) + 1
            corners = join_fans(counts, faces)
            shading = RowNormals(counts, corners, surface.hard_edges, n_verts)
            rows = replace(rows, normal=shading.rows.of_corner + 1)
    texture = "" if uv is None else _lines("vt", uv.values)
    objects = list(_objects(surface, _face_lines(faces, surface, rows), groups))
    still = None if colors is None else _color_rows(colors.per_item())

    def encode(vertices: Vertices, values: Mapping[str, Values] | None = None) -> bytes:
        given = values or {}
        own = {kind: one.shown(given[one.name]) for kind, one in moving.items()}
        suffixes = _color_rows(own[TrackKind.COLOR]) if TrackKind.COLOR in own else still
        changing = [(TrackKind.UV, "vt"), (TrackKind.NORMAL, "vn")]
        head = texture + "".join(_lines(word, own[kind]) for kind, word in changing if kind in own)
        if shading is not None:
            head += _lines("vn", shading.of_frames(vertices[np.newaxis])[0].astype(np.float32))
        pieces = []
        for one in objects:
            ends = None if suffixes is None else suffixes[one.verts]
            positions = vertex_rows(vertices[one.verts], prefix="v ", suffixes=ends)
            pieces += [one.head, positions, head.encode(), one.faces]
            head = ""
        return b"".join(pieces)

    return encode


def _lines(word: str, values: Values) -> str:
    return "".join(f"{word} {row}\n" for row in number_rows(values))


@dataclass(frozen=True)
class _Object:
    """A stretch of the file: its first line if it has one, its vertices, and what follows them."""

    head: bytes
    verts: slice
    faces: bytes


def _objects(
    surface: Surface, face_lines: list[str], groups: list[FaceGroups]
) -> Iterator[_Object]:
    if not surface.parts:
        yield _Object(b"", slice(None), _face_text(slice(0, None), face_lines, groups))
    vertex = face = 0
    for part in surface.parts:
        verts, faces = slice(vertex, vertex + part.n_verts), slice(face, face + part.n_faces)
        text = _face_text(faces, face_lines, groups)
        yield _Object(_statement("object", part.name).encode(), verts, text)
        vertex, face = verts.stop, faces.stop


def _face_text(faces: slice, face_lines: list[str], groups: list[FaceGroups]) -> bytes:
    """The lines of those faces, with a statement where a face is in another group."""
    lines = face_lines[faces]
    for one in groups:
        before = -2 if faces.start else -1  # what was stated above may go on: it is stated anew
        changed = np.flatnonzero(np.diff(one.numbers[faces], prepend=before))
        for face, number in zip(changed, one.numbers[faces][changed], strict=True):
            label = one.labels[number] if number >= 0 else ""
            lines[face] = _statement(one.name, label) + lines[face]
    return "".join(lines).encode()


def _statement(name: str, label: str) -> str:
    """The line that says what follows belongs to; of no label, that it belongs to nothing."""
    words = re.sub(r"[#\\]", "_", label).split()
    word = SMOOTHING if name == SMOOTHING else STATEMENTS[name].decode()
    return " ".join([word, *words]) + "\n"


def _smoothing_groups(surface: Surface, faces: Faces) -> FaceGroups | None:
    """Faces that are joined across soft edges, each such set by its number; alone, they are "off".

    None if a hard edge lies between two faces of one set, which are joined elsewhere.
    """
    counts = surface.sizes(len(faces))
    edges = shared_edges(counts, join_fans(counts, faces))
    is_hard = hard_flags(surface.hard_edges, edges)
    sides = np.flatnonzero(edges.of_side >= 0)
    of_face, edge = np.repeat(np.arange(len(counts)), counts)[sides], edges.of_side[sides]
    _, first = np.unique(edge, return_index=True)
    other = of_face[first][edge]
    is_soft = ~is_hard[edge]
    number = joined_labels(len(counts), of_face[is_soft], other[is_soft])
    if (number[of_face] == number[other])[~is_soft & (of_face != other)].any():
        return None
    sets, row, sizes = np.unique(number, return_inverse=True, return_counts=True)
    numbers = np.where(sizes == 1, 0, np.cumsum(sizes > 1))[row]
    labels = ("off", *map(str, range(1, len(sets) + 1)))
    return FaceGroups(SMOOTHING, labels, numbers.astype(np.int32))


@dataclass(frozen=True)
class _Rows:
    """What corners name of texture coordinates and normals: the number of a line, from 1 on."""

    texture: Values | None
    normal: Values | None

    @classmethod
    def of(
        cls,
        surface: Surface,
        faces: Faces,
        uv: Attribute | None,
        moving: Mapping[TrackKind, ObjTrack],
    ) -> "_Rows":
        """Those of a surface and tracks."""
        corners = join_fans(surface.sizes(len(faces)), faces)
        every = np.arange(len(corners))

        def rows_of(domain: Domain) -> Values:
            return (corners if domain is Domain.VERTEX else every) + 1

        texture = None
        if uv is not None:
            rows = np.arange(len(uv.values)) if uv.indices is None else uv.indices
            texture = (rows[corners] if uv.domain is Domain.VERTEX else rows) + 1
        if TrackKind.UV in moving:
            texture = rows_of(moving[TrackKind.UV].domain)
        normals = moving.get(TrackKind.NORMAL)
        return cls(texture, None if normals is None else rows_of(normals.domain))


def _face_lines(faces: Faces, surface: Surface, rows: _Rows) -> list[str]:
    counts = surface.sizes(len(faces))
    corners = join_fans(counts, faces)
    words: Iterable[str] = map(str, (corners + 1).tolist())
    if rows.texture is not None:
        words = map("{}/{}".format, words, rows.texture.tolist())
    if rows.normal is not None:
        words = map(f"{{}}{'/' if rows.texture is not None else '//'}{{}}".format, words,
                    rows.normal.tolist())  # fmt: skip
    return [f"f {row}\n" for row in face_rows(counts, words)]


def _texture_coordinates(surface: Surface) -> Attribute | None:
    """The first that an OBJ file can hold."""
    for one in surface.of_kind(Kind.UV):
        is_pair = one.values.dtype.kind == "f" and one.values.shape[1] == 2
        if is_pair and one.domain is not Domain.FACE:
            return one
    return None


def _colors(surface: Surface) -> Attribute | None:
    """The first that an OBJ file can hold, but for its fourth number."""
    for one in surface.of_kind(Kind.COLOR):
        if one.domain is Domain.VERTEX and one.values.shape[1] in (3, 4):
            return one
    return None


def _color_rows(colors: Values) -> list[str]:
    values = colors[:, :3]
    if values.dtype.kind != "f":
        values = (values / 255).astype(np.float32)
    return number_rows(values)


def _groups(surface: Surface) -> list[FaceGroups]:
    """Those that an OBJ file has a statement for; parts take that of objects."""
    found = {one.name: one for one in reversed(surface.groups)}
    names = [name for name in STATEMENTS if name != "object" or not surface.parts]
    return [found[name] for name in names if name in found]


def held_tracks(
    tracks: Mapping[str, TrackSource],
    uv: Attribute | None,
    colors: Attribute | None,
    notes: list[str],
) -> dict[TrackKind, ObjTrack]:
    """The tracks that an OBJ file holds, one of a kind.

    Parameters
    ----------
    tracks : mapping of str to TrackSource
    uv, colors : Attribute or None
        What it holds already.
    notes : list of str
        Gains sentences on tracks that are left out, or have another name or type, or a unit.
    """
    held = {TrackKind.UV: uv, TrackKind.COLOR: colors}
    taken = {kind for kind, one in held.items() if one is not None}
    found: dict[TrackKind, ObjTrack] = {}
    missing: dict[str, list[str]] = {}
    for name, track in tracks.items():
        if not _has_place(track):
            missing.setdefault(NO_PLACE, []).append(name)
        elif track.kind in taken:
            missing.setdefault(TOO_MANY, []).append(name)
        else:
            taken.add(track.kind)
            found[track.kind] = ObjTrack(name, track.domain)
            note_track_name(name, READ_AS[track.kind], ".obj", notes)
            note_track_type(name, track.dtype, np.dtype(np.float32), notes)
            if track.kind is TrackKind.COLOR and track.shape[2] > len("rgb"):
                notes.append(f"the fourth number of track {name!r} left out: .obj has three")
    for reason, names in missing.items():
        note_unwritten_tracks(names, ".obj", notes, reason)
    units = {one.name: tracks[one.name].unit for one in found.values()}
    note_unwritten_units(units, ".obj", notes)
    return found


def _has_place(track: TrackSource) -> bool:
    can_be_color = track.dtype.kind == "f" or track.dtype == np.uint8
    if track.kind is TrackKind.COLOR:
        return track.domain is Domain.VERTEX and can_be_color
    return track.kind in (TrackKind.UV, TrackKind.NORMAL) and track.domain is not Domain.FACE
