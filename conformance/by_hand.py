"""Streams that are written section by section or need more than a call of `meshreel.encode`."""

import zlib
from dataclasses import replace
from io import BytesIO
from unittest.mock import patch

import numpy as np

import meshreel
from conformance.container import Payload, read_container, read_header, read_sections
from conformance.reader import read_all
from conformance.sources import (
    attribute,
    book,
    boxes,
    concave_sheet,
    grid,
    holes,
    mixed_cells,
    moving,
    of_everything,
    of_rough_integers,
    of_type,
    seamed_uvs,
    sheet_of_quads,
    shuffled,
    shuffled_cells,
    together,
    uneven,
    waving,
)
from conformance.surface import placed, read_on_surface
from conformance.surface_integers import COPIES, Kind
from meshreel.codec.bitstream import container as stream_container
from meshreel.codec.bitstream.container import (
    Header,
    write_sections,
    write_stream,
    write_varint,
    write_varints,
)
from meshreel.codec.bitstream.layout import MAX_NAME_BYTES, Section, VertexType
from meshreel.codec.connectivity.coder import encode_connectivity
from meshreel.codec.entropy import tables
from meshreel.codec.reel.normative.blocks import Corrections, write_field_block, write_track_block
from meshreel.codec.reel.normative.expected import MovingSurface
from meshreel.codec.reel.normative.fields import FieldBlock, Layout
from meshreel.codec.reel.normative.mesh import FieldMesh, item_graph
from meshreel.codec.tracks import Coding, TrackHeader, write_track
from meshreel.kernel.basis import NO_REST, BasisCoding, Rests
from meshreel.kernel.cells import encode_cells
from meshreel.kernel.integers import encode_integers
from meshreel.model.geometry.hard_edges import shared_edges
from meshreel.model.geometry.polygons import join_triangles
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import PLAIN, Attribute, Domain, Surface
from meshreel.model.tracks import Track

REEL = 7


def by_hand(
    faces,
    n_verts,
    blocks,
    *,
    vertex_type=4,
    order="drop",
    placement=((0.0, 0.0, 0.0), 1.0),
    name="by hand",
    tracks=(),
    surface=PLAIN,
    more=(),
):
    """Return a stream of method `reel` from integers.

    Parameters
    ----------
    blocks : list of (Layout, basis, fields, Corrections or None)
        Basis of shape (K, 3, T), fields of shape (K, V).
    tracks : list of (TrackHeader, such blocks)
        Further tracks; their bases have the shape (K, C, T).
    surface : Surface
        Its polygons are written, which requires order "keep".
    more : list of (Section, bytes)
        Further sections before the first block.
    """
    coded = encode_connectivity(np.asarray(faces, np.int32), n_verts, order=order)
    n_frames = sum(basis.shape[2] for _, basis, _, _ in blocks)
    header = Header(
        n_frames=n_frames,
        n_verts=n_verts,
        n_faces=len(faces),
        fps=0.0,
        vertex_type=VertexType(vertex_type),
        method=REEL,
        laplacian=0,
        order=("keep", "vertices", "drop").index(order),
        origin=placement[0],
        scale=placement[1],
        name=name,
    )
    leading = [(Section.CONNECTIVITY, coded.payload)]
    leading += [(Section.ORDER, coded.order_payload)] if order != "drop" else []
    if surface.face_sizes is not None:
        excess = surface.face_sizes.astype(np.int64) - 3
        payload = write_varint(len(excess)) + encode_integers([excess], [0])
        leading.append((Section.POLYGONS, payload))
    leading += [(Section.TRACK, write_track(track)) for track, _ in tracks]
    leading += more

    def graph_of(track):
        if track.domain == Domain.VERTEX:
            return coded.internal_faces
        return item_graph(track.domain, np.asarray(faces, np.int32), surface, n_verts).faces

    coded_blocks = []
    for number, block in enumerate(blocks):
        sections = [sections_of(write_field_block, coded.internal_faces, *block)]
        sections += [
            sections_of(write_track_block, graph_of(track), *track_blocks[number])
            for track, track_blocks in tracks
        ]
        coded_blocks.append(
            (block[1].shape[2], [section for group in sections for section in group])
        )
    return write_stream((header, leading, coded_blocks))


def sections_of(write, faces, layout, basis, fields, corrections):
    """Return the sections of a track in a block."""
    mesh = FieldMesh(faces, fields.shape[1], layout.stencil_size)
    block = FieldBlock(layout, basis.astype(np.int32), fields.astype(np.int32))
    return list(write(block, mesh, corrections))


def integers(rng, shape, spread):
    """Return random, mostly small integers; their spread decreases from row to row."""
    falling = spread * 0.6 ** np.arange(shape[0]).reshape(-1, *[1] * (len(shape) - 1))
    return np.rint(rng.laplace(scale=falling, size=shape))


def random_block(
    rng, layout, n_verts, n_modes=4, n_frames=6, *, spreads=(40.0, 30.0), moves=None, n_columns=3
):
    """Return a block of random integers."""
    basis = integers(rng, (n_modes, n_columns, n_frames), spreads[0])
    n_own = n_modes - layout.n_reused
    return layout, basis, integers(rng, (n_own, n_verts), spreads[1]), moves


def example():
    """The worked example of the page."""
    layout, basis = Layout(np.float32(0.5), 1, 0), np.array([[[3, 0], [0, -1], [0, 0]]])
    return by_hand([[0, 1, 2]], 3, [(layout, basis, np.array([[4, -1, 2]]), None)], name="")


def pushed(sequence, times=None, **options):
    """Return a stream of frames that were pushed one by one."""
    file = BytesIO()
    with meshreel.Encoder(sequence.faces, file, **options) as encoder:
        for number, frame in enumerate(sequence.vertices):
            encoder.push(frame, time=times and times[number])
    return file.getvalue()


UNEVEN = [-1.5, -1e-300, 0.0, 0.005, 0.01, 0.015, 0.0175, 1e9, 1e9 + 2**-23]
"""Across 0, almost even, and neighboring doubles."""


def times():
    """Times that are not evenly spaced."""
    sheet = moving(grid(4, 4), 9).replace(times=UNEVEN)
    return meshreel.encode(sheet, order="drop", block_frames=4)


def times_without_index():
    """Times before the first block."""
    return with_section(0, of=times)


def live_times():
    """Written live; the times follow the blocks."""
    return pushed(moving(grid(4, 4), 9), UNEVEN, block_frames=4)


def live_times_without_index():
    """The same."""
    return with_section(0, of=live_times)


def live():
    """Written live, with an unknown number of frames."""
    return pushed(moving(grid(7, 8), 13, fps=24.0), fps=24.0, block_frames=6)


def live_with_bound():
    """The same, with an error bound."""
    return pushed(moving(grid(5, 6), 9, rough=0.05), block_frames=4, max_error=0.05)


