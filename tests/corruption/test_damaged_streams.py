"""Truncated or changed bytes raise our errors: never others, never a hang."""

import struct
import zlib
from contextlib import nullcontext, suppress
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from conformance import reader as plain
from conformance.bits import DamagedError
from meshreel.codec.bitstream.container import write_sections, write_varint
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import info
from meshreel.codec.reel.normative.blocks import write_layout
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import CorruptStreamError, MeshReelError, TruncatedStreamError
from meshreel.formats.reel import open as open_reel
from samples.costs import draws
from samples.materials import dressed_sheet
from samples.meshes import irregular_sequence, two_sheets, waving_grid
from samples.streams import Stream, layout_of, layouts, parts_of, raw_stream

ROOT = Path(__file__).parents[2]
END_BYTES = 14

MEMORY = "20MB"
"""Memory limit of decoding, which also limits its time for hostile streams."""


def stored(name):
    return (ROOT / "conformance" / "streams" / f"{name}.reel").read_bytes()


STREAMS = {
    "grid": encode(waving_grid(4, 4, 5), "pca-qp"),
    "irregular": encode(irregular_sequence(3), "pca-qp", n_modes=2),
    "blocks": encode(waving_grid(7, 4, 5), "blocks", n_modes=2, block_frames=3),
    "rows": encode(waving_grid(3, 4, 5), "v2v", n_modes=3, bits=[6, 0, 4]),
    "gft": encode(irregular_sequence(3), "gft", n_modes=9),
    "reel": encode(waving_grid(5, 4, 5), "reel", step=0.003, block_frames=3),
    "reel irregular": encode(irregular_sequence(3), "reel", step=0.01),
    "reel corrected": encode(irregular_sequence(4), max_error=8.0, n_modes=2, block_frames=2),
    "surface": encode(two_sheets(2), step=0.01),
    "surface on a grid": encode(two_sheets(2), step=0.01, uv_bits=9),
    "materials": encode(dressed_sheet(2), step=0.01),
    "lossless": encode(waving_grid(5, 4, 5), lossless=True, block_frames=3),
    "lossless irregular": encode(irregular_sequence(3), lossless=True),
    "on a grid": encode(waving_grid(5, 4, 5), "grid", max_error=0.01, block_frames=3),
    "on a grid irregular": encode(irregular_sequence(3), "grid", max_error=1e-4),
    "tracks": stored("tracks_of_triangles"),
    "corners in rows": stored("corners_in_rows"),
    "exact track": stored("exact_of_faces"),
    "serial": encode(waving_grid(3, 4, 5), "pca-qs", n_modes=2),
}


@pytest.mark.parametrize("name", STREAMS)
def test_every_truncation_is_detected(name):
    data = STREAMS[name]
    for size in range(len(data)):
        with pytest.raises(TruncatedStreamError):
            decode(data[:size])


@pytest.mark.parametrize("name", STREAMS)
def test_byte_flips_are_detected_anywhere(name):
    rng = np.random.default_rng(2026)
    for _ in range(draws(2000)):
        data = bytearray(STREAMS[name])
        data[rng.integers(len(data))] ^= rng.integers(1, 256)
        with pytest.raises(MeshReelError):
            decode(bytes(data))


@pytest.mark.parametrize("name", STREAMS)
def test_info_detects_flipped_bytes(name):
    for position in range(len(STREAMS[name])):
        data = bytearray(STREAMS[name])
        data[position] ^= 0x40
        with pytest.raises(MeshReelError):
            info(bytes(data))


@pytest.mark.parametrize("name", STREAMS)
def test_hostile_payloads_with_valid_checksums_raise_our_errors_or_decode(name):
    """An attacker can compute checksums, so the layers behind them must check too."""
    stream = Stream(STREAMS[name])
    rng = np.random.default_rng(99)
    for _ in range(draws(400)):
        parts = [(section, bytearray(payload)) for section, payload in parts_of(stream)]
        _mutate(parts[rng.integers(len(parts))][1], rng)
        data = raw_stream(stream.header, [(section, bytes(part)) for section, part in parts])
        described, decoded = read_hostile(data)
        for read in (described, decoded):
            assert read is None or read.n_verts == stream.header.n_verts


