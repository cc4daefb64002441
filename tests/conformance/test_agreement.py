"""The core and the plain reader agree on streams in which one thing is wrong, and on their values.

Each variant of a small stream has valid checksums, and lacks, repeats or swaps a section, or has
another byte in one. So it breaks at most one rule, and only the check of that rule refuses it.
"""

import struct
import zlib
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import meshreel
from conformance.by_hand import with_relations
from conformance.container import Payload, read_header
from conformance.reader import read_all
from conformance.segments import BOX, TETRAHEDRON, with_edit
from conformance.sources import attribute, boxes, moving, of_type, waving
from meshreel.codec.bitstream.container import write_varint
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.joining import join_streams
from meshreel.kernel.normals import surface_normals
from meshreel.model.materials import Material, Texture
from meshreel.model.surface import FaceGroups, Part, Surface
from meshreel.model.timing import Timing
from samples.c_reader import File, in_memory, refusal
from samples.costs import draws
from samples.materials import png
from samples.streams import not_compact

N_BYTES = 32
"""Number of bytes of a section that are changed, from its begin."""

N_CODED = {Section.BASIS: 0, Section.COEFFICIENTS: 0, Section.CORRECTIONS: 0, Section.VALUES: 6}
"""The same for sections in which almost all bytes are valid."""

OTHER_DOUBLES = struct.pack("<d", -1.0), struct.pack("<d", np.inf)


def segments():
    """Return three meshes, of which the last refers to the second, with a track and times."""
    first, box, again = (moving(*each) for each in ((TETRAHEDRON, 2), (BOX, 1), (BOX, 1)))
    heat = meshreel.Track(np.ones((2, 4), np.uint8), unit="K")
    streams = [
        meshreel.encode(part, lossless=True)
        for part in (first.replace(tracks={"heat": heat}), box, again)
    ]
    return join_streams(streams, timing=Timing.of_times([0, 1, 3, 4]))


def volume():
    """Return two hexahedra with tracks: of cells, and as wide as allowed."""
    points, hexahedra = boxes(2, 1, 1)
    of_cells = meshreel.Track(np.ones((1, 2), np.uint8), "cell")
    tracks = {"a": of_cells, "b": meshreel.Track(np.zeros((1, 12, 256), np.uint8))}
    cells = of_type(12, hexahedra)
    return meshreel.MeshSequence(waving(points, 1), cells=cells, tracks=tracks)


def tracks():
    """Return a tetrahedron with velocities, normals and other values, predicted or not."""
    mesh = moving(TETRAHEDRON, 2, fps=25.0, start_s=0.1)
    velocities = np.gradient(mesh.vertices, axis=0) * 25
    normals = surface_normals(mesh.vertices, mesh.faces)
    values = {
        "v": meshreel.Track(velocities, kind="velocity"),
        "n": meshreel.Track(normals, kind="normal"),
        "x": meshreel.Track(mesh.vertices[..., 0], unit="m"),
    }
    return mesh.replace(tracks=values)


def surface():
    """Return a quad and a triangle with everything that a surface has."""
    values = np.float32([[0, 0], [1, 0], [1, 1]])
    attributes = (
        attribute("uv", "uv", "corner", values, np.int32([0, 1, 2, 0, 1, 2, 0])),
        attribute("paint", "color", "vertex", np.arange(15, dtype=np.uint8).reshape(5, 3)),
    )
    groups = (FaceGroups("material", ("skin",), np.int32([0, -1])),)
    material = Material("skin", base_color_texture=Texture(0, "uv"), double_sided=True)
    look = Surface(np.int32([4, 3]), attributes, groups, (Part("/a", 5, 2),), (material,), (png(),))
    faces = [[0, 1, 2], [0, 2, 3], [0, 3, 4]]
    return moving(faces, 1, surface=replace(look, hard_edges=np.array([[0, 3]])))


STREAMS = {
    "segments": segments,
    "volume": lambda: meshreel.encode(volume(), lossless=True),
    "tracks": lambda: meshreel.encode(tracks(), bound=1),
    "related": lambda: with_relations(1),
    "grid": lambda: meshreel.encode(moving(TETRAHEDRON, 1), "grid", max_error=1),
    "surface": lambda: meshreel.encode(surface(), lossless=True),
    "edit": lambda: with_edit(8, 12, 0, 1, 1, kept=[3], dropped=[1], new=[1], corners=[0, 1, 1]),
}


