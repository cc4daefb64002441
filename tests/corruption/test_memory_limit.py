"""Small streams that announce enormous sizes are refused without allocating memory."""

import tracemalloc
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest

import meshreel
from conformance import reader as plain
from conformance.bits import DamagedError, Memory, TooLargeError
from meshreel.codec.bitstream.container import read_varint, write_varint
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import CorruptStreamError, InvalidInputError, MemoryLimitError, MeshReelError
from meshreel.kernel.files import OpenFile
from meshreel.model.surface import Attribute, Domain, Kind, Surface
from meshreel.model.tracks import Track
from samples.c_reader import Code, Decoder, File, Host, RefusalError
from samples.meshes import irregular_sequence, waving_grid
from samples.streams import Stream, parts_of, raw_stream

MANY = 2**40
"""Each stream below announces at least this many numbers."""

MAX_ALLOCATED_BYTES = 30e6
"""Allocations allowed before a refusal, mostly for imported code."""


def changed(data, change, **header):
    """Return the stream with changed payloads and header fields."""
    stream = Stream(data)
    parts = [(section, change(section, payload)) for section, payload in parts_of(stream)]
    return raw_stream(replace(stream.header, **header), parts)


def with_counts(data, n_frames, n_modes=None, **header):
    """Return the stream with other numbers of frames and modes in its block."""

    def change(section, payload):
        if section is not Section.BLOCK:
            return payload
        own, _ = read_varint(payload, read_varint(payload, 0)[1])
        return write_varint(n_frames) + write_varint(own if n_modes is None else n_modes)

    return changed(data, change, n_frames=n_frames, **header)


def with_track(**options):
    grid = waving_grid(4, 4, 5)
    tracks = {"still": Track(np.zeros((4, 20, 9), np.float32), "vertex", "other")}
    return encode(grid.replace(tracks=tracks), tracks=options or None)


def with_modes_of_track(n_frames, n_modes):
    def change(section, payload):
        return write_varint(n_modes) if section is Section.TRACK_BLOCK else payload

    return with_counts(changed(with_track(), change), n_frames, 1)


def with_corrections():
    data = encode(irregular_sequence(4), max_error=8.0, n_modes=2)
    n_verts = Stream(data).header.n_verts
    n_frames = 2**30

    def change(section, payload):
        if section is not Section.CORRECTIONS:
            return payload
        return payload[:4] + write_varint(n_verts) + write_varint(n_frames * n_verts)

    # The frames fit the limit of a block with two modes, and are not decoded before the refusal.
    return with_counts(changed(data, change), n_frames, 2)


def with_table():
    grid = waving_grid(2, 4, 5)
    uv = Attribute(
        "uv",
        Kind.UV,
        Domain.VERTEX,
        np.zeros((2, 2), np.float32),
        np.arange(20, dtype=np.int32) % 2,
    )
    data = encode(grid.replace(surface=Surface(attributes=(uv,))))

    def change(section, payload):
        if section is not Section.ATTRIBUTE:
            return payload
        at = 4 + 1 + len("uv") + 1  # after kind to width, name and layout
        _, end = read_varint(payload, at)
        return payload[:at] + write_varint(MANY) + payload[end:]

    return changed(data, change)


REEL = encode(waving_grid(4, 4, 5), step=0.01)
BOMBS = {
    "vertices": with_counts(REEL, 4, n_verts=2**32 - 1),
    "faces": with_counts(REEL, 4, n_faces=2**32 - 1),
    "frames": with_counts(REEL, 2**32 - 1),
    "modes": with_counts(REEL, 2**28, 3 * 2**28),
    "lossless": with_counts(encode(waving_grid(4, 4, 5), lossless=True), 2**32 - 1),
    "grid": with_counts(encode(waving_grid(4, 4, 5), "grid", max_error=0.1), 2**32 - 1),
    "paper": with_counts(encode(irregular_sequence(4), "pca-qp", n_modes=2), 2**32 - 1),
    "exact track": with_counts(with_track(still="exact"), 2**32 - 1),
    "modes of a track": with_modes_of_track(2**28, 2**31),
    "corrections": with_corrections(),
    "table": with_table(),
}


@pytest.mark.parametrize("name", BOMBS)
def test_announced_sizes_are_refused_before_allocation(name):
    data = BOMBS[name]
    assert len(data) < 3000
    tracemalloc.start()
    try:
        refusals = (
            r"may take 2\.15 GB; .* allow more with memory|2\^26|than this build reads|values"
        )
        with pytest.raises(MeshReelError, match=refusals):
            decode(data)
        assert tracemalloc.get_traced_memory()[1] < MAX_ALLOCATED_BYTES
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("name", BOMBS)
def test_the_plain_reader_refuses_announced_sizes(name):
    with pytest.raises(TooLargeError, match="larger Memory"):
        plain.read(BOMBS[name])


