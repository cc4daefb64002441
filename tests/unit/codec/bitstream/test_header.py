import struct
import zlib
from dataclasses import replace

import pytest

from meshreel.codec.bitstream.container import Header, whole_stream, write_header
from meshreel.codec.bitstream.layout import MAX_NAME_BYTES, Section, VertexType
from meshreel.errors import CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
from samples.streams import Stream

HEADER = Header(175, 9971, 19938, 29.97, VertexType.FLOAT32, 0, 1, 2, (1.0, -2.0, 3e6), 0.5, "änne")


def stream_of(header):
    block = [(Section.BLOCK, b"\xaf\1\1"), (Section.COEFFICIENTS, b"")]
    return whole_stream(header, [], [(175, block)])


BEHIND = stream_of(HEADER)[len(write_header(HEADER)) :]


def with_byte(position, value):
    """A stream with a changed byte in its header and a valid checksum."""
    header = bytearray(write_header(HEADER)[:-4])
    header[position] = value
    return bytes(header) + struct.pack("<I", zlib.crc32(header)) + BEHIND


def test_header_round_trips():
    assert Stream(stream_of(HEADER)).header == HEADER


@pytest.mark.parametrize("start", ["", "x"])
def test_long_name_is_truncated_between_characters(start):
    long = replace(HEADER, name=start + "ä" * MAX_NAME_BYTES)
    kept = "ä" * ((MAX_NAME_BYTES - len(start)) // 2)
    assert Stream(stream_of(long)).header.name == start + kept


def test_truncated_header_is_refused():
    data = write_header(HEADER)
    for size in range(len(data)):
        with pytest.raises(TruncatedStreamError):
            Stream(data[:size])


def test_file_of_another_program_is_refused():
    with pytest.raises(CorruptStreamError, match=r"not a \.reel stream"):
        Stream(b"PK\x03\x04" + bytes(100))


@pytest.mark.parametrize(
    ("version", "remedy"),
    [
        (1, "older than the first release; encode the original again"),
        (2, "older than the first release; encode the original again"),
        (4, "format version is not 3; update meshreel"),
        (0, "format version is not 3; update meshreel"),
    ],
)
def test_error_for_a_newer_version_advises_an_upgrade(version, remedy):
    with pytest.raises(UnsupportedVersionError, match=remedy):
        Stream(with_byte(8, version))


@pytest.mark.parametrize(
    "change",
    [
        {"n_verts": 0},
        {"n_faces": 0},
        {"fps": float("nan")},
        {"fps": -1.0},
        {"scale": 0.0},
        {"scale": float("inf")},
        {"origin": (0.0, float("nan"), 0.0)},
    ],
)
def test_invalid_field_is_refused(change):
    with pytest.raises(CorruptStreamError):
        Stream(stream_of(replace(HEADER, **change)))


def test_unknown_vertex_type_is_refused():
    with pytest.raises(CorruptStreamError, match="vertex type"):
        Stream(with_byte(30, 5))
