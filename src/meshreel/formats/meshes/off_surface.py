"""Attributes of an OFF file.

A vertex is x y z, then a normal where the header word has N, a colour where it has C, and two
texture coordinates where it has ST. Behind the corners of a face its colour may stand. Normals
are passed over, and so are colours that are the number of one in a table.
"""

import numpy as np
import numpy.typing as npt

from meshreel.formats.meshes.off import corner_counts, read_off_header
from meshreel.formats.notes import note_left_out, note_normals
from meshreel.formats.text.token_lines import TokenLines, split_lines
from meshreel.model.surface import Attribute, Domain, Kind, Surface

Int64s = npt.NDArray[np.int64]


def parse_off_surface(data: bytes, notes: list[str] | None = None) -> Surface:
    """Attributes of the bytes of an OFF file that `parse_off` reads; notes tell what is left out.

    Colours are bytes if none has a decimal point. They are passed over where not all vertices, or
    not all faces, have three numbers or four.

    Raises
    ------
    FormatError
        Naming the line of what is no number.
    """
    lines = split_lines(data)
    header = read_off_header(lines)
    verts = np.arange(header.begin, header.face_begin)
    faces = np.arange(header.face_begin, lines.n_lines)
    n_texture = 2 if header.keyword.startswith("ST") else 0
    found = []
    if "C" in header.keyword:
        skipped = np.full(len(verts), 6 if "N" in header.keyword else 3)
        found.append(_colors(lines, verts, skipped, n_texture, Domain.VERTEX))
    if n_texture:
        found.append(_texture_coordinates(lines, verts))
    behind = corner_counts(lines, faces) + 1
    found.append(_colors(lines, faces, behind, 0, Domain.FACE))
    if notes is not None:
        if "N" in header.keyword:
            note_normals(notes)
        if found[-1] is None and (lines.counts[faces] > behind).any():
            note_left_out(notes, "colours of faces, which not all have as three numbers or four")
    return Surface(None, tuple(one for one in found if one is not None))


def _colors(
    lines: TokenLines, of: Int64s, skipped: Int64s, n_behind: int, domain: Domain
) -> Attribute | None:
    """The colours on those lines, behind so many words and before so many."""
    lengths = lines.counts[of] - skipped - n_behind
    if lengths[0] not in (3, 4) or (lengths != lengths[0]).any():
        return None
    words = (lines.first[of] + skipped)[:, None] + np.arange(lengths[0])
    values = lines.floats(words)
    is_whole = (values == np.rint(values)) & (values >= 0) & (values <= 255)
    is_bytes = bool(is_whole.all()) and not lines.have_points(words)
    return Attribute("color", Kind.COLOR, domain, values.astype("u1" if is_bytes else "f4"))


def _texture_coordinates(lines: TokenLines, verts: Int64s) -> Attribute | None:
    if (lines.counts[verts] < 5).any():
        return None
    ends = lines.first[verts] + lines.counts[verts]
    values = lines.floats(ends[:, None] + np.arange(-2, 0)).astype(np.float32)
    return Attribute("uv", Kind.UV, Domain.VERTEX, values)
