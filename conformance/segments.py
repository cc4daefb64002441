"""Streams of several segments, and streams that break one rule of segments.

`python -m conformance.make` writes them to the folder conformance/segments.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from io import BytesIO
from pathlib import Path
from unittest.mock import patch

import numpy as np

import meshreel
from conformance.sources import grid, moving, of_boxes, of_everything
from meshreel.codec import mesh_edits
from meshreel.codec.bitstream import container as stream_container
from meshreel.codec.bitstream.container import (
    StreamWriter,
    write_header,
    write_index,
    write_sections,
    write_stream,
    write_varint,
)
from meshreel.codec.bitstream.layout import INDEX_POSITION, Section
from meshreel.codec.joining import blocks_of, header_of, join_streams, leading_of, separate_stream
from meshreel.codec.open_stream import OpenStream, whole_stream
from meshreel.codec.times import write_times
from meshreel.kernel.integers import encode_integers
from meshreel.model.materials import Material
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Surface
from meshreel.model.timing import Timing
from meshreel.model.tracks import Track

FOLDER = Path(__file__).with_name("segments")
REFUSED_FOLDER = FOLDER / "refused"

TETRAHEDRON = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
SIDES = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
BOX = [part for a, b, c, d in SIDES for part in ((a, b, c), (a, c, d))]


def with_heat(sequence):
    """Return the sequence with an animated scalar track."""
    heat = np.linspace(0, 1, sequence.n_frames * sequence.n_verts, dtype=np.float32)
    values = heat.reshape(sequence.n_frames, sequence.n_verts)
    return sequence.replace(tracks={"heat": Track(values, unit="K")})


@cache
def meshes():
    """Return streams of a tetrahedron and a box that differ in number type, bounds and tracks."""
    timed = {"fps": 24.0, "start_s": 1.5}
    tetrahedron = moving(TETRAHEDRON, 5, name="two meshes", **timed)
    box = with_heat(moving(BOX, 4, dtype=np.float64, shape=(2.0, 7.0), **timed))
    return (
        meshreel.encode(tetrahedron, max_error=0.1, block_frames=2),
        meshreel.encode(box, tracks={"heat": 0.01}, order="drop", step=1e-4),
    )


def one_frame_each():
    """Return streams of one frame each, some with equal meshes."""
    faces = (TETRAHEDRON, BOX, BOX, TETRAHEDRON, BOX[:6])
    return [meshreel.encode(moving(mesh, 1, seed=i)) for i, mesh in enumerate(faces)]


def of_many_kinds():
    """Return streams with a full surface, exact positions, hard edges, and a paper's method."""
    return (
        meshreel.encode(of_everything(n_frames=2), order="vertices"),
        meshreel.encode(moving(BOX, 3), lossless=True),
        meshreel.encode(of_boxes()),
        meshreel.encode(moving(BOX, 4), method="pca-qp"),
    )


def returning():
    """Return streams of two meshes that return: with other attributes, methods and tracks."""
    full = of_everything(n_frames=1)
    fewer = full.replace(surface=replace(full.surface, attributes=full.surface.attributes[:1]))
    return (
        meshreel.encode(moving(BOX, 3, start_s=1.5)),
        meshreel.encode(fewer),
        meshreel.encode(full, lossless=True),
        meshreel.encode(with_heat(moving(BOX, 2, seed=6, dtype=np.float64)), max_error=0.1),
        meshreel.encode(moving(BOX, 2, seed=6), order="drop"),
        meshreel.encode(fewer, step=0.001),
    )


def of_one_look():
    """Return streams of different meshes with the same materials and images, which return."""
    surface = of_everything(n_frames=1).surface
    materials = tuple(
        Material(material.name, base_color=material.base_color, roughness=material.roughness)
        for material in surface.materials
    )
    look = Surface(materials=materials, images=surface.images)
    meshes = (TETRAHEDRON, BOX, BOX[:6], BOX, TETRAHEDRON)
    return [
        meshreel.encode(moving(mesh, 2, seed=i).replace(surface=look))
        for i, mesh in enumerate(meshes)
    ]


def edits():
    """Return a sheet with a box and a patch, and edits of it: holes, other parts, new faces."""
    sheet, patch, box = grid(9, 12), grid(4, 5), np.asarray(BOX)
    body, n = np.concatenate([sheet, box + 108, patch + 116]), 136
    without_box = np.concatenate([sheet, patch + 108])
    with_another = np.concatenate([sheet, box + 108, np.asarray(TETRAHEDRON) + 116, patch + 120])
    tangled = np.concatenate([[[0, 9, 77]], body[:60], body[60:61], body[60:]])
    return [
        (body, n),
        (np.delete(body, [*range(30, 44), *range(100, 103), 187, 199], axis=0), n),
        (without_box, n - 8),
        (with_another, n + 4),
        (body, n),
        (tangled, n),
        (body[:170], n),
    ]


