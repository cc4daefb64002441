import struct
import zlib
from dataclasses import replace
from io import BytesIO

import pytest

from meshreel.codec.bitstream.container import (
    MAX_COMPACT,
    BlockEntry,
    Header,
    StreamWriter,
    read_varint,
    write_header,
    write_index,
    write_number,
    write_sections,
    write_stream,
    write_varint,
)
from meshreel.codec.bitstream.layout import (
    INDEX_POSITION,
    MAX_NAME_BYTES,
    OPTIONAL,
    Section,
    VertexType,
)
from meshreel.errors import CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
from samples.streams import Stream, not_compact, parts_of, raw_stream

HEADER = Header(2, 3, 1, 0.0, VertexType.FLOAT64, 0, 0, 0, (0.0, 0.0, 0.0), 1.0)
LEADING = [(Section.CONNECTIVITY, b"abc")]
BLOCKS = [
    (1, [(Section.BLOCK, b"\1\1"), (Section.BASIS, b"first"), (Section.COEFFICIENTS, b"12")]),
    (1, [(Section.BLOCK, b"\1\1"), (Section.BASIS, b""), (Section.COEFFICIENTS, b"3")]),
]
SECTIONS = [*LEADING, *BLOCKS[0][1], *BLOCKS[1][1]]
DATA = write_stream((HEADER, LEADING, BLOCKS))
UNCOUNTED = replace(HEADER, n_frames=0)
(FIRST_START, FIRST_END), (SECOND_START, BLOCKS_END) = (group[0] for group in Stream(DATA).groups)
FIRST, SECOND = FIRST_END - FIRST_START, BLOCKS_END - SECOND_START


def section(number, payload):
    return write_sections([(number, payload)])[0]


def ended(data, index):
    """Append an index and its end marker."""
    position = INDEX_POSITION.pack(len(data))
    return data + section(Section.INDEX, index) + section(Section.END, position)


def test_sections_are_read_in_written_order():
    stream = Stream(DATA)
    assert stream.header == HEADER
    assert parts_of(stream) == SECTIONS
    assert [number for number, _ in stream.sections][-2:] == [Section.INDEX, Section.END]


def test_sizes_of_header_and_sections_sum_to_the_whole():
    stream = Stream(DATA)
    parts = sum(section.size_bytes for section in stream.file.sections())
    assert parts + stream.header_size_bytes == stream.file.info.size_bytes == len(DATA)


@pytest.mark.parametrize("data", [DATA, raw_stream(HEADER, SECTIONS)], ids=["index", "none"])
def test_blocks_are_read_in_any_order_with_and_without_an_index(data):
    stream = Stream(data)
    assert stream.file.starts == [0, 1, 2]
    assert stream.file.info.is_whole
    for number in (1, 0, 1):
        assert list(stream.block(number).items()) == BLOCKS[number][1]


@pytest.mark.parametrize("size", range(len(DATA)))
def test_blocks_before_the_end_of_a_truncated_stream_are_readable(size):
    n_whole = (size >= FIRST_END) + (size >= BLOCKS_END)
    if n_whole == 0:
        with pytest.raises(TruncatedStreamError):
            Stream(DATA[:size])
        return
    stream = Stream(DATA[:size])
    assert not stream.file.info.is_whole
    assert stream.file.info.n_frames == n_whole
    assert list(stream.block(n_whole - 1).items()) == BLOCKS[n_whole - 1][1]
    assert parts_of(stream) == [*LEADING, *(one for _, block in BLOCKS[:n_whole] for one in block)]


def test_block_without_its_last_section_is_omitted():
    cut = raw_stream(UNCOUNTED, SECTIONS[:-1])[: -len(section(Section.END, b""))]
    assert Stream(cut).file.info.n_frames == 1


def test_blocks_before_damage_are_readable_without_an_index():
    data = bytearray(DATA)
    data[SECOND_START + 3] ^= 1
    data[-1] ^= 1
    info = Stream(bytes(data)).file.info
    assert (info.n_frames, info.is_whole) == (1, False)


def test_damaged_block_in_the_index_is_refused():
    data = bytearray(DATA)
    data[SECOND_START + 3] ^= 1
    stream = Stream(bytes(data))
    assert stream.block(0)
    with pytest.raises(CorruptStreamError, match=f"checksum.*byte {SECOND_START}"):
        stream.block(1)


def test_index_entry_that_points_to_an_unknown_section_is_refused():
    before = write_header(HEADER) + section(*LEADING[0])
    unknown = unknown_section(OPTIONAL | 0x40)
    index = write_index([BlockEntry(2, len(before), (len(unknown),))])
    stream = Stream(ended(before + unknown, index))
    assert stream.file.block(0).n_frames == 2
    with pytest.raises(CorruptStreamError, match="a block does not end with COEFFICIENTS"):
        stream.file.group(0)


