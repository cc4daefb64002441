"""A frame to the bytes of an OFF file.

Written: positions, polygons, colours of vertices and of faces, and texture coordinates of
vertices; the header word says which.
"""

from collections.abc import Callable

from meshreel.formats.notes import note_unwritten
from meshreel.formats.text.decimal_text import face_rows, number_rows, vertex_rows
from meshreel.model.geometry.fans import join_fans
from meshreel.model.sequence import Faces, Vertices
from meshreel.model.surface import PLAIN, Attribute, Domain, Kind, Surface


def off_encoder(
    faces: Faces, surface: Surface = PLAIN, notes: list[str] | None = None
) -> Callable[[Vertices], bytes]:
    """A function from the positions of a frame, of shape (V, 3), to the bytes of its OFF file.

    Float32 and float64 positions read back exactly. All but positions is written out once.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)
    surface : Surface, optional
    notes : list of str, optional
        Gains a sentence on what an OFF file does not hold of the surface.
    """
    colors, face_colors = _colors(surface, Domain.VERTEX), _colors(surface, Domain.FACE)
    uv = _texture_coordinates(surface)
    note_unwritten(surface, (colors, uv, face_colors), ".off", notes)
    keyword = f"{'ST' if uv else ''}{'C' if colors else ''}OFF"
    suffixes = _joined([number_rows(one.per_item()) for one in (colors, uv) if one])
    face_lines = _face_lines(faces, surface, face_colors)
    face_text = "".join(face_lines).encode("ascii")

    def encode(vertices: Vertices) -> bytes:
        header = f"{keyword}\n{len(vertices)} {len(face_lines)} 0\n".encode("ascii")
        return header + vertex_rows(vertices, suffixes=suffixes) + face_text

    return encode


def _face_lines(faces: Faces, surface: Surface, colors: Attribute | None) -> list[str]:
    counts = surface.sizes(len(faces))
    rows = face_rows(counts, map(str, join_fans(counts, faces).tolist()))
    ends = [f" {row}\n" for row in number_rows(colors.per_item())] if colors else ["\n"] * len(rows)
    pieces = zip(counts.tolist(), rows, ends, strict=True)
    return [f"{count} {row}{end}" for count, row, end in pieces]


def _joined(columns: list[list[str]]) -> list[str] | None:
    return [" ".join(words) for words in zip(*columns, strict=True)] if columns else None


def _colors(surface: Surface, domain: Domain) -> Attribute | None:
    """The first that an OFF file can hold."""
    for one in surface.of_kind(Kind.COLOR):
        is_fit = one.values.dtype.kind in "uf" and one.values.shape[1] in (3, 4)
        if is_fit and one.domain is domain:
            return one
    return None


def _texture_coordinates(surface: Surface) -> Attribute | None:
    """The first that an OFF file can hold."""
    for one in surface.of_kind(Kind.UV):
        is_pair = one.values.dtype.kind == "f" and one.values.shape[1] == 2
        if is_pair and one.domain is Domain.VERTEX:
            return one
    return None
