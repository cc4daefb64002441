"""Files of very many segments, and of segments that contradict themselves."""

from dataclasses import replace
from functools import cache
from io import BytesIO

import numpy as np
import pytest

import meshreel
from conformance.bits import DamagedError
from conformance.reader import read_all
from conformance.segments import TETRAHEDRON
from conformance.sources import grid, moving
from meshreel.codec.bitstream.container import (
    write_header,
    write_sections,
    write_segment,
    write_varint,
)
from meshreel.codec.bitstream.layout import INDEX_POSITION, Section
from meshreel.codec.joining import blocks_of, header_of, join_streams, leading_of
from meshreel.codec.open_stream import whole_stream
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import (
    CorruptStreamError,
    MemoryLimitError,
    TruncatedStreamError,
    UnsupportedVersionError,
)
from meshreel.kernel.files import OpenFile
from samples.c_reader import Code, File, Host, by_calls, refusal
from samples.costs import draws

MANY = draws(5000)
END = write_sections([(Section.END, b"")])[0]
LARGEST = 2**63 - 1
"""Largest integer of 9 bytes."""


def encoded(*sections):
    return b"".join(write_sections(list(sections)))


def numbers(*values):
    return b"".join(map(write_varint, values))


@cache
def parts():
    """Return the header, sections before the block, and block of a tetrahedron at one frame."""
    opened = whole_stream(meshreel.encode(moving(TETRAHEDRON, 1)))
    ((_, block),) = blocks_of(opened)
    return header_of(opened), tuple(leading_of(opened)), encoded(*block)


@cache
def first_segment():
    """Return header and leading sections of the first segment, of any number of frames."""
    header, leading, _ = parts()
    return write_header(replace(header, n_frames=0)) + encoded(*leading)


def beginning(*leading):
    """Return SEGMENT and leading sections of a further tetrahedron."""
    header = parts()[0]
    return encoded((Section.SEGMENT, write_segment(header, header)), *leading)


def indexed(further, *entries):
    """Return a file of a tetrahedron, bytes of further segments, and their entries of the index."""
    data, block = first_segment(), parts()[2]
    index = numbers(len(data), 1, 1, len(block)) + b"".join(entries)
    data += block + further
    return data + encoded((Section.INDEX, index), (Section.END, INDEX_POSITION.pack(len(data))))


def scanned(further, end=END):
    """Return the same without an index."""
    return first_segment() + parts()[2] + further + end


def whole(n=MANY):
    """Return bytes and index entries of n complete segments, which refer to the first."""
    begin, block = beginning(*parts()[1]), parts()[2]
    entry = numbers(4, 4, 1, len(begin), 1, 1, len(block))
    return n * (begin + block), n * entry


def references(n=MANY, n_shared=255):
    """Return segments that refer to all sections of one with many sections."""
    images = n_shared * [(Section.IMAGE, b"\0\0")]
    first = beginning(*parts()[1], *images) + parts()[2]
    further = (
        beginning((Section.REFERENCE, numbers(distance, 0, n_shared))) + parts()[2]
        for distance in range(1, n + 1)
    )
    return first + b"".join(further)


def with_overflow(entry):
    """Return an entry of three blocks instead of one; the sum of their sizes overflows to its."""
    return entry[:4] + numbers(3, 1, LARGEST, 1, LARGEST, 1, len(parts()[2]) + 2)


BAD_PLACE = "a section is longer than the index or the blocks allow"
TOO_MANY = "more than 2\\^28 frames"
NO_INDEX = "the index contradicts the blocks"