def no_index():
    """Without an index, and with an unknown section that readers skip."""
    data = meshreel.encode(moving(grid(5, 5), 6), block_frames=3, order="drop")
    (position,) = np.frombuffer(data[-12:-4], "<u8").tolist()
    unknown = bytearray(write_sections([(Section.IMAGE, b"unknown")])[0])
    unknown[0] = 0xC0
    checked = bytes(unknown[:-4])
    unknown[-4:] = zlib.crc32(checked).to_bytes(4, "little")
    return data[:position] + bytes(unknown) + write_sections([(Section.END, b"")])[0]


def stencils(sizes, faces, n_learned, seed):
    """Return a stream of random blocks with stencils of these sizes."""
    rng, n_verts = np.random.default_rng(seed), int(np.max(faces)) + 1
    blocks = [random_block(rng, Layout(np.float32(0.01), n, n_learned), n_verts) for n in sizes]
    return by_hand(faces, n_verts, blocks)


def key_blocks():
    """Weights adapted to earlier blocks, of other steps and precisions; a key with fewer modes."""
    rng, faces = np.random.default_rng(4), grid(6, 7)
    layouts = [(0, 0.01), (1, 0.02), (2, 0.005), (0, 0.01), (1, 0.01)]
    blocks = [
        random_block(
            rng, Layout(np.float32(step), 9, 3, back, number % 2 == 0), 42, 2 + number, 3 + number
        )
        for number, (back, step) in enumerate(layouts)
    ]
    return by_hand(faces, 42, blocks, order="vertices")


def reused_fields():
    """Blocks that reuse some or all fields of their key block, with and without own ones."""
    rng, faces = np.random.default_rng(14), grid(6, 7)
    kinds = [(0, 0.01, 0), (1, 0.02, 3), (2, 0.01, 5), (3, 0.004, 1), (0, 0.01, 0), (1, 0.01, 2)]
    finer = np.float32(2.5)
    blocks = [
        random_block(
            rng,
            Layout(np.float32(step), 9, 2, back, number % 2 == 0, reused, finer if reused else 0),
            42,
            5,
            4 + number,
        )
        for number, (back, step, reused) in enumerate(kinds)
    ]
    blocks[4][2][1] = 0  # a field of length 0
    return by_hand(faces, 42, blocks)


def rests():
    """Resting times: single ones, runs, up to the last; with few moving ones; reused fields."""
    rng, faces = np.random.default_rng(15), grid(6, 7)
    kinds = [
        ((), 0, 0, 9),
        (((1, 2), (4, 9), (11, 12)), 3, 0, 12),
        (((1, 30),), 8, 3, 30),
        (((2, 3), (5, 6)), 0, 0, 7),
    ]
    finer = np.float32(2.5)
    blocks = [
        random_block(
            rng,
            Layout(
                np.float32(0.01),
                9,
                2,
                number,
                number % 2 == 0,
                n_reused,
                finer if n_reused else np.float32(0),
                BasisCoding(Rests(runs, bits)),
            ),
            42,
            5,
            n_frames,
        )
        for number, (runs, bits, n_reused, n_frames) in enumerate(kinds)
    ]
    return by_hand(faces, 42, blocks)


def cosines():
    """Cosines over time: of one frame and more, reused fields, a track of two columns, large."""
    rng, faces = np.random.default_rng(16), grid(6, 7)
    kinds = [(0, 9, True), (0, 1, True), (3, 30, True), (0, 12, False), (5, 7, True)]
    single = np.float32
    blocks, of_track = [], []
    for number, (n_reused, n_frames, has_cosines) in enumerate(kinds):
        finer = single(2.5 if n_reused else 0)
        layout = Layout(
            single(0.01),
            9,
            2,
            number,
            number % 2 == 0,
            n_reused,
            finer,
            BasisCoding(has_cosines=has_cosines),
        )
        blocks.append(random_block(rng, layout, 42, min(5, 3 * n_frames), n_frames))
        layout = Layout(single(0.02), 9, 1, coding=BasisCoding(has_cosines=not number % 2))
        of_track.append(random_block(rng, layout, 42, 2, n_frames, n_columns=2))
    blocks[2][1][:, :, :4] = rng.integers(-(2**31) + 1, 2**31, (5, 3, 4))
    number_type = np.dtype(np.float32)
    track = TrackHeader("flow", "", "vector", Domain.VERTEX, number_type, 1.0, (0.0, 0.5))
    return by_hand(faces, 42, blocks, tracks=[(track, of_track)])


def cosines_of_1024_frames():
    """Cosines over the largest number of frames."""
    rng = np.random.default_rng(17)
    layout = Layout(np.float32(0.01), 1, 0, coding=BasisCoding(has_cosines=True))
    return by_hand([[0, 1, 2]], 3, [random_block(rng, layout, 3, 1, 1024)])


def adaptive_times():
    """Adaptive times: of one frame and more, with rests and reused fields, modes of zeros."""
    rng, faces = np.random.default_rng(18), grid(6, 7)
    resting = Rests(((2, 5), (9, 10), (30, 31)), 3)
    kinds = [
        (0, 33, NO_REST),
        (0, 1, NO_REST),
        (3, 40, resting),
        (0, 2, NO_REST),
        (5, 7, NO_REST),
        (2, 31, resting),
    ]
    single = np.float32
    blocks, of_track = [], []
    for number, (n_reused, n_frames, rests) in enumerate(kinds):
        finer = single(2.5 if n_reused else 0)
        layout = Layout(
            single(0.01),
            9,
            2,
            number,
            number % 2 == 0,
            n_reused,
            finer,
            BasisCoding(rests, is_adaptive=number != 4),
        )
        block = random_block(rng, layout, 42, min(9, 3 * n_frames), n_frames)
        block[1][[1, -2]] = 0
        blocks.append(block)
        layout = Layout(single(0.02), 9, 1, coding=BasisCoding(is_adaptive=number % 2 == 0))
        of_track.append(random_block(rng, layout, 42, 2, n_frames, n_columns=2))
    number_type = np.dtype(np.float32)
    track = TrackHeader("flow", "", "vector", Domain.VERTEX, number_type, 1.0, (0.0, 0.5))
    return by_hand(faces, 42, blocks, tracks=[(track, of_track)])


def adaptive_limits():
    """Adaptive times with integers so large that predictions and variances reach their limits."""
    rng = np.random.default_rng(19)
    layout = Layout(np.float32(0.01), 1, 0, coding=BasisCoding(is_adaptive=True))
    block = random_block(rng, layout, 3, 6, 90)
    block[1][1] = rng.integers(-(2**31) + 1, 2**31, (3, 90))
    block[1][2] = 2**31 - 1
    block[1][3] = (2**31 - 1) * (-1) ** np.arange(90)
    block[1][4] = 1000 * rng.random((3, 90)) ** 40
    return by_hand([[0, 1, 2]], 3, [block])