@pytest.mark.parametrize("name", STREAMS)
def test_hostile_headers_with_valid_checksums_raise_our_errors_or_decode(name):
    size = Stream(STREAMS[name]).header_size_bytes
    rng = np.random.default_rng(5)
    for _ in range(draws(400)):
        header = bytearray(STREAMS[name][: size - 4])
        _mutate(header, rng, keep_length=True)
        read_hostile(bytes(header) + struct.pack("<I", zlib.crc32(header)) + STREAMS[name][size:])


def read_hostile(data):
    """Describe and decode a stream, each None if it is refused; other errors are not caught."""
    described = decoded = None
    with suppress(MeshReelError), ReelFile(BytesIO(data), memory=MEMORY) as reel:
        described = reel.info()
    with suppress(MeshReelError):
        decoded = decode(data, memory=MEMORY)
    return described, decoded


@pytest.mark.parametrize(
    "name", ["key_blocks", "missing_values", "lossless_in_blocks", "paper_blocks"]
)
@pytest.mark.parametrize("beginning", [Section.BLOCK, Section.TRACK_BLOCK])
def test_a_second_beginning_of_an_indexed_group_is_refused(name, beginning):
    data = stored(name)
    stream = Stream(data)
    for section in stream.file.sections(stream.groups[0][0][0], stream.groups[-1][-1][1]):
        changed = bytearray(data)
        changed[section.offset] = beginning
        end = section.offset + section.size_bytes
        changed[end - 4 : end] = struct.pack("<I", zlib.crc32(changed[section.offset : end - 4]))
        for read in (info, decode):
            with pytest.raises(MeshReelError) if changed != data else nullcontext():
                read(bytes(changed))


def _mutate(payload, rng, *, keep_length=False):
    kind = 0 if keep_length else rng.integers(3)
    if kind == 0 and payload:
        for _ in range(rng.integers(1, 5)):
            payload[rng.integers(len(payload))] = rng.integers(256)
    elif kind == 1:
        del payload[rng.integers(len(payload) + 1) :]
    else:
        payload += rng.bytes(rng.integers(1, 20))


LATE = {
    "a block": lambda block: block,
    "the beginning of a block": lambda block: write_sections([(Section.BLOCK, b"\2\1")])[0],
    "a second index": lambda block: write_sections([(Section.INDEX, b"\x50\1\2\x26")])[0],
    "an optional section": lambda block: write_sections([(Section.START, bytes(8))])[0],
    "an optional section of a later version": lambda block: bytes([200, 0, 0xB9, 0x4F, 0xFA, 0x42]),
}
"""Sections that follow INDEX, from the bytes of a block."""


@pytest.mark.parametrize("name", LATE)
def test_only_the_end_may_follow_the_index(name, tmp_path):
    data = stored("sheet")
    (((begin, end),),) = Stream(data).groups
    late = LATE[name](data[begin:end])
    hostile = data[:-END_BYTES] + late + data[-END_BYTES:]
    for read in (decode, info):
        with pytest.raises(CorruptStreamError, match="a section follows the index"):
            read(hostile)
    with pytest.raises(DamagedError, match="a section follows INDEX"):
        plain.read(hostile)
    path = tmp_path / "late.reel"
    for size in (len(hostile), len(hostile) - END_BYTES):  # a recording without its end
        path.write_bytes(hostile[:size])
        with open_reel(path) as reel:
            assert not reel.is_whole
            assert reel.info().n_frames == reel.n_frames == 10
            np.testing.assert_array_equal(reel[:].vertices, decode(data).vertices)


def test_an_empty_file_is_truncated():
    with pytest.raises(TruncatedStreamError, match="ends inside its header"):
        decode(b"")