REFUSED = {
    "no blocks": (lambda: scanned(MANY * beginning()), "a segment is out of place"),
    "no blocks in the index": (
        lambda: indexed(MANY * beginning(), MANY * numbers(4, 4, 1, 18, 0)),
        "a segment is out of place",
    ),
    "one byte each": (
        lambda: indexed(MANY * b"\5", MANY * numbers(4, 4, 1, 0, 1, 1, 1)),
        BAD_PLACE,
    ),
    "leading sections past the blocks": (
        lambda: indexed(whole(1)[0], numbers(4, 4, 1, 5, 1, 1, len(whole(1)[0]) - 5)),
        BAD_PLACE,
    ),
    "2^28 frames each": (
        lambda: indexed(b"\5" * MANY, MANY * numbers(4, 4, 1, 0, 1, 2**28, 1)),
        TOO_MANY,
    ),
    "2^31 frames": (
        lambda: indexed(b"\5", numbers(4, 4, 1, 0, 1, 2**31, 1)),
        "more frames than this build reads",
    ),
    "2^28 + 1 frames in two blocks": (
        lambda: indexed(b"\5\5", numbers(4, 4, 1, 0, 2, 2**28, 1, 1, 1)),
        "more frames than this build reads",
    ),
    "2^31 frames in a block": (
        lambda: scanned(beginning() + encoded((Section.BLOCK, numbers(2**31, 1)))),
        "more frames than this build reads",
    ),
    "2^27 vertices": (
        lambda: indexed(b"\5", numbers(2**27, 4, 1, 0, 1, 1, 1)),
        "more than 2\\^26 vertices or faces",
    ),
    "blocks without end": (
        lambda: indexed(whole(1)[0], numbers(4, 4, 1, 24, LARGEST), numbers(1, 1)),
        NO_INDEX,
    ),
    "blocks of all sizes": (
        lambda: indexed(whole(1)[0], numbers(4, 4, 1, LARGEST, 1, 1, LARGEST)),
        NO_INDEX,
    ),
    "blocks whose sizes overflow": (
        lambda: indexed(whole(1)[0], with_overflow(whole(1)[1])),
        NO_INDEX,
    ),
    "section behind times": (
        lambda: indexed(encoded((Section.TIMES, b"\0" + bytes(8)), (0xF0, b""))),
        "a section follows the index or the times",
    ),
    "2^20 tracks": (lambda: indexed(whole(1)[0], numbers(4, 4, 2**20, 24, 1, 1, 1)), NO_INDEX),
    "more tracks than numbers": (
        lambda: indexed(whole(1)[0], numbers(4, 4, LARGEST, 24, 1, 1, 1)),
        NO_INDEX,
    ),
    "index of 10 bytes": (
        lambda: indexed(whole(1)[0], numbers(4, 4, 1, 24, 1) + b"\xff" * 10),
        NO_INDEX,
    ),
    "three ranges": (
        lambda: scanned(
            beginning((Section.REFERENCE, numbers(1, 0, 1, 1, 1, 1, 1, 2, 1))) + parts()[2]
        ),
        "a reference has more than two ranges",
    ),
    "truncated": (lambda: scanned(whole()[0], b""), "the file ends too early"),
}  # fmt: skip
KINDS = {
    Code.CORRUPT: CorruptStreamError,
    Code.TRUNCATED: TruncatedStreamError,
    Code.UNSUPPORTED: UnsupportedVersionError,
}


def open_all(data, host):
    """Open all segments up to the first that is refused; raise the damage of an incomplete file."""
    with File(data, host, mesh=False) as file:
        if not file.info.is_whole:
            return file.info.damage.code, file.info.damage.message.decode()
        for number in range(file.info.n_segments):
            file.open_segment(number).close()
    return None


def read_file(data):
    with ReelFile(BytesIO(data)) as file:
        file.require_whole()
        list(file)


@pytest.mark.parametrize("name", REFUSED)
def test_every_call_names_what_is_wrong(name):
    make, message = REFUSED[name]
    data, host, result = make(), Host(), []
    refused = refusal(lambda: result.append(open_all(data, host)))
    code, text = result[0] if refused is None else (refused.code, str(refused))
    assert not host.held
    with pytest.raises(KINDS[code], match=message):
        meshreel.info(data)
    with pytest.raises(KINDS[code], match=message):
        meshreel.decode(data)
    with pytest.raises(KINDS[code], match=message):
        read_file(data)
    if len(data) < 1000:
        with pytest.raises(DamagedError):
            read_all(data)
    assert message.replace("\\", "") in text


