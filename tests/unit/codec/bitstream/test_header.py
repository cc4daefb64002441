import struct
import zlib
from dataclasses import replace

import pytest

from meshreel.codec.bitstream.container import Header, write_header, write_stream
from meshreel.codec.bitstream.layout import MAX_NAME_BYTES, Section, VertexType
from meshreel.errors import CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
from samples.streams import Stream

HEADER = Header(175, 9971, 19938, 29.97, VertexType.FLOAT32, 0, 1, 2, (1.0, -2.0, 3e6), 0.5, "änne")


def stream_of(header):
    block = [(Section.BLOCK, b"\xaf\1\1"), (Section.COEFFICIENTS, b"")]
    return write_stream((header, [], [(175, block)]))


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
    "vertex type": (with_byte(30, 5), CorruptStreamError, "vertex type"),
    **{
        f"{name} {value}": (stream_of(replace(HEADER, **{name: value})), CorruptStreamError, None)
        for name, value in INVALID
    },
}


@pytest.mark.every_case
@pytest.mark.parametrize("name", REFUSED)
def test_invalid_header_is_refused_with_a_remedy(name):
    data, error, words = REFUSED[name]
    with pytest.raises(error, match=words):
        Stream(data)