def edited(n_frames, **options):
    """Return a stream of `edits`."""
    segments = []
    for seed, (faces, n_verts) in enumerate(edits()):
        sequence = moving(faces, n_frames, seed=seed, n_more=n_verts - int(faces.max()) - 1)
        segments.append(sequence)
    with patch.object(mesh_edits, "SMALL_BYTES_PER_FACE", 1):
        return meshreel.encode(MeshSequence.of_segments(segments), order="keep", **options)


def separated(data, segment):
    """Return a stream of one segment alone."""
    return separate_stream(OpenStream(data, segment=segment))


def with_edit(*counts, method="reel", times=1, mesh=BOX, **rows):
    """Return a stream of a box as an edit of a mesh, with six counts and `rows` of integers."""
    numbers = "verts_kept", "verts_dropped", "verts_new", "kept", "dropped", "new", "corners"
    columns = [np.asarray(rows.get(name, ()), np.int64) for name in numbers]
    payload = b"".join(map(write_varint, counts)) + encode_integers(columns)
    base, opened = (
        whole_stream(meshreel.encode(moving(faces, 2), method=method, order="keep"))
        for faces in (mesh, BOX)
    )
    leading = [*list(leading_of(base))[:2], *times * [(Section.EDIT, payload)]]
    others = [
        one for one in leading_of(opened) if one[0] not in (Section.CONNECTIVITY, Section.ORDER)
    ]
    return written([(header_of(opened), leading + others, blocks_of(opened))])


def placed_alike():
    """Return streams with equal origin and scale."""
    return [placed_like(stream, one_frame_each()[0]) for stream in one_frame_each()]


def placed_like(stream, first):
    """Return the stream with origin and scale of another, which changes its positions."""
    opened, target = whole_stream(stream), header_of(whole_stream(first))
    header = replace(header_of(opened), origin=target.origin, scale=target.scale)
    return written([(header, leading_of(opened), blocks_of(opened))])


def written(segments, n_frames=None):
    """Return a stream of segments, each a header, sections and blocks."""
    (header, leading, blocks), *further = segments
    header = header if n_frames is None else replace(header, n_frames=n_frames)
    return write_stream((header, leading, blocks), *further)


def parts():
    """Return header, sections and blocks of both `meshes`."""
    return [
        (header_of(opened), list(leading_of(opened)), list(blocks_of(opened)))
        for opened in map(whole_stream, meshes())
    ]


def without_index(segments):
    """Return a stream of segments, each a list of sections, without an index."""
    header, *_ = parts()[0]
    sections = [*(one for segment in segments for one in segment), (Section.END, b"")]
    return write_header(replace(header, n_frames=0)) + b"".join(write_sections(sections))


def sections_of(number):
    """All sections of a segment of `meshes`; the first of the second is SEGMENT."""
    header, leading, blocks = parts()[number]
    own = [one for one in leading if one[0] is not Section.START or not number]
    first = stream_container.write_segment(header, parts()[0][0])
    return [
        *([(Section.SEGMENT, first)] if number else []),
        *own,
        *(one for _, block in blocks for one in block),
    ]


TIMES = [0.0, 0.005, 0.01, 0.015, 0.0175, 1.0, 1.1, 1.2, 1.25]


def timed_behind():
    """Join `meshes` with times behind the blocks."""
    file = BytesIO()
    writer = StreamWriter(file)
    for header, leading, blocks in parts():
        kept = [section for section in leading if section[0] is not Section.START]
        writer.begin_segment(replace(header, n_frames=0), kept)
        for block in blocks:
            writer.write_block(*block)
    writer.finish([(Section.TIMES, write_times(np.array(TIMES)))])
    return file.getvalue()


STREAMS: dict[str, Callable[[], bytes]] = {
    "two_meshes": lambda: join_streams(meshes()),
    "one_frame_each": lambda: join_streams(one_frame_each()),
    "placed_alike": lambda: join_streams(placed_alike()),
    "returning": lambda: join_streams(returning()),
    "returning_no_index": lambda: without_end(join_streams(returning())),
    "one_look": lambda: join_streams(of_one_look()),
    "edited": lambda: edited(3),
    "edited_grid": lambda: edited(1),
    "edited_exact": lambda: edited(2, lossless=True),
    "many_kinds": lambda: join_streams(of_many_kinds()),
    "two_meshes_timed": lambda: join_streams(meshes(), timing=Timing.of_times(TIMES)),
    "two_meshes_timed_no_index": lambda: without_end(timed_behind()),
    "two_meshes_timed_behind": timed_behind,
    "two_meshes_no_index": lambda: without_index([sections_of(0), sections_of(1)]),
}