@pytest.mark.slow
@pytest.mark.parametrize("make", [indexed, scanned])
def test_many_segments_are_read(make):
    further, entries = whole()
    data = make(further, entries) if make is indexed else make(further)
    expected = meshreel.decode(meshreel.encode(moving(TETRAHEDRON, 1)))
    info = meshreel.info(data)
    assert (info.n_frames, len(info.segments), info.size_bytes) == (1 + MANY, 1 + MANY, len(data))
    assert sum(info.budget_bytes.values()) == len(data)
    decoded = meshreel.decode(data, frames=slice(MANY - 9, MANY))
    with ReelFile(BytesIO(data)) as file:
        assert file.starts == tuple(range(2 + MANY))
        for number in (MANY, 0, MANY // 2):
            np.testing.assert_array_equal(file[number].vertices, expected.vertices[0])
    assert all(
        np.array_equal(segment.read(0, 1), expected.vertices) for segment in decoded.segments
    )


def test_an_index_is_read_by_few_calls_however_long_it_is():
    counts = []
    for n in (1, MANY):
        ranges = []
        source = by_calls(indexed(*whole(n)), lambda *place, r=ranges: r.append(place) or True)
        with File(source, mesh=False) as file:
            assert file.info.n_segments == 1 + n
        pages = (ranges[-1][1] - ranges[-1][0]) / 4096  # checksums are computed page by page
        counts.append(len(ranges) - pages)
    assert counts[1] - counts[0] < 4 + len(whole()[1]) / 4096


@pytest.mark.slow
def test_references_to_many_sections_are_read():
    n = draws(1000)
    data = scanned(references(n))
    info = meshreel.info(data)
    assert (len(info.segments), len(info.images)) == (n + 2, 255)
    assert info.raw_size_bytes == (n + 2) * 4 * 3 * (4 + 4)
    decoded = meshreel.decode(data)
    one, other = decoded.segments[2], decoded.segments[-1]
    assert one.surface.images[5] is other.surface.images[5]
    assert np.shares_memory(one.faces, other.faces)


@pytest.mark.slow
def test_shared_meshes_count_once_against_the_memory_limit(monkeypatch):
    frames = [moving(grid(20, 20), 1, seed=number) for number in range(10)]
    data = join_streams(20 * [meshreel.encode(frame, lossless=True) for frame in frames])
    mesh, positions = frames[0].faces.nbytes, frames[0].vertices.nbytes
    needed = mesh + 200 * positions
    assert meshreel.info(data).raw_size_bytes == 200 * (mesh + positions)
    assert len(meshreel.decode(data, memory=needed).segments) == 200
    with pytest.raises(MemoryLimitError, match="200 segments"):
        meshreel.decode(data, memory=needed - 1)
    monkeypatch.setattr(OpenFile, "segment", lambda *_: pytest.fail("a segment is opened"))
    with pytest.raises(MemoryLimitError, match="200 segments"):
        meshreel.decode(data, memory=200 * positions - 1)


@pytest.mark.slow
def test_a_sequence_of_many_tiny_meshes_is_encoded_and_decoded():
    rng = np.random.default_rng(4)
    meshes = [np.array(TETRAHEDRON), np.array(TETRAHEDRON)[:, [0, 2, 1]]]
    vertices = rng.random((draws(500), 4, 3)).astype(np.float32)
    sequence = meshreel.MeshSequence.of_segments(
        [meshreel.MeshSequence(vertex[None], meshes[i % 2]) for i, vertex in enumerate(vertices)]
    )
    data = meshreel.encode(sequence, lossless=True)
    info = meshreel.info(data)
    assert len(info.segments) == len(vertices)
    assert info.part_bytes["container"] < 60 * len(vertices)
    for i, ((decoded, faces), given) in enumerate(
        zip(meshreel.decode(data), vertices, strict=True)
    ):
        np.testing.assert_array_equal(decoded, given)
        np.testing.assert_array_equal(faces, meshes[i % 2])