@cache
def parts_of(name):
    """Return the header of a stream, and identifier and payload of each section."""
    with not_compact():
        data = STREAMS[name]()
    payload, parts = Payload(data), []
    read_header(payload)
    head = data[: payload.position - 4]
    while payload.position < len(data):
        parts.append((payload.byte(), payload.take(payload.varint())))
        payload.take(4)
    return head, parts


def assembled(head, parts):
    """Return a stream with valid checksums."""
    pieces = [head, *(bytes([one]) + write_varint(len(data)) + data for one, data in parts)]
    return b"".join(piece + zlib.crc32(piece).to_bytes(4, "little") for piece in pieces)


def changed(payload, n_bytes=N_BYTES):
    """Yield bytes that differ in one, have one for eight, or are longer, shorter or missing."""
    for at in {*range(min(draws(n_bytes), len(payload))), len(payload) - 1} - {-1}:
        own = payload[at]
        for byte in {255, (own + 1) % 256, (own - 1) % 256, own ^ 16} - {own}:
            yield payload[:at] + bytes([byte]) + payload[at + 1 :]
        yield payload[:at] + b"\1" + payload[at + 9 :]  # a varint for a double
        yield from (payload[:at] + other + payload[at + 8 :] for other in OTHER_DOUBLES)
    yield from (payload + b"\0", payload[:-1], b"")


@cache
def sections_of_all():
    """Return a section of each kind, other than the last two of a stream."""
    sections = dict(part for name in STREAMS for part in parts_of(name)[1])
    return [one for one in sections.items() if one[0] not in (Section.INDEX, Section.END)]


def changes(parts):
    """Yield what is changed, and the sections."""
    for other in sections_of_all():
        yield f"with section {other[0]}", [*parts[:1], other, *parts[1:]]
    for at, (number, payload) in enumerate(parts):
        before, own, after = parts[:at], parts[at : at + 1], parts[at + 1 :]
        yield f"without section {at}", before + after
        yield f"section {at} twice", before + own + own + after
        yield f"section {at} later", before + after[:1] + own + after[1:]
        for other in changed(payload, N_CODED.get(number, N_BYTES)):
            yield f"section {at}: {payload!r} became {other!r}", [*before, (number, other), *after]


def by_plain_reader(data):
    """Return faces and values of all segments; None if any error refuses the stream."""
    try:
        return [
            [np.uint32(reel.faces).tobytes(), *(np.array(v).tobytes() for v in values_of(reel))]
            for reel in read_all(data)
        ]
    except Exception:  # the plain reader does not name all damage
        return None


def values_of(reel):
    return [reel.positions, *(values for _, _, values in reel.tracks)]


def by_core(data):
    """Return the same from the C library."""
    result = []

    def read():
        with File(in_memory(data), mesh=False) as whole:
            for number in range(whole.info.n_segments if whole.info.is_whole else 0):
                with whole.open_segment(number) as file:
                    file.read_surface()
                    values = (file.values(track) for track in range(file.info.n_tracks))
                    result.append([one.tobytes() for one in (file.triangles, *values)])

    return None if refusal(read) else result or None


@pytest.mark.every_case
@pytest.mark.parametrize("is_indexed", [False, True])
@pytest.mark.parametrize("name", STREAMS)
def test_readers_agree_on_every_variant(name, is_indexed):
    head, parts = parts_of(name)
    # An index contradicts changes of the sections before it.
    fixed, parts = (
        (parts[:-2], parts[-2:]) if is_indexed else ([], [*parts[:-2], (Section.END, b"")])
    )
    variants = {"the stream": assembled(head, fixed + parts)}
    variants |= {f"header {other!r}": assembled(other, fixed + parts) for other in changed(head)}
    variants |= {text: assembled(head, fixed + others) for text, others in changes(parts)}
    expected = {text: by_plain_reader(data) for text, data in variants.items()}
    for text, data in variants.items():
        assert by_core(data) == expected[text], text
    assert expected["the stream"] is not None
    assert [*expected.values()].count(None) > 20