def test_frames_are_counted_without_a_number_in_the_header():
    assert Stream(write_stream((UNCOUNTED, LEADING, BLOCKS))).file.info.n_frames == 2


INDEX = dict(Stream(DATA).sections)[Section.INDEX]
END = section(Section.END, b"\0" * 8)

CONTRADICTIONS = {
    "frames of the header": write_stream((replace(HEADER, n_frames=3), LEADING, BLOCKS)),
    "too long": ended(DATA[:BLOCKS_END], INDEX + b"\1"),
    "place of the index": DATA[: -len(END)] + END,
    **{
        name: ended(
            DATA[:BLOCKS_END],
            write_index([BlockEntry(frames, FIRST_START, (size,)) for frames, size in places]),
        )
        for name, places in {
            "shorter": [(1, FIRST - 1), (1, SECOND)],
            "more frames": [(1, FIRST), (2, SECOND)],
            "no frames": [(2, FIRST), (0, SECOND)],
            "no bytes": [(2, FIRST + SECOND), (0, 0)],
        }.items()
    },
}


@pytest.mark.parametrize("data", CONTRADICTIONS.values(), ids=CONTRADICTIONS)
def test_index_that_contradicts_the_blocks_is_refused(data):
    with pytest.raises(CorruptStreamError, match="the index contradicts the blocks"):
        Stream(data)


def test_file_of_an_unfinished_writer_is_readable():
    file = BytesIO()
    writer = StreamWriter(file)
    writer.begin_segment(UNCOUNTED, LEADING)
    for n_written, block in enumerate(BLOCKS, start=1):
        writer.write_block(*block)
        assert Stream(file.getvalue()).file.info.n_frames == n_written


def test_blocks_are_written_to_the_file_immediately(tmp_path):
    with (tmp_path / "live.reel").open("wb", buffering=1 << 20) as file:
        writer = StreamWriter(file)
        writer.begin_segment(UNCOUNTED, LEADING)
        for n_written, block in enumerate(BLOCKS, start=1):
            writer.write_block(*block)
            assert Stream((tmp_path / "live.reel").read_bytes()).file.info.n_frames == n_written
        writer.finish()
        assert Stream((tmp_path / "live.reel").read_bytes()).file.info.is_whole


@pytest.mark.parametrize("header", [HEADER, UNCOUNTED])
def test_stream_without_blocks_is_refused(header):
    with pytest.raises(CorruptStreamError, match="no block of frames"):
        Stream(raw_stream(header, LEADING))


def unknown_section(number):
    body = bytes([number, 2]) + b"??"
    return body + struct.pack("<I", zlib.crc32(body))


def behind_header(unknown):
    header = write_header(HEADER)
    return header + unknown + raw_stream(HEADER, SECTIONS)[len(header) :]


def test_unknown_optional_section_is_skipped():
    stream = Stream(behind_header(unknown_section(OPTIONAL | 77)))
    assert next(stream.file.sections()).is_known is False
    assert parts_of(stream) == SECTIONS


def test_unknown_required_section_is_refused():
    start = len(write_header(HEADER))
    with pytest.raises(UnsupportedVersionError, match=f"newer version.*byte {start}"):
        Stream(behind_header(unknown_section(77)))


@pytest.mark.parametrize("counts", [{"n_verts": 2**26}, {"n_faces": 2**26}, {}])
def test_large_counts_take_few_bytes(counts):
    many = replace(UNCOUNTED, **counts)
    sections = [(Section.BLOCK, b"\xc0\x84\x3d\1"), (Section.COEFFICIENTS, b"")]
    data = write_stream((many, LEADING, [(10**6, sections)]))
    assert len(data) < 300
    assert Stream(data).header == many


FULL_HEADER = Header(
    175, 9971, 19938, 29.97, VertexType.FLOAT32, 0, 1, 2, (1.0, -2.0, 3e6), 0.5, "änne"
)


def stream_of(header):
    block = [(Section.BLOCK, b"\xaf\1\1"), (Section.COEFFICIENTS, b"")]
    return write_stream((header, [], [(175, block)]))


with not_compact():
    BEHIND = stream_of(FULL_HEADER)[len(write_header(FULL_HEADER)) :]


FORM_AT = 9 + 2 + 2 + 3 + 9 + 1
"""Magic, version, counts, rate and method precede it."""


def with_byte(position, value):
    """A stream with a changed byte in its header and a valid checksum."""
    header = bytearray(write_header(FULL_HEADER)[:-4])
    header[position] = value
    return bytes(header) + struct.pack("<I", zlib.crc32(header)) + BEHIND


