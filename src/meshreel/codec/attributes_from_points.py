"""Attributes of encoded streams, predicted from the decoded positions of the first frame."""

from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np

from meshreel.codec.bitstream.container import write_stream
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.joining import blocks_of, header_of, leading_of
from meshreel.codec.memory import UNLIMITED
from meshreel.codec.methods import method_named
from meshreel.codec.open_stream import whole_stream
from meshreel.codec.source import CodedMesh
from meshreel.codec.surface.payloads import write_attribute
from meshreel.model.surface import Domain


def predict_from_positions(streams: Iterable[bytes], meshes: Sequence[CodedMesh]) -> list[bytes]:
    """Return the streams of segments, with attributes from points where that takes fewer bytes.

    Attributes that several segments store alike remain, because these may share them.
    """
    n_stored = Counter(section for mesh in meshes for section in mesh.surface_sections)
    return [_rewritten(*pair, n_stored) for pair in zip(streams, meshes, strict=True)]


def _rewritten(stream: bytes, mesh: CodedMesh, n_stored: Counter[tuple[Section, bytes]]) -> bytes:
    surface, faces, bits = mesh.output_surface, mesh.output_faces, mesh.config.uv_bits
    stored = [section for section in mesh.surface_sections if section[0] is Section.ATTRIBUTE]
    candidates = {
        section: attribute
        for section, attribute in zip(stored, surface.attributes, strict=True)
        if n_stored[section] == 1 and attribute.domain in (Domain.VERTEX, Domain.CORNER)
    }
    if not candidates:
        return stream
    opened = whole_stream(stream, UNLIMITED)
    positions = np.empty((1, opened.n_verts, 3), opened.dtype)
    method_named(opened.method).frames(opened, None).fill(positions, 0)
    leading = list(leading_of(opened))
    for number, section in enumerate(leading):
        if section in candidates:
            payload = write_attribute(candidates[section], surface, faces, bits, positions[0])
            if len(payload) < len(section[1]):
                leading[number] = Section.ATTRIBUTE_FROM_POINTS, payload
    return write_stream((header_of(opened), leading, blocks_of(opened)))