def without_end(data):
    """Return a stream whose INDEX is replaced by an END that refers to none."""
    (index_at,) = INDEX_POSITION.unpack(data[-12:-4])
    return data[:index_at] + b"".join(write_sections([(Section.END, b"")]))


def with_section(change):
    """Join `meshes` with a changed payload of SEGMENT."""
    write = stream_container.write_segment
    with patch.object(stream_container, "write_segment", lambda *headers: change(write(*headers))):
        return join_streams(meshes())


def with_header(**changes):
    """Join `meshes` with changed fields in SEGMENT."""
    write = stream_container.write_segment
    with patch.object(
        stream_container,
        "write_segment",
        lambda header, first: write(replace(header, **changes), first),
    ):
        return join_streams(meshes())


def with_index(change):
    """Join `meshes` with a changed index."""
    with patch.object(
        stream_container,
        "write_index",
        lambda places, further: write_index(places, change(further)),
    ):
        return join_streams(meshes())


def with_start():
    """Join `meshes`, both with START."""
    return written(parts(), n_frames=9)


def with_times_in_the_second():
    """Join `meshes`, the second with times."""
    first, (header, leading, blocks) = parts()
    times = Section.TIMES, write_times(np.array(TIMES[:4]))
    return written([first, (header, [times, *leading], blocks)], n_frames=9)


def in_all(n_frames):
    """Join `meshes` with another number of frames in the header."""
    first, (header, leading, blocks) = parts()
    kept = [section for section in leading if section[0] is not Section.START]
    return written([first, (header, kept, blocks)], n_frames)


def with_leading(*changes, mesh=BOX):
    """Return boxes, the last ones with other leading sections; the first one is of a mesh."""
    streams = meshreel.encode(moving(mesh, 2)), *(encoded_box(seed) for seed in (6, 7))
    segments = [
        (header_of(opened), list(leading_of(opened)), list(blocks_of(opened)))
        for opened in map(whole_stream, streams)
    ]
    n_kept = len(segments) - len(changes)
    changed = [
        (header, change(leading), blocks)
        for (header, leading, blocks), change in zip(segments[n_kept:], changes, strict=True)
    ]
    return written([*segments[:n_kept], *changed], n_frames=6)


def encoded_box(seed):
    return meshreel.encode(moving(BOX, 2, seed=seed))


OF_A_BOX = bytes([2, 0, 1, 1, 0, 0, 8, 0, 255, 4])
"""An attribute of equal integers at 8 vertices, predicted from their positions."""


def refer(*numbers):
    """Return a function that replaces leading sections by a REFERENCE."""
    payload = b"".join(map(write_varint, numbers))
    return lambda leading: [(Section.REFERENCE, payload)]


def with_blocks(further, change):
    """Return segments for an index, with changed blocks."""
    return [replace(s, entries=[change(block) for block in s.entries]) for s in further]