def swinging():
    """Return a sheet that oscillates ever faster, for which the encoder chooses adaptive times."""
    rng, times = np.random.default_rng(20), np.arange(120)
    waves = [np.sin(0.0006 * (2 + k) * times**1.7 + k) / (1 + k) for k in range(12)]
    displacements = np.tensordot(np.transpose(waves), rng.normal(size=(12, 64, 3)), 1)
    rest = np.pad(np.argwhere(np.ones((8, 8))), ((0, 0), (0, 1)))
    return MeshSequence((10.0 * rest + displacements).astype(np.float32), grid(8, 8))


def large_residuals():
    """Integers up to the largest, and values beyond single precision."""
    rng = np.random.default_rng(5)
    layout, basis, fields, _ = random_block(rng, Layout(np.float32(1e-6), 8, 4), 64, 5, 9)
    fields[0, ::7] = (2**31 - 1) * rng.choice([-1, 1], len(fields[0, ::7]))
    fields[3] = 2.0 ** rng.integers(0, 31, 64)
    basis[0, :, ::4] = [[2**30] * 3, [-(2**30), 2**31 - 1, 5], [0, 1, 2]]
    return by_hand(grid(8, 8), 64, [(layout, basis, fields, None)], vertex_type=8)


def lively():
    """Many large values, which exercise slow adaptation and the halving of sums."""
    rng, faces = np.random.default_rng(6), grid(14, 14)
    fields = rng.integers(-5000, 5000, (4, 196)) * (rng.random((4, 196)) < 0.8)
    fields[2] *= 20
    basis = rng.integers(-4000, 4000, (4, 3, 30))
    layout = Layout(np.float32(1e-4), 6, 2)
    return by_hand(faces, 196, [(layout, basis, fields, None)])


def nothing_moves():
    """Integers that are all 0 and take no bytes."""
    layout = Layout(np.float32(0.5), 5, 1)
    return by_hand(grid(20, 20), 400, [(layout, np.zeros((2, 3, 5)), np.zeros((2, 400)), None)])


def corrections():
    """Corrections in runs and single ones, at the first and the last vertex and frame."""
    rng, faces = np.random.default_rng(7), grid(5, 6)
    at = sorted({(v, t) for v in (0, 7, 8, 29) for t in (*range(v % 3, 5), 6, 11)})
    vertices, frames = np.array(at).T
    offsets = rng.integers(-9, 10, (len(at), 3)) * 10 ** rng.integers(0, 4, (len(at), 1))
    moves = Corrections(np.float32(0.003), vertices, frames, offsets)
    block = random_block(
        rng, Layout(np.float32(0.02), 7, 2, is_single=True), 30, 3, 12, moves=moves
    )
    return by_hand(faces, 30, [block], order="keep", placement=((5.0, -0.1, 1e6), 3.7))


def tracks():
    """Further tracks of one, two and seven columns, in blocks, with separate steps and keys."""
    rng, faces, n_verts, lengths = np.random.default_rng(10), grid(6, 7), 42, (5, 3, 6)

    def blocks(n_columns, size, step, n_modes, moved=()):
        return [
            random_block(
                rng,
                Layout(np.float32(step), size, 3, number % 2, n_columns == 7),
                n_verts,
                min(n_modes, n_columns * length),
                length,
                n_columns=n_columns,
                moves=moves(n_columns, length) if number in moved else None,
            )
            for number, length in enumerate(lengths)
        ]

    def moves(n_columns, length):
        at = np.array(sorted((v, t) for v in (0, 3, 41) for t in range(v % 2, length, 2)))
        offsets = rng.integers(-9, 10, (len(at), n_columns))
        return Corrections(np.float32(0.25), at[:, 0], at[:, 1], offsets)

    single, double = np.dtype(np.float32), np.dtype(np.float64)
    stress = TrackHeader("stress", "Pa", "other", Domain.VERTEX, single, 3e5, (1e6,))
    flow = TrackHeader("flow", "m/s", "vector", Domain.VERTEX, double, 0.125, (0.0, -3.5))
    many = TrackHeader("\u03c3", "", "other", Domain.VERTEX, single, 1.0, tuple(range(7)))
    further = [
        (stress, blocks(1, 9, 0.01, 4, moved=(1,))),
        (flow, blocks(2, 9, 0.002, 5)),
        (many, blocks(7, 4, 0.5, 12, moved=(0, 2))),
    ]
    return by_hand(faces, n_verts, blocks(3, 9, 0.01, 4), order="keep", tracks=further)


def from_points(vertex_type=4, moves=40.0):
    """Return a stream of tracks whose weights follow from points, with keys and other nuggets.

    Positions are random, of this spread.
    """
    rng, faces, n_verts = np.random.default_rng(22), uneven(n_verts=50), 50
    header = TrackHeader(
        "heat", "K", "other", Domain.VERTEX, np.dtype(np.float32), 3.0, (1.0, 0.0), bound=0.5
    )
    tracks = [(replace(header, name=f"heat {size}"), []) for size in (1, 4, 9, 16)]
    blocks = []
    for number, nugget in enumerate((13, None, 24, None, 0)):
        still = Layout(np.float32(0.01), 4, 2)
        blocks.append(random_block(rng, still, n_verts, spreads=(moves, moves)))
        for (_, of_track), size in zip(tracks, (1, 4, 9, 16), strict=True):
            layout = replace(still, stencil_size=size, reference=number % 3, nugget=nugget)
            of_track.append(random_block(rng, layout, n_verts, n_columns=2))
    return by_hand(faces, n_verts, blocks, vertex_type=vertex_type, tracks=tracks)


def weights_from_points():
    """Weights from points, of stencils of every size."""
    return from_points()


def weights_from_one_point():
    """Points that coincide."""
    return from_points(vertex_type=8, moves=0.0)


def on_faces(faces, sizes, seed, **changes):
    """Return a stream with tracks on polygons of these sizes and on their corners.

    `changes` are those of the layout of the tracks.
    """
    rng, number = np.random.default_rng(seed), np.dtype(np.float32)
    n_verts = int(np.max(faces)) + 1
    layout = Layout(np.float32(0.01), 8, 3, is_single=max(sizes) > 3)
    further = [
        (
            TrackHeader(f"of each {domain}", "K", "other", domain, number, 2.0, (0.0, 1.0)),
            [random_block(rng, replace(layout, **changes), n, n_columns=2)],
        )
        for domain, n in ((Domain.FACE, len(sizes)), (Domain.CORNER, sum(sizes)))
    ]
    return by_hand(
        faces,
        n_verts,
        [random_block(rng, layout, n_verts)],
        order="keep",
        tracks=further,
        surface=Surface(face_sizes=None if max(sizes) == 3 else np.asarray(sizes, np.int32)),
    )


def tracks_of_triangles():
    """Tracks on faces and corners of a mesh with an edge of five faces and a degenerate face."""
    faces = together(shuffled(grid(5, 6)), book(5), [[0, 0, 1]])
    return on_faces(faces, [3] * len(faces), 12)