def without(stream, number):
    """Return a stream without its section of this number."""
    parts = parts_of(stream)
    return raw_stream(stream.header, parts[:number] + parts[number + 1 :])


def replaced(stream, changed, payload):
    """Return the parts of a stream with this payload in all sections of an id."""
    return [(section, payload if section is changed else own) for section, own in parts_of(stream)]


def referring_to(stream, number, reference, stencil_size=None):
    """Return a stream of `reel` with another reference of the block of this number."""
    layout = layout_of(stream.block(number), stream.file.block(number).n_frames)
    changes = {"reference": reference, "stencil_size": stencil_size or layout.stencil_size}
    return with_layout(stream, number, replace(layout, **changes))


def with_layout(stream, number, layout):
    """Return a stream of `reel` with another layout of the block of this number."""
    parts, n_blocks = [], -1
    for section, payload in parts_of(stream):
        n_blocks += section is Section.BLOCK
        is_changed = section is Section.FIELDS and n_blocks == number
        parts.append((section, write_layout(layout) if is_changed else payload))
    return raw_stream(stream.header, parts)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ((2, 1), "refers to a block that is not a key block"),
        ((2, 3), "refers to one before the first"),
        ((2, 2**60), "refers to one before the first"),
        ((0, 1), "refers to one before the first"),
        ((1, 1, 3), "refers to a block that is not a key block"),
    ],
)
def test_invalid_references_are_refused(changes, message):
    stream = Stream(encode(waving_grid(9, 4, 5), step=0.003, block_frames=3))
    with pytest.raises(CorruptStreamError, match=message):
        decode(referring_to(stream, *changes))


@pytest.mark.parametrize("n_reused", [6, 2**40])
def test_more_reused_fields_than_modes_are_refused(n_reused):
    data = stored("reused_fields")
    stream = Stream(data)
    number, layout = next(
        (number, layout) for number, layout in enumerate(layouts(data)) if layout.n_reused
    )
    with pytest.raises(CorruptStreamError, match="reused fields"):
        decode(with_layout(stream, number, replace(layout, n_reused=n_reused)))


def test_a_block_without_its_reference_decodes():
    stream = Stream(STREAMS["reel"])
    assert decode(referring_to(stream, 1, 0)).n_frames == 5


def test_the_corrected_stream_contains_corrections():
    """Otherwise the tests above would prove nothing."""
    stream = Stream(STREAMS["reel corrected"])
    sizes = [len(data) for section, data in parts_of(stream) if section is Section.CORRECTIONS]
    assert len(sizes) == 2
    assert min(sizes) > 12


def test_corrections_and_error_bound_are_optional():
    """An attacker may remove them without breaking anything else."""
    stream = Stream(STREAMS["reel corrected"])
    for number, (section, _) in enumerate(parts_of(stream)):
        if section in (Section.CORRECTIONS, Section.ERROR_BOUND):
            decoded = decode(without(stream, number))
            np.testing.assert_array_equal(decoded.faces, irregular_sequence(4).faces)


def test_a_wrong_number_of_corrections_allocates_nothing():
    """Announced numbers are checked against the block before allocation."""
    stream = Stream(STREAMS["reel corrected"])
    wrong = struct.pack("<f", 0.5) + write_varint(3) + write_varint(2**50)
    data = raw_stream(stream.header, replaced(stream, Section.CORRECTIONS, wrong))
    with pytest.raises(CorruptStreamError, match="more corrections than values"):
        decode(data)


@pytest.mark.parametrize("name", ["reel", "materials", "on a grid", "grid", "rows"])
def test_positions_that_are_not_finite_are_refused(name, tmp_path):
    stream = Stream(STREAMS[name])
    header = replace(stream.header, scale=1e200)
    path = tmp_path / "huge.reel"
    path.write_bytes(raw_stream(header, parts_of(stream)))
    with pytest.raises(CorruptStreamError, match="not finite"):
        decode(path.read_bytes())
    with open_reel(path) as reel, pytest.raises(CorruptStreamError, match="not finite"):
        reel[0]
