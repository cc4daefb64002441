"""A frame to the bytes of a Wavefront OBJ file.

Written: positions, with colours of vertices if there are any; texture coordinates; polygons; the
groups that `meshreel.formats.meshes.obj_surface` reads; and parts as objects. Colours are floats of
three numbers.
"""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from meshreel.formats.meshes.obj_surface import STATEMENTS
from meshreel.formats.notes import note_unwritten
from meshreel.formats.text.decimal_text import face_rows, number_rows, vertex_rows
from meshreel.geometry.fans import join_fans
from meshreel.sequence import Faces, Vertices
from meshreel.surface import PLAIN, Attribute, Domain, FaceGroups, Kind, Surface


def obj_encoder(
    faces: Faces, surface: Surface = PLAIN, notes: list[str] | None = None
) -> Callable[[Vertices], bytes]:
    """A function from the positions of a frame, of shape (V, 3), to the bytes of its OBJ file.

    Float32 and float64 positions read back exactly. All but positions is written out once.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)
    surface : Surface, optional
    notes : list of str, optional
        Gains a sentence on what an OBJ file does not hold of the surface.
    """
    uv, colors, groups = _texture_coordinates(surface), _colors(surface), _groups(surface)
    note_unwritten(surface, (uv, colors, *groups), ".obj", notes, parts=True)
    texture = "" if uv is None else "".join(f"vt {row}\n" for row in number_rows(uv.values))
    objects = list(_objects(surface, _face_lines(faces, surface, uv), groups))
    objects[0] = replace(objects[0], faces=texture.encode() + objects[0].faces)
    suffixes = None if colors is None else _color_rows(colors)

    def encode(vertices: Vertices) -> bytes:
        pieces = []
        for one in objects:
            own = None if suffixes is None else suffixes[one.verts]
            positions = vertex_rows(vertices[one.verts], prefix="v ", suffixes=own)
            pieces += [one.head, positions, one.faces]
        return b"".join(pieces)

    return encode


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
    return " ".join([STATEMENTS[name].decode(), *words]) + "\n"


def _face_lines(faces: Faces, surface: Surface, uv: Attribute | None) -> list[str]:
    counts = surface.sizes(len(faces))
    corners = join_fans(counts, faces)
    words = map(str, (corners + 1).tolist())
    if uv is not None:
        rows = np.arange(len(uv.values)) if uv.indices is None else uv.indices
        rows = rows[corners] if uv.domain is Domain.VERTEX else rows
        words = map("{}/{}".format, words, (rows + 1).tolist())
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


def _color_rows(colors: Attribute) -> list[str]:
    values = colors.per_item()[:, :3]
    if values.dtype.kind != "f":
        values = (values / 255).astype(np.float32)
    return number_rows(values)


def _groups(surface: Surface) -> list[FaceGroups]:
    """Those that an OBJ file has a statement for; parts take that of objects."""
    found = {one.name: one for one in reversed(surface.groups)}
    names = [name for name in STATEMENTS if name != "object" or not surface.parts]
    return [found[name] for name in names if name in found]