def test_header_round_trips():
    assert Stream(stream_of(FULL_HEADER)).header == FULL_HEADER


@pytest.mark.parametrize("start", ["", "x"])
def test_long_name_is_truncated_between_characters(start):
    long = replace(FULL_HEADER, name=start + "ä" * MAX_NAME_BYTES)
    kept = "ä" * ((MAX_NAME_BYTES - len(start)) // 2)
    assert Stream(stream_of(long)).header.name == start + kept


OLDER = "older than the first release; encode the original again"
NEWER = "format version is not 3; update meshreel"
INVALID = [
    *(("n_verts", 0), ("n_faces", 0), ("fps", float("nan")), ("fps", -1.0), ("scale", 0.0)),
    *(("scale", float("inf")), ("origin", (0.0, float("nan"), 0.0))),
]
REFUSED = {
    "another program": (b"PK\x03\x04" + bytes(100), CorruptStreamError, r"not a \.reel stream"),
    "version 1": (with_byte(8, 1), UnsupportedVersionError, OLDER),
    "version 2": (with_byte(8, 2), UnsupportedVersionError, OLDER),
    "version 4": (with_byte(8, 4), UnsupportedVersionError, NEWER),
    "version 0": (with_byte(8, 0), UnsupportedVersionError, NEWER),
    "version 127": (with_byte(8, 127), UnsupportedVersionError, NEWER),
    "version 128": (with_byte(8, 128), UnsupportedVersionError, "is experimental; decode it with"),
    "form": (with_byte(FORM_AT, 128), UnsupportedVersionError, "needs a newer version"),
    **{
        f"{name} {value}": (
            stream_of(replace(FULL_HEADER, **{name: value})),
            CorruptStreamError,
            None,
        )
        for name, value in INVALID
    },
}


@pytest.mark.every_case
@pytest.mark.parametrize("name", REFUSED)
def test_invalid_header_is_refused_with_a_remedy(name):
    data, error, words = REFUSED[name]
    with pytest.raises(error, match=words):
        Stream(data)


@pytest.mark.parametrize("value", [0, 1, 127, 128, 300, 2**32, 2**63 - 1])
def test_varints_round_trip(value):
    data = b"x" + write_varint(value) + b"y"
    assert read_varint(data, 1) == (value, len(data) - 1)


def test_truncated_varint_is_refused():
    with pytest.raises(TruncatedStreamError):
        read_varint(write_varint(2**40)[:-1], 0)


def test_too_long_varint_is_refused():
    with pytest.raises(CorruptStreamError, match="longer than 9 bytes"):
        read_varint(b"\xff" * 20, 0)


def test_small_stream_of_one_block_has_one_checksum():
    header = replace(FULL_HEADER, n_frames=1)
    data = write_stream((header, LEADING, BLOCKS[:1]))
    n_sections = len(LEADING) + len(BLOCKS[0][1])
    usual = raw_stream(header, [*LEADING, *BLOCKS[0][1]])
    assert len(data) == len(usual) - 4 * (1 + n_sections)
    stream = Stream(data)
    assert stream.header == header
    assert parts_of(stream) == [*LEADING, *BLOCKS[0][1]]
    for position in range(len(data)):
        with pytest.raises((CorruptStreamError, UnsupportedVersionError)):
            Stream(data[:position] + bytes([data[position] ^ 4]) + data[position + 1 :])
        with pytest.raises(CorruptStreamError):
            Stream(data[:position])


@pytest.mark.parametrize("n_more", [0, 1])
def test_longer_streams_have_a_checksum_of_each_section(n_more):
    header = replace(HEADER, n_frames=1)
    size = MAX_COMPACT - len(write_stream((header, [], BLOCKS[:1]))) - 3
    filled = [(Section.CONNECTIVITY, bytes(size + n_more))]
    data = write_stream((header, filled, BLOCKS[:1]))
    assert (len(data) == MAX_COMPACT) == (n_more == 0)
    assert parts_of(Stream(data)) == [*filled, *BLOCKS[0][1]]


@pytest.mark.parametrize("value", [0.1, 0.01, 25.0, 1e-9, 1e22, 1 / 3, -2.5, 0.1 + 0.2, 5e-324])
def test_numbers_are_exact_in_at_most_8_bytes(value):
    payload = write_number(value)
    assert len(payload) <= 8
    data = raw_stream(HEADER, [(Section.START, payload), *SECTIONS])
    assert Stream(data).file.info.start_s == value


@pytest.mark.parametrize(("value", "size"), [(0.1, 2), (0.01, 2), (25.0, 2), (0.345, 3), (1e-9, 2)])
def test_short_decimals_take_few_bytes(value, size):
    assert len(write_number(value)) == size
