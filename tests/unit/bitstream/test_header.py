import struct
import zlib
from dataclasses import replace

import pytest

from meshreel.bitstream.header import Header, read_header, write_header
from meshreel.bitstream.layout import MAX_NAME_BYTES, VertexType
from meshreel.errors import CorruptStreamError, TruncatedStreamError, UnsupportedVersionError

HEADER = Header(175, 9971, 19938, 29.97, VertexType.FLOAT32, 0, 1, 2, (1.0, -2.0, 3e6), 0.5, "änne")


def test_header_comes_back_when_written():
    data = write_header(HEADER)
    assert read_header(data + b"rest") == (HEADER, len(data))


@pytest.mark.parametrize("start", ["", "x"])
def test_name_is_cut_between_characters_when_it_is_too_long(start):
    long = replace(HEADER, name=start + "ä" * MAX_NAME_BYTES)
    kept = "ä" * ((MAX_NAME_BYTES - len(start)) // 2)
    assert read_header(write_header(long))[0].name == start + kept


def test_reading_raises_when_the_data_end_anywhere_inside():
    data = write_header(HEADER)
    for size in range(len(data)):
        with pytest.raises(TruncatedStreamError):
            read_header(data[:size])


def test_reading_says_so_when_the_file_is_of_another_program():
    with pytest.raises(CorruptStreamError, match=r"not a \.reel stream: it starts with 50 4b"):
        read_header(b"PK\x03\x04" + bytes(100))


def test_reading_asks_for_an_upgrade_when_the_version_is_newer():
    data = bytearray(write_header(HEADER))
    data[8] = 4
    with pytest.raises(UnsupportedVersionError, match="format 4; this build reads format 3"):
        read_header(bytes(data))


@pytest.mark.parametrize("version", [1, 2])
def test_reading_says_what_to_do_when_the_version_is_older_than_the_first_release(version):
    data = bytearray(write_header(HEADER))
    data[8] = version
    with pytest.raises(UnsupportedVersionError, match=f"format {version}.*encode the original"):
        read_header(bytes(data))


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
def test_reading_raises_when_a_field_is_impossible(change):
    with pytest.raises(CorruptStreamError):
        read_header(write_header(replace(HEADER, **change)))


def test_reading_raises_when_the_vertex_type_is_unknown():
    data = bytearray(write_header(HEADER)[:-4])
    data[30] = 5
    with pytest.raises(CorruptStreamError, match="vertex type 5"):
        read_header(bytes(data) + struct.pack("<I", zlib.crc32(data)))