def tracks_of_polygons():
    """The same on faces of three to five corners."""
    sizes, faces = sheet_of_quads()
    return on_faces(faces, sizes.tolist(), 13)


def weights_from_points_of_polygons():
    """The same with weights from the points of faces and corners."""
    sizes, faces = sheet_of_quads()
    return on_faces(faces, sizes.tolist(), 13, nugget=12)


def still_track():
    """A track of zeros, which take no bytes."""
    rng, faces = np.random.default_rng(11), grid(12, 12)
    wide = TrackHeader("wide", "", "other", Domain.VERTEX, np.dtype(np.float32), 1.0, (0.5,) * 64)
    nothing = Layout(np.float32(0.5), 5, 1), np.zeros((1, 64, 6)), np.zeros((1, 144)), None
    block = random_block(rng, Layout(np.float32(0.01), 5, 1), 144)
    return by_hand(faces, 144, [block], tracks=[(wide, [nothing])])


def normals():
    """Normals, some of them zero, and a scalar with a bound."""
    rng, faces = np.random.default_rng(14), grid(5, 6)
    layout = Layout(np.float32(0.05), 6, 2)
    single = np.dtype(np.float32)
    normal = TrackHeader("n", "", "normal", Domain.VERTEX, single, 1.5, (0.1, 0.2, 0.3), bound=0.5)
    heat = TrackHeader("heat", "K", "scalar", Domain.VERTEX, single, 80.0, (300.0,), bound=0.25)
    further = [
        (track, [random_block(rng, layout, 30, 4, 4, n_columns=track.n_columns)])
        for track in (normal, heat)
    ]
    return by_hand(faces, 30, [random_block(rng, layout, 30, 4, 4)], order="keep", tracks=further)


def with_exact_tracks(dtype, domain, n_items):
    """Return a sheet with an exact track of this type, with special values if floats."""
    rng, sheet = np.random.default_rng(15), moving(grid(5, 6), 7)
    values = np.rint(40 + 9 * np.sin(np.arange(n_items)[:, None] / 4 + np.arange(2)))
    values = values + np.arange(7)[:, None, None] + (rng.random((7, n_items, 2)) < 0.1)
    values = values.astype(dtype)
    if values.dtype.kind == "f":
        values[2, 3] = [np.nan, -np.inf]
        values[4] *= np.array(1.1, dtype)
    tracks = {"x": Track(values, domain, "other")}
    return MeshSequence(sheet.vertices, sheet.faces, tracks=tracks)


def with_runs():
    """Return a sheet whose faces have labels in runs."""
    sheet = moving(grid(5, 6), 5)
    runs = np.arange(40, dtype=np.int32) // 3 * 5 % 7
    values = np.broadcast_to(runs[:, None], (5, 40, 1)).copy()
    values[3:, 20:] += 1
    tracks = {"runs": Track(values, "face", "other")}
    return MeshSequence(sheet.vertices, sheet.faces, tracks=tracks)


def with_signs(sequence):
    """Round positions, so that many repeat, and negate half of the zeros."""
    rounded = np.round(10 * sequence.vertices) / 10
    negative = np.random.default_rng(17).random(rounded.shape) < 0.5
    return MeshSequence(np.where((rounded == 0) & negative, -rounded, rounded), sequence.faces)


def standing(sequence, n_frames=7):
    """Return the first frame of a sequence several times."""
    tracks = {"x": np.arange(n_frames * sequence.n_verts, dtype=np.int32).reshape(n_frames, -1)}
    still = np.repeat(sequence.vertices[:1], n_frames, axis=0)
    return sequence.replace(vertices=still, tracks=tracks)


def grid_of_all_kinds():
    """Frames that rest in part, move evenly, are equal, and are of another shape after a cut."""
    sheet = moving(shuffled(holes(6, 7)), 1, rough=0.01).vertices[0]
    frames = np.repeat(sheet[None], 8, axis=0)
    velocities = 0.05 * np.random.default_rng(5).normal(size=sheet.shape)
    velocities[1::2] = 0
    frames[1:5] += velocities * np.arange(1, 5)[:, None, None]
    frames[5] = frames[4]
    frames[6:] = moving(shuffled(holes(6, 7)), 1).vertices[0][:, [2, 0, 1]]
    frames[7, :9] += 0.01
    sequence = MeshSequence(frames.astype(np.float32), shuffled(holes(6, 7)))
    with patch("conformance.surface_integers.Kind", wraps=Kind) as kinds:
        data = meshreel.encode(sequence, method="grid", max_error=0.1, order="drop")
        read_all(data)
    assert kinds.call_count == 3
    return data


def quantized(faces, dtype=np.float32):
    """One frame on a grid, of coordinates written as text with six digits; some are -0."""
    sheet = moving(faces, 1, rough=0.01)
    step = np.float32(np.ptp(sheet.vertices) / 9)
    rounded = np.rint(sheet.vertices / step).astype(np.float32) * step - np.float32(3) * step
    text = [-0.0 if value == 0 else float(f"{value:.6g}") for value in rounded.ravel()]
    return MeshSequence(np.array(text, dtype).reshape(rounded.shape), faces)


def grid_copied():
    """Two equal rough sheets: residuals of the second are copies."""
    rng, faces = np.random.default_rng(22), together(grid(8, 9), grid(8, 9))
    part = rng.integers(-400, 400, (72, 3))
    vertices = np.concatenate([part, part + np.array([0, 5000, 0])]).astype(np.float32)
    data = meshreel.encode(MeshSequence(vertices[None], faces), method="grid", max_error=0.001)
    (group,) = read_container(data).blocks[0]
    assert group["VALUES"][5] >> 4 & COPIES
    return data


def attributes_on_surface():
    """Integers of vertices and of corners of polygons, two of them by a divisor, on the surface."""

    def last(forms, faces, points):
        return list(tables._trials(forms, faces, None))[-1]

    with patch.object(tables, "_shortest", last):
        data = meshreel.encode(of_rough_integers(), method="grid", max_error=0.01, uv_bits=10)
    with patch("conformance.surface.read_on_surface", wraps=read_on_surface) as read:
        read_all(data)
    assert read.call_count == 4
    return data


def attributes_from_points(n_frames=5, **options):
    """Attributes of vertices and corners, of all types, from positions; some are not finite."""

    def last_or_too_long(forms, faces, points):
        table = list(tables._trials(forms, faces, points))[-1]
        return table if faces is None or points is not None else table + bytes(9999)

    with patch.object(tables, "_shortest", last_or_too_long):
        data = meshreel.encode(of_everything(n_frames=n_frames), **options)
    assert len(read_container(data).all_of("ATTRIBUTE_FROM_POINTS")) == 8
    return data