@pytest.mark.parametrize("name", sorted(set(BOMBS) - {"paper"}))
def test_the_c_library_refuses_announced_sizes_within_its_limit(name):
    host = Host(limit=2**20)
    assert refusal_of(BOMBS[name], host) in (Code.LIMIT, Code.CORRUPT, Code.UNSUPPORTED)
    assert host.largest <= 2 * 2**20  # file and decoder
    assert not host.held


def refusal_of(data, host=None):
    """Return the error code of the C library."""
    try:
        with File(data, host) as file:
            file.read_surface()
            with Decoder(file) as decoder:
                for track in range(file.info.n_tracks):
                    decoder.load(track, 0)
    except RefusalError as refused:
        return refused.code
    return Code.OK


def test_a_hierarchy_beyond_the_limit_is_refused_before_the_mesh_is_decoded():
    host = Host()
    assert refusal_of(with_counts(REEL, 4, n_verts=2**22), host) == Code.LIMIT
    assert host.largest < 1e5


LONG = waving_grid(40, 20, 20)
SCALARS = {
    f"track {i}": Track(np.full((40, 400, 1), i, np.float32), "vertex", "scalar") for i in range(9)
}
SUMS = {
    "tracks": (encode(LONG.replace(tracks=SCALARS), lossless=True), 900_000),
    "blocks": (encode(LONG, lossless=True, block_frames=20), 500_000),
}


@pytest.mark.parametrize("name", SUMS)
def test_parts_that_fit_one_by_one_are_refused_together_before_any_is_decoded(name, monkeypatch):
    data, limit = SUMS[name]
    with File(data, Host(limit=limit)) as file:
        for track, block in np.ndindex(file.info.n_tracks, file.info.n_blocks):
            with Decoder(file) as decoder:
                decoder.load(track, block)
    monkeypatch.setattr(OpenFile, "read_mesh", lambda _: pytest.fail("the mesh is decoded"))
    with pytest.raises(MemoryLimitError, match="decoding would take"):
        decode(data, memory=limit)
    with ReelFile(BytesIO(data), memory=limit) as reel, pytest.raises(MemoryLimitError):
        reel[:]


@pytest.mark.slow
def test_a_block_decodes_within_a_limit_that_the_whole_exceeds():
    data = encode(waving_grid(500, 8, 8), step=0.01, block_frames=5)
    limit = 300_000  # enough for the mesh and a block
    whole = decode(data)
    assert whole.vertices.nbytes > limit
    with pytest.raises(MemoryLimitError, match=r"frames 0:500 of 64 vertices would take 384 kB"):
        decode(data, memory=limit)
    decoded = decode(data, frames=slice(7, 12), memory=limit)
    np.testing.assert_array_equal(decoded.vertices, whole.vertices[7:12])
    with ReelFile(BytesIO(data), memory=limit) as reel:
        np.testing.assert_array_equal(reel[499].vertices, whole.vertices[499])
        for frame, expected in zip(reel, whole.vertices, strict=True):
            np.testing.assert_array_equal(frame.vertices, expected)
        with pytest.raises(MemoryLimitError, match="frames 0:500"):
            reel[:]


@pytest.mark.slow
def test_the_limit_covers_frames_and_tracks_together():
    grid = waving_grid(300, 4, 5)
    still = Track(np.zeros((300, 20, 9), np.float32), "vertex", "other")
    data = encode(grid.replace(tracks={"still": still}), block_frames=9)
    needed = 300 * 20 * (12 + 36)
    with pytest.raises(MemoryLimitError, match=r"with their tracks, would take 288 kB"):
        decode(data, memory=needed - 1)
    assert decode(data, memory=needed).n_frames == 300


@pytest.mark.parametrize("memory", ["lots", 0, -1, "0GB"])
def test_invalid_limits_are_refused(memory):
    with pytest.raises(InvalidInputError, match="memory"):
        meshreel.decode(REEL, memory=memory)


def test_the_limit_of_an_open_file_is_set_by_open():
    with (
        ReelFile(BytesIO(REEL)) as reel,
        pytest.raises(InvalidInputError, match=r"pass memory to meshreel\.open"),
    ):
        meshreel.decode(reel, memory="1GB")


@pytest.mark.parametrize("section", [Section.BASIS, Section.COEFFICIENTS, Section.CORRECTIONS])
def test_every_reader_refuses_trailing_zero_bytes(section):
    data = changed(
        encode(irregular_sequence(4), max_error=8.0, n_modes=2),
        lambda other, payload: payload + b"\0" if other is section else payload,
    )
    with pytest.raises(CorruptStreamError, match="end with a zero byte"):
        decode(data)
    with pytest.raises(DamagedError):
        plain.read(data, Memory())
    assert refusal_of(data) == Code.CORRUPT