REFUSED: dict[str, Callable[[], bytes]] = {
    "times_in_the_second": with_times_in_the_second,
    "cut_off": partial(with_section, lambda payload: payload[:3]),
    "too_long": partial(with_section, lambda payload: payload + b"\0"),
    "no_faces": partial(with_header, n_faces=0),
    "no_vertices": partial(with_header, n_verts=0),
    "scale_zero": partial(with_header, scale=0.0),
    "origin_infinite": partial(with_header, origin=(0.0, np.inf, 0.0)),
    "start_of_the_second": with_start,
    "frames_of_the_first_alone": lambda: in_all(5),
    "index_of_other_vertices": partial(
        with_index, lambda further: [replace(s, n_verts=9) for s in further]
    ),
    "index_of_other_faces": partial(
        with_index, lambda further: [replace(s, n_faces=1) for s in further]
    ),
    "index_of_other_tracks": partial(
        with_index,
        lambda further: with_blocks(
            further, lambda block: replace(block, sizes=(sum(block.sizes),))
        ),
    ),
    "index_of_more_tracks": partial(
        with_index,
        lambda further: with_blocks(
            further, lambda block: replace(block, sizes=(*block.sizes[:-1], block.sizes[-1] - 1, 1))
        ),
    ),
    "index_of_more_frames": partial(
        with_index, lambda further: with_blocks(further, lambda block: replace(block, n_frames=5))
    ),
    "index_of_another_place": partial(
        with_index, lambda further: [replace(s, position=s.position - 1) for s in further]
    ),
    "index_without_the_second": partial(with_index, lambda further: []),
    "index_with_a_third": partial(with_index, lambda further: [*further, *further]),
    "reference_to_itself": lambda: with_leading(refer(0, 0, 2)),
    "reference_before_the_first": lambda: with_leading(refer(3, 0, 2)),
    "reference_without_index": lambda: without_end(with_leading(refer(3, 0, 2))),
    "reference_to_no_section": lambda: with_leading(refer(2, 0, 0)),
    "reference_to_three_sections": lambda: with_leading(refer(2, 0, 3)),
    "reference_to_256_sections": lambda: with_leading(
        lambda leading: [*leading, *300 * [(Section.IMAGE, b"\0\0")]], refer(1, 0, 256)
    ),
    "reference_to_an_attribute_from_points": lambda: with_leading(
        lambda leading: [*leading, (Section.ATTRIBUTE_FROM_POINTS, OF_A_BOX)], refer(1, 0, 1)
    ),
    "reference_of_one_number": lambda: with_leading(refer(2)),
    "reference_of_two_numbers": lambda: with_leading(refer(2, 2)),
    "reference_of_four_numbers": lambda: with_leading(refer(2, 0, 2, 2)),
    "reference_of_three_ranges": lambda: with_leading(refer(2, 0, 1, 2, 1, 1, 2, 1, 1)),
    "reference_behind_all_sections": lambda: with_leading(refer(2, 2, 1)),
    "reference_to_a_reference": lambda: with_leading(refer(1, 0, 2), refer(1, 0, 2)),
    "reference_to_another_mesh": lambda: with_leading(refer(2, 0, 2), mesh=TETRAHEDRON),
    "reference_of_the_first": lambda: with_leading(refer(1, 0, 2), refer(1, 0, 2), refer(2, 0, 2)),
    "reference_behind_another": lambda: with_leading(lambda _: 2 * refer(2, 0, 1)([])),
    "reference_and_connectivity": lambda: with_leading(lambda all: [*refer(2, 0, 2)([]), *all[:1]]),
    "edit_without_steps": lambda: with_edit(8, 12),
    "edit_of_no_vertices": lambda: with_edit(0, 12, 0, 0, 0),
    "edit_of_no_faces": lambda: with_edit(8, 0, 0, 0, 0),
    "edit_of_fewer_vertices": lambda: with_edit(8, 12, 0, 0, 0, mesh=BOX[:4]),
    "edit_of_more_steps": lambda: with_edit(8, 12, 99, 0, 0, verts_kept=99 * [0]),
    "edit_keeps_too_much": lambda: with_edit(
        8, 12, 1, 0, 0, verts_kept=[9], verts_dropped=[0], verts_new=[0]
    ),
    "edit_drops_too_much": lambda: with_edit(
        8, 12, 1, 0, 0, verts_kept=[8], verts_dropped=[1], verts_new=[0]
    ),
    "edit_inserts_too_much": lambda: with_edit(
        8, 12, 1, 0, 0, verts_kept=[8], verts_dropped=[0], verts_new=[1]
    ),
    "edit_of_negative_numbers": lambda: with_edit(
        8, 12, 2, 0, 0, verts_kept=[8, -1], verts_dropped=[0, 0], verts_new=[0, 0]
    ),
    "edit_of_fewer_faces": lambda: with_edit(8, 12, 0, 1, 0, kept=[3], dropped=[1], new=[0]),
    "edit_without_a_used_vertex": lambda: with_edit(
        8, 12, 1, 0, 0, verts_kept=[3], verts_dropped=[1], verts_new=[1]
    ),
    "edit_without_corners": lambda: with_edit(8, 12, 0, 1, 0, kept=[3], dropped=[1], new=[1]),
    "edit_of_more_corners": lambda: with_edit(8, 12, 0, 0, 1, corners=[0, 1, 1]),
    "edit_of_a_missing_vertex": lambda: with_edit(
        8, 12, 0, 1, 1, kept=[3], dropped=[1], new=[1], corners=[0, 1, 7]
    ),
    "edit_of_a_negative_vertex": lambda: with_edit(
        8, 12, 0, 1, 1, kept=[3], dropped=[1], new=[1], corners=[0, -1, 7]
    ),
    "edit_twice": lambda: with_edit(8, 12, 0, 0, 0, times=2),
    "edit_of_the_paper": lambda: with_edit(8, 12, 0, 0, 0, method="pca-qp"),
    "no_block": lambda: without_index([sections_of(0), sections_of(1)[:1], sections_of(1)]),
    "no_block_of_the_first": lambda: without_index([sections_of(0)[:1], sections_of(1)]),
    "no_block_of_the_last": lambda: without_index([sections_of(0), sections_of(1)[:2]]),
    "no_tracks": lambda: without_index([sections_of(0), without_tracks(sections_of(1))]),
}


def without_tracks(sections):
    """Return the sections without TRACK."""
    return [section for section in sections if section[0] is not Section.TRACK]