def attributes_on_own_grids():
    """Texture coordinates of vertices and of corners as a quantizer of 7 bits leaves them."""
    sheet, rng = moving(grid(6, 7), 2), np.random.default_rng(21)

    def quantized(n_rows):
        steps = rng.integers(0, 128, (n_rows, 2)).astype(np.float32)
        steps[0], steps[1] = 0, 127
        return np.float32([-0.3, 0.21]) + steps * (np.float32(0.77) / np.float32(127))

    attributes = (
        attribute("uv", "uv", "vertex", quantized(42)),
        attribute("second", "uv", "corner", quantized(42), sheet.faces.ravel()),
    )
    whole = MeshSequence(sheet.vertices, sheet.faces, surface=Surface(attributes=attributes))
    data = meshreel.encode(whole)
    with patch("conformance.surface.placed", wraps=placed) as read:
        read_all(data)
    assert read.call_count == 84
    return data


def grid_live():
    """The same, written live."""
    sheet = moving(grid(6, 7), 9, fps=24.0)
    return pushed(sheet, fps=24.0, block_frames=4, method="grid", max_error=0.01)


def lossless_live():
    """The same, written live."""
    return pushed(moving(grid(6, 7), 9, fps=24.0), fps=24.0, block_frames=4, lossless=True)


def missing_values():
    """A scalar with missing values."""
    sheet = moving(grid(5, 6), 7)
    heat = np.sin(np.arange(7)[:, None] / 3 + np.arange(30) / 5).astype(np.float32)
    heat[2:5, 4:9] = np.nan
    heat[:, 11] = np.nan
    tracks = {"heat": Track(heat, unit="K")}
    sequence = MeshSequence(sheet.vertices, sheet.faces, tracks=tracks)
    return meshreel.encode(sequence, order="vertices", block_frames=4)


def values_on_grids():
    """Tracks on grids, some values missing, beside modes: a scalar, velocities and normals."""
    sheet, rng = moving(grid(5, 6), 7), np.random.default_rng(8)
    kicks = np.where(rng.random((7, 30, 3)) < 0.1, 3.0, 0.0)
    velocity = (25 * np.gradient(sheet.vertices.astype(np.float64), axis=0) + kicks).astype("f4")
    velocity[2, 5:8] = np.nan
    normals = slightly_rotated(sheet, "vertex")
    normals[rng.random((7, 30)) < 0.1] = [0.0, 0.0, 1.0]
    status = np.repeat(rng.integers(0, 3, (1, 30)), 7, axis=0) + rng.integers(0, 2, (7, 1))
    tracks = {
        "status": Track(np.where(status == 2, np.nan, 0.7 * status)),
        "velocity": Track(velocity, kind="velocity"),
        "normals": Track(normals, kind="normal"),
        "smooth": Track(sheet.vertices[:, :, 2] ** 2),
    }
    data = meshreel.encode(sheet.replace(tracks=tracks), block_frames=4, max_error=0.1)
    groups = read_container(data).blocks[1][1:]
    assert [("VALUES" in group) for group in groups] == [True, True, True, False]
    return data


def slightly_rotated(sheet, domain):
    """Return normals that are slightly rotated from those of the surface."""
    surface = MovingSurface(sheet.faces, sheet.faces, sheet.surface)
    normals = surface.normals(Domain(domain), sheet.vertices) + np.array([0.02, 0.0, -0.01])
    return (normals / np.linalg.norm(normals, axis=2, keepdims=True)).astype(np.float32)


def predicted_tracks():
    """Velocities predicted by each kind of difference, some missing, and normals."""
    sheet = moving(grid(5, 6), 7)
    positions = sheet.vertices.astype(np.float64)
    steps = 25 * (positions[1:] - positions[:-1])
    backward = np.concatenate([steps[:1], steps]).astype(np.float32)
    forward = np.concatenate([steps, steps[-1:]])
    central = (25 * np.gradient(positions, axis=0)).astype(np.float32)
    central[2, 5:8] = np.nan
    normals = slightly_rotated(sheet, "vertex")
    normals[3, 4] = np.nan
    tracks = {
        "before": Track(backward, kind="velocity"),
        "around": Track(central, kind="velocity"),
        "behind": Track(forward, kind="velocity"),
        "normals": Track(normals, kind="normal"),
    }
    whole = MeshSequence(sheet.vertices, sheet.faces, 25, tracks=tracks)
    return meshreel.encode(whole, "grid", order="vertices", block_frames=6, max_error=0.001)


def predicted_from_exact_positions():
    """Velocities and normals predicted from exact positions."""
    sheet = moving(grid(5, 6), 7)
    velocity = 30 * np.gradient(sheet.vertices, axis=0).astype(np.float32)
    exactly = velocity.copy()
    exactly[2, 3] = [np.nan, -0.0, -np.inf]
    in_double = 25 * np.diff(sheet.vertices.astype(np.float64), axis=0, append=0)
    tracks = {
        "velocity": Track(velocity, kind="velocity"),
        "normals": Track(slightly_rotated(sheet, "vertex"), kind="normal"),
        "exactly": Track(exactly, kind="velocity"),
        "in double": Track(in_double, kind="velocity"),
    }
    whole = MeshSequence(sheet.vertices, sheet.faces, 25, tracks=tracks)
    bounds = {"velocity": "0.1%", "normals": "0.5deg"}
    return meshreel.encode(whole, lossless=True, block_frames=4, tracks=bounds)


def normals_of_polygons():
    """Normals of faces and corners of polygons, predicted from the surface."""
    sizes, faces = sheet_of_quads()
    plain = moving(faces, 4)
    surface = Surface(face_sizes=np.asarray(sizes, np.int32))
    sheet = MeshSequence(plain.vertices, plain.faces, 25, surface=surface)
    of_corners = slightly_rotated(sheet, "corner")
    of_corners *= 1 + np.float32(2**-20) * np.arange(of_corners.shape[1])[:, None]  # all differ
    tracks = {
        "face": Track(slightly_rotated(sheet, "face"), "face", "normal"),
        "corner": Track(of_corners.astype(np.float32), "corner", "normal"),
    }
    whole = MeshSequence(sheet.vertices, sheet.faces, 25, surface=surface, tracks=tracks)
    return meshreel.encode(whole, max_error=0.001)


def with_corners(sizes, faces, jump):
    """Return a sheet with tracks of corners that share the values of vertices.

    With `jump` those of one half differ; without it there is a velocity. One vertex has no face.
    """
    plain = moving(faces, 16)
    vertices = np.concatenate([plain.vertices, plain.vertices[:, :1] + 1], axis=1)
    surface = Surface(face_sizes=np.asarray(sizes, np.int32) if max(sizes) > 3 else None)
    sheet = MeshSequence(vertices, faces, 25, surface=surface)
    of_corners = join_triangles(sizes, np.asarray(faces))
    side = np.repeat(np.arange(len(sizes)) > len(sizes) // 2, sizes)[:, None]
    t, v, c = np.ogrid[:16, : sheet.n_verts, :2]
    wave = (30 * np.sin(0.3 * t + 0.4 * v + c)).astype(np.float32)[:, of_corners]
    wave += side * np.float32(jump) * (1 + np.arange(16, dtype=np.float32)[:, None, None] / 8)
    gaps = wave.copy()
    gaps[5:9, of_corners == 7] = np.nan
    gaps[3, (of_corners == 9) & (side[:, 0] | (not jump)), 1] = np.nan
    bare = MeshSequence(plain.vertices, faces, surface=surface)
    normals = slightly_rotated(bare, "corner")
    normals[:, side[:, 0] & bool(jump)] *= np.array([1, -1, 1], np.float32)
    tracks = {
        "wave": Track(wave, "corner", "vector"),
        "gaps": Track(gaps, "corner", "uv"),
        "whole": Track(np.rint(wave[..., :1]).astype(np.int32), "corner"),
        "normals": Track(normals, "corner", "normal"),
    }
    if not jump:
        velocity = 25 * np.gradient(vertices, axis=0).astype(np.float32)[:, of_corners]
        tracks["velocity"] = Track(velocity, "corner", "velocity")
    return MeshSequence(vertices, faces, 25, surface=surface, tracks=tracks)


def corners_of_vertices():
    """Tracks of corners of triangles with the values of their vertices."""
    faces = shuffled(grid(5, 6))
    whole = with_corners(np.full(len(faces), 3), faces, 0)
    return meshreel.encode(whole, max_error=0.001, block_frames=9)


def exact_velocities_of_corners():
    """Exact velocities of corners with the values of their vertices."""
    faces = shuffled(grid(5, 6))
    whole = with_corners(np.full(len(faces), 3), faces, 0)
    whole = whole.replace(tracks={"velocity": whole.tracks["velocity"]})
    return meshreel.encode(whole, lossless=True, block_frames=9)


def corners_in_rows():
    """Tracks of corners of polygons with seams, and one with distinct values at each corner."""
    sizes, faces = sheet_of_quads(4, 5)
    whole = with_corners(sizes, faces, 9)
    own = np.random.default_rng(18).random((16, len(whole.tracks["wave"][0])))
    tracks = {**whole.tracks, "own": Track(own.astype(np.float32), "corner")}
    whole = whole.replace(tracks=tracks)
    return meshreel.encode(whole, max_error=0.001, block_frames=9)


def concave_polygons():
    """Polygons whose triangles are not fans, with hard edges, seams, and tracks of corners."""
    sizes, faces = concave_sheet()
    whole = with_corners(sizes, faces, 9)
    corners = join_triangles(sizes, faces)
    surface = replace(
        whole.surface,
        attributes=(seamed_uvs(sizes, faces),),
        hard_edges=shared_edges(sizes, corners).ends[::3],
    )
    return meshreel.encode(whole.replace(surface=surface), max_error=0.001, block_frames=9)


def with_triangles_apart():
    """A quad whose second triangle shares no side with the first."""
    layout, basis = Layout(np.float32(0.5), 1, 0), np.array([[[3, 0], [0, -1], [0, 0]]])
    block = (layout, basis, np.array([[4, -1, 2, 1]]), None)
    surface = Surface(np.array([4], np.int32))
    return by_hand([[0, 1, 2], [0, 1, 3]], 4, [block], order="keep", surface=surface)


def of_cells(kind, points, cells, n_frames=5):
    """Return a waving sequence of cells of one type."""
    return MeshSequence(waving(points, n_frames), cells=of_type(kind, cells))


TETRAHEDRON_EDGES = (0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)
HEXAHEDRON_EDGES = (
    *((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)),
    *((0, 4), (1, 5), (2, 6), (3, 7)),
)


def quadratic(kind, points, cells):
    """Return points and cells with a node on each edge of tetrahedra or hexahedra."""
    nodes, rows, listed = {}, [], list(points)
    for cell in cells.tolist():
        for a, b in TETRAHEDRON_EDGES if kind == 24 else HEXAHEDRON_EDGES:
            key = min(cell[a], cell[b]), max(cell[a], cell[b])
            if key not in nodes:
                nodes[key] = len(listed)
                listed.append((points[cell[a]] + points[cell[b]]) / 2)
            cell.append(nodes[key])
        rows.append(cell)
    return np.array(listed), np.array(rows)


def cells_around_an_edge():
    """More tetrahedra than an edge has classes, and more sides and edges than are searched."""
    ring = np.arange(70)
    angles = 2 * np.pi * ring / 70
    circle = np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
    cells = np.column_stack([0 * ring, 0 * ring + 1, ring + 2, (ring + 1) % 70 + 2])
    points = np.vstack([[[0, 0, -1], [0, 0, 1]], circle])
    return meshreel.encode(of_cells(10, points, cells, 2), order="drop")


def cells_of_all_types():
    """Cells of every type between random vertices, and vertices of no cell, in their order."""
    points = np.random.default_rng(13).normal(size=(64, 3))
    return meshreel.encode(MeshSequence(waving(points, 2), cells=mixed_cells()))


def cells_of_all_types_dropped():
    """The same, walked."""
    points = np.random.default_rng(13).normal(size=(64, 3))
    sequence = MeshSequence(waving(points, 2), cells=mixed_cells())
    return meshreel.encode(sequence, order="drop")


def cells_with_values():
    """Tracks of nodes, cells and faces, and attributes of cells."""
    points, hexahedra = boxes(3, 3, 2)
    whole = of_cells(12, points, hexahedra)
    centers = whole.vertices[:, hexahedra].mean(axis=2)
    tracks = {
        "heat": Track(whole.vertices[..., 0] * 3, unit="K"),
        "stress": Track(centers[..., 1], "cell"),
        "flow": Track(centers, "cell", "vector"),
        "part": Track(np.arange(5 * 18).reshape(5, 18) // 7, "cell"),
        "light": Track(np.linspace(0, 1, 5 * 42, dtype=np.float32).reshape(5, 42), "face"),
    }
    material = np.arange(18, dtype=np.int32)[:, None] // 5
    attributes = (
        Attribute("material", "other", "cell", material),
        Attribute("density", "other", "cell", np.array([[1.5], [2.5]]), np.arange(18) % 2),
    )
    whole = whole.replace(surface=replace(whole.surface, attributes=attributes), tracks=tracks)
    return meshreel.encode(whole, block_frames=3)


def cells_with_values_dropped():
    """Tracks of nodes and cells, and an attribute of cells, without their order."""
    whole = of_cells(12, *shuffled_cells(*boxes(3, 3, 2)))
    centers = whole.vertices[:, whole.surface.cells.nodes.reshape(-1, 8)].mean(axis=2)
    tracks = {
        "heat": Track(whole.vertices[..., 0] * 3),
        "stress": Track(centers[..., 1], "cell"),
        "part": Track(np.arange(5 * 18).reshape(5, 18) // 7, "cell"),
    }
    number = Attribute("number", "other", "cell", np.arange(18, dtype=np.int32)[:, None])
    whole = whole.replace(surface=replace(whole.surface, attributes=(number,)), tracks=tracks)
    return meshreel.encode(whole, block_frames=3, order="drop")


def cells_listed():
    """Hexahedra in the order of a mesher, which are listed."""
    return meshreel.encode(of_cells(12, *boxes(4, 3, 3)))


def cells_and(*sections, n_replaced=0):
    """Return the stream of listed cells with other sections behind CELLS."""
    return with_section(1, *sections, n_replaced=n_replaced, of=cells_listed)


def with_cells(counts, listed, second_node=None):
    """Return the stream of listed cells with other counts, or another node of the first cell."""
    cells = of_type(12, boxes(4, 3, 3)[1])
    nodes = cells.nodes.copy()
    nodes[1] = nodes[1] if second_node is None else second_node
    payload = encode_cells(cells.types, nodes, 81, listed=listed).data
    return cells_and_payload(write_varints(*counts) + payload)


def cells_payload():
    """Return CELLS of the stream of listed cells."""
    container = read_container(cells_listed())
    return container.only("CELLS")


def cells_and_payload(payload):
    """Return the stream of listed cells with another payload of CELLS."""
    return with_section(0, (Section.CELLS, payload), n_replaced=1, of=cells_listed)


def normals_at_the_pole():
    """Normals of a flat surface, up or down, some rotated so far that they become 0."""
    rng, faces = np.random.default_rng(16), grid(5, 6)
    layout, single = Layout(np.float32(0.01), 6, 2), np.dtype(np.float32)
    _, basis, fields, _ = random_block(rng, layout, 30, 4, 4)
    basis[:, 2] = 0
    near = TrackHeader(
        "near", "", "normal", Domain.VERTEX, single, 1.0, (0.0,) * 3, Coding.ROTATIONS
    )
    further = [
        (track, [random_block(rng, layout, 30, 4, 4, n_columns=2)])
        for track in (near, replace(near, name="far", scale=1e154))
    ]
    return by_hand(faces, 30, [(layout, basis, fields, None)], tracks=further)


def many_resolutions():
    """A book whose pages are kept one by one: more resolutions than the limit."""
    rng, faces = np.random.default_rng(8), together(grid(14, 14), book(33))
    n_verts = int(faces.max()) + 1
    return by_hand(faces, n_verts, [random_block(rng, Layout(np.float32(0.01), 4, 1), n_verts, 2)])


def no_more_rows():
    """Only a book: resolutions end at four times the vertices."""
    rng, faces = np.random.default_rng(9), book(30)
    return by_hand(faces, 32, [random_block(rng, Layout(np.float32(0.01), 6, 2), 32, 3)])


def lossless_of_lossy():
    """Lossless positions and tracks of a source that was decoded within bounds."""
    whole = moving(grid(5, 6), 9, rough=0.01)
    speed = np.gradient(whole.vertices, axis=0)
    heat = np.random.default_rng(20).random((9, whole.n_verts))
    tracks = {"velocity": Track(speed, kind="velocity"), "heat": Track(heat, unit="K")}
    decoded = meshreel.decode(meshreel.encode(whole.replace(tracks=tracks), bound=0.5))
    return meshreel.encode(decoded, lossless=True)


def of_lossy_and(coding, bound):
    """Return a lossless stream of a lossy source; its second track has another coding and bound."""
    of = lossless_of_lossy
    heat = bytearray(read_container(of()).all_of("TRACK")[1])
    heat[3], heat[-8:] = coding, np.array([bound], "<f8").tobytes()
    number = [name for name, _ in read_container(of()).leading].index("TRACK") + 1
    return with_section(number, (Section.TRACK, bytes(heat)), n_replaced=1, of=of)


def with_error_bound(payload):
    """Return the worked example with this payload of ERROR_BOUND."""
    layout, basis = Layout(np.float32(0.5), 1, 0), np.array([[[3, 0], [0, -1], [0, 0]]])
    block = (layout, basis, np.array([[4, -1, 2]]), None)
    return by_hand([[0, 1, 2]], 3, [block], more=[(Section.ERROR_BOUND, payload)])


def with_high_rate():
    """Return a stream whose frames per second are an integer beyond the limit of integers."""
    with patch.object(stream_container, "_MAX_RATE", 2**40):
        return meshreel.encode(moving(grid(2, 2), 3, fps=2.0**33), order="drop")


def with_long_name():
    """Return the worked example with a name one byte too long."""
    layout, basis = Layout(np.float32(0.5), 1, 0), np.array([[[3, 0], [0, -1], [0, 0]]])
    block = (layout, basis, np.array([[4, -1, 2]]), None)
    with patch.object(stream_container, "MAX_NAME_BYTES", MAX_NAME_BYTES + 1):
        return by_hand([[0, 1, 2]], 3, [block], name="n" * (MAX_NAME_BYTES + 1))


HEAT = TrackHeader(
    "heat", "", "other", Domain.VERTEX, np.dtype(np.float32), 1.0, (0.0,), Coding.MODES, bound=1.0
)


def heated(n_tracks=1, **changes):
    """Return the worked example with equal tracks, whose header is changed."""
    layout, basis = Layout(np.float32(0.5), 1, 0), np.array([[[3, 0], [0, -1], [0, 0]]])
    track = replace(HEAT, **changes)
    of_track = random_block(np.random.default_rng(0), layout, 3, 1, 2, n_columns=track.n_columns)
    blocks = [(layout, basis, np.array([[4, -1, 2]]), None)]
    return by_hand([[0, 1, 2]], 3, blocks, tracks=n_tracks * [(track, [of_track])])


def with_nugget(code, of_positions=False):
    """Return the worked example with weights from points, of the positions or of a track."""
    layout, basis = Layout(np.float32(0.5), 1, 0), np.array([[[3, 0], [0, -1], [0, 0]]])
    from_points = replace(layout, nugget=code)
    blocks = [(from_points if of_positions else layout, basis, np.array([[4, -1, 2]]), None)]
    of_track = random_block(np.random.default_rng(0), from_points, 3, 1, 2, n_columns=1)
    tracks = [] if of_positions else [(HEAT, [of_track])]
    return by_hand([[0, 1, 2]], 3, blocks, tracks=tracks)


def with_relations(*distances, domain=Domain.VERTEX):
    """Return the worked example with tracks, the first of which has this domain.

    `distances` are those of the others from their related track; 0 means that there is none.
    """
    layout, basis = Layout(np.float32(0.5), 1, 0), np.array([[[3, 0], [0, -1], [0, 0]]])
    rng, tracks = np.random.default_rng(0), []
    for number, distance in enumerate((0, *distances)):
        header = replace(HEAT, name=f"heat {number}", domain=Domain.VERTEX if number else domain)
        related = replace(layout, nugget=13, related=distance) if distance else layout
        n_items = 3 if header.domain is Domain.VERTEX else 1
        tracks.append((header, [random_block(rng, related, n_items, 1, 2, n_columns=1)]))
    return by_hand([[0, 1, 2]], 3, [(layout, basis, np.array([[4, -1, 2]]), None)], tracks=tracks)


def chain_of_related_tracks():
    """As many relations as a chain may have."""
    return with_relations(*[1] * 8)


def related_tracks():
    """Fields of tracks that predict those of later tracks, in two blocks."""
    sheet, rng = moving(grid(12, 12), 4), np.random.default_rng(5)
    x, y, z = np.moveaxis(sheet.vertices.astype(np.float64), -1, 0)
    rough = 0.1 * rng.normal(size=x.shape)
    tracks = {
        "first": np.sin(x) + rough,
        "between": np.sin(y),
        "twice": np.stack([y + 2 * rough, z - rough, x + y], axis=-1),
        "again": x * y + 3 * rough,
    }
    with patch("meshreel.codec.reel.encoding.following_tracks.MIN_NUMBERS", 0):
        data = meshreel.encode(sheet.replace(tracks=tracks), bound="0.5%", block_frames=2)
    related = [blocks[0].get("related", 0) for _, blocks, _ in read_all(data)[0].tracks]
    assert related[2:] == [2, 1]
    return data


def related_to_a_grid():
    """Values on a grid that predict a field."""
    sheet, rng = moving(grid(14, 14), 1), np.random.default_rng(5)
    x, y, _ = np.moveaxis(sheet.vertices.astype(np.float64), -1, 0)
    plies = rng.integers(0, 4, x.shape) + 0.1 * rng.normal(size=x.shape)
    tracks = {"plies": plies, "near": 2 * plies + np.sin(x) * y}
    data = meshreel.encode(sheet.replace(tracks=tracks), bound="0.5%")
    (_, [first], _), (_, [second], _) = read_all(data)[0].tracks
    assert (first["modes"], second["related"]) == (0, 1)
    return data


def with_rests(payload):
    """Return the worked example with a resting time, replaced by these bytes."""
    layout = Layout(np.float32(0.5), 1, 0, coding=BasisCoding(Rests(((1, 2),))))
    basis = np.array([[[3, 0], [0, -1], [0, 0]]])
    with patch("meshreel.codec.reel.normative.blocks._write_rests", lambda _: bytes(payload)):
        return by_hand([[0, 1, 2]], 3, [(layout, basis, np.array([[4, -1, 2]]), None)])


def with_cosines(n_frames, runs):
    """Return one face with cosines over n frames and resting times."""
    layout = Layout(np.float32(0.5), 1, 0, coding=BasisCoding(Rests(runs), has_cosines=True))
    basis = np.zeros((1, 3, n_frames), np.int64)
    return by_hand([[0, 1, 2]], 3, [(layout, basis, np.array([[4, -1, 2]]), None)])


def with_adaptive_cosines():
    """Return one face whose layout announces cosines and adaptive times."""
    layout = Layout(np.float32(0.5), 1, 0, coding=BasisCoding(has_cosines=True, is_adaptive=True))
    basis = np.zeros((1, 3, 3), np.int64)
    return by_hand([[0, 1, 2]], 3, [(layout, basis, np.array([[4, -1, 2]]), None)])


def doubles(*numbers):
    """Return times that are stored as they are."""
    return b"".join(b"\0" + np.float64(number).tobytes() for number in numbers)


def three_frames():
    """A stream of three frames with few sections."""
    return meshreel.encode(moving(grid(2, 2), 3, n_waves=1), order="drop")


def with_section(number, *sections, n_replaced=0, of=None):
    """Return a stream, or the worked example, without INDEX, with sections before a number."""
    payload = Payload((of or example)())
    read_header(payload)
    head = payload.data[: payload.position]
    parts = [
        (Section[name], data)
        for _, name, data in read_sections(payload)
        if name not in ("INDEX", "END")
    ]
    parts[number : number + n_replaced] = [
        parts[one] if type(one) is int else one for one in sections
    ]
    return head + b"".join(write_sections([*parts, (Section.END, b"")]))


def with_attribute(section, domain, n_rows, predictor):
    """Return the worked example with an attribute of equal integers."""
    return with_section(1, (section, bytes([2, domain, 1, 1, 0, 0, n_rows, 0, 255, predictor])))


def compact():
    """A name, a track, and a bound and a start that are decimals, under one checksum."""
    sheet = moving(grid(2, 2), 3, n_waves=1).replace(name="compact", start_s=2.5)
    weight = Track(np.arange(12, dtype=np.float32).reshape(3, 4))
    return meshreel.encode(sheet.replace(tracks={"weight": weight}), max_error=0.1)


def compact_with_times():
    """Times behind the blocks, and a section that no reader knows."""
    head, *sections, end = compact_parts()
    return sealed(head, bare(0xF0, b"?"), *sections, bare(Section.TIMES, doubles(0, 1, 3)), end)


def compact_parts():
    """Return the header and the sections of a compact stream, END last."""
    payload = Payload(three_frames())
    read_header(payload)
    ends = [payload.position] + [payload.position for _ in read_sections(payload)]
    ends[-1] -= 4  # the checksum
    return [payload.data[start:end] for start, end in zip([0, *ends], ends, strict=False)]


def bare(section, data):
    """Return a section without a checksum."""
    return bytes([section]) + write_varint(len(data)) + data


def sealed(*parts):
    """Return the parts of a compact stream and their checksum."""
    data = b"".join(parts)
    return data + zlib.crc32(data).to_bytes(4, "little")


def compact_and(*sections):
    """Return a compact stream with further sections."""
    *parts, end = compact_parts()
    return sealed(*parts, *sections, end)


BY_HAND = (
    times, cells_listed, example, times_without_index, live_times, live_times_without_index, live,
    live_with_bound, no_index, key_blocks, reused_fields, rests, cosines, cosines_of_1024_frames,
    adaptive_times, adaptive_limits, large_residuals, lively, nothing_moves, corrections, tracks,
    tracks_of_triangles, tracks_of_polygons, still_track, normals, grid_of_all_kinds, grid_copied,
    attributes_on_surface, attributes_from_points, attributes_on_own_grids, grid_live,
    lossless_live, missing_values, values_on_grids, predicted_tracks,
    predicted_from_exact_positions, normals_of_polygons,
    corners_of_vertices, exact_velocities_of_corners, corners_in_rows, concave_polygons,
    cells_around_an_edge, cells_of_all_types, cells_of_all_types_dropped, cells_with_values,
    cells_with_values_dropped, normals_at_the_pole, many_resolutions, no_more_rows,
    lossless_of_lossy, compact,
    compact_with_times, weights_from_points, weights_from_one_point,
    weights_from_points_of_polygons, related_tracks, related_to_a_grid,
    chain_of_related_tracks,
)  # fmt: skip
"""Functions that return a stream of their name."""
