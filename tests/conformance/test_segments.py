"""Streams of several segments: what readers find in them, and how the decoder in C opens them."""

import numpy as np
import pytest

from conformance import segments
from conformance.bits import DamagedError
from conformance.by_core import given_by_core, read_all_by_core
from conformance.check import differences
from conformance.reader import read_all
from conformance.segments import FOLDER, REFUSED_FOLDER, STREAMS, meshes, one_frame_each
from meshreel.codec.bitstream.container import write_header
from meshreel.codec.decoder import decode
from meshreel.codec.joining import header_of, join_streams
from meshreel.codec.open_stream import whole_stream
from meshreel.errors import CorruptStreamError, InvalidInputError
from samples.c_reader import (
    DAMAGED,
    Code,
    Decoder,
    File,
    Host,
    by_calls,
    code_of,
    in_memory,
    refusal,
)

REFUSED_FILES = sorted(REFUSED_FOLDER.glob("*.reel"))


def stored(name):
    return (FOLDER / f"{name}.reel").read_bytes()


def everything_of(data, host=None, source=None):
    """Bits of all segments, by the decoder in C: triangles, and values of each track."""
    with File(source or in_memory(data), host, mesh=False) as whole:
        return [values_of(whole, number) for number in range(whole.info.n_segments)]


def values_of(whole, number):
    with whole.open_segment(number) as file:
        file.read_surface()
        tracks = range(file.info.n_tracks if file.info.method >= 7 else 0)
        return [file.triangles.tobytes(), *(file.values(track).tobytes() for track in tracks)]


def bits_of(stream):
    """The same of a stream of one segment, by the package."""
    sequence = decode(stream)
    values = sequence.vertices, *(track.values for track in sequence.tracks.values())
    return [one.tobytes() for one in (sequence.faces, *values)]


# ---- what is found ----


def test_every_stream_is_stored_with_what_it_holds():
    assert {path.stem for path in FOLDER.glob("*.reel")} == set(STREAMS)
    assert {path.stem for path in FOLDER.glob("*.json")} == set(STREAMS)
    assert {path.stem for path in REFUSED_FILES} == set(segments.REFUSED)


@pytest.mark.parametrize("name", STREAMS)
def test_readers_find_what_is_said_of_a_stream(name):
    assert differences(name, read_all, folder=FOLDER) == []
    assert differences(name, read_all_by_core, given_by_core, FOLDER) == []


def test_segments_hold_what_the_streams_held_that_were_joined():
    streams = meshes()
    data = join_streams(streams)
    assert everything_of(data) == list(map(bits_of, streams))
    assert everything_of(stored("two_meshes_no_index")) == everything_of(data)


def test_joining_one_stream_gives_the_same_stream():
    for stream in meshes():
        assert join_streams([stream]) == stream


def test_a_segment_of_one_frame_takes_less_than_its_own_header_took():
    streams = one_frame_each()
    own = [len(stream) - len(write_header(header_of(whole_stream(stream)))) for stream in streams]
    spent = len(join_streams(streams)) - len(streams[0]) - sum(own[1:])
    assert spent / len(streams[1:]) < 50


# ---- what is refused ----


@pytest.mark.parametrize("path", REFUSED_FILES, ids=lambda path: path.stem)
def test_every_reader_refuses_segments_that_break_a_rule(path):
    data = path.read_bytes()
    with pytest.raises((DamagedError, ValueError)):
        read_all(data)
    with pytest.raises(CorruptStreamError):
        read_all_by_core(data)
    host = Host()
    with_refusal = refusal(lambda: everything_of(data, host))
    if with_refusal is None:  # all that is there is complete
        with File(data, host, mesh=False) as file:
            assert not file.info.is_whole
            assert file.info.damage.code == Code.CORRUPT
    else:
        assert with_refusal.code == Code.CORRUPT
        assert 0 < with_refusal.offset < len(data)
    assert not host.held


def test_streams_that_cannot_be_joined_are_refused():
    first, second = meshes()
    with pytest.raises(InvalidInputError, match="no streams"):
        join_streams([])
    with pytest.raises(InvalidInputError, match="0 and 24 frames per second"):
        join_streams([first, one_frame_each()[0]])
    with pytest.raises(InvalidInputError, match="2 segments"):
        join_streams([join_streams([first, second]), first])


# ---- the decoder in C ----


def test_a_file_of_several_segments_is_not_decoded_as_one():
    with File(stored("two_meshes"), mesh=False) as file:
        info = file.info
        assert (info.n_segments, info.n_frames, info.fps, info.start_s) == (2, 9, 24.0, 1.5)
        assert (info.n_verts, info.n_triangles, info.n_blocks, info.n_tracks) == (0, 0, 0, 0)
        assert info.is_whole
        for act in (file.read_mesh, file.read_surface, lambda: Decoder(file)):
            assert code_of(act) == Code.SEGMENTS
        assert file.triangles is None
        for act in (lambda: file.track(0), lambda: file.block(0), lambda: file.group(0)):
            assert code_of(act) == Code.INVALID


def test_segments_tell_their_frames_meshes_and_bytes():
    data = stored("two_meshes")
    with File(data, mesh=False) as file:
        first, second = file.segments
        counts = [
            (one.first_frame, one.n_frames, one.n_verts, one.n_triangles) for one in file.segments
        ]
        assert counts == [(0, 5, 4, 4), (5, 4, 8, 12)]
        assert second.offset == first.offset + first.size
        assert data[second.offset] == 5  # SEGMENT
        assert data[second.offset + second.size] == 130  # INDEX
        assert [file.segment_of_frame(frame) for frame in range(9)] == [0] * 5 + [1] * 4
        assert code_of(lambda: file.segment(2)) == Code.INVALID
        assert code_of(lambda: file.open_segment(2)) == Code.INVALID


def test_an_open_segment_is_a_file_of_its_own():
    data, host = stored("two_meshes"), Host()
    with File(data, host, mesh=False) as whole:
        file = whole.open_segment(1)
        place = whole.segment(1)
    with file:  # the whole is closed
        info = file.info
        assert (info.n_segments, info.n_frames, info.n_verts, info.n_tracks) == (1, 4, 8, 2)
        assert (str(info.name), info.start_s, info.number_bytes) == ("two meshes", 1.5 + 5 / 24, 8)
        assert info.size == place.offset + place.size
        assert [file.block_of_frame(frame) for frame in range(4)] == [0] * 4
        assert file.block(0).first_frame == 0
        assert file.block(0, 1).offset + file.block(0, 1).size == info.size
        assert file.segment(0).first_frame == 5
        assert file.section(0).id == 5  # SEGMENT
        assert file.section(0).offset == place.offset
        assert code_of(lambda: file.section(info.size)) == Code.INVALID
        assert code_of(lambda: file.open_segment(0)) == Code.INVALID
    assert not host.held


def test_a_file_of_one_segment_can_be_opened_by_it_too():
    stream = meshes()[1]
    with File(stream) as file, file.open_segment(0) as segment:
        assert segment.values().tobytes() == file.values().tobytes()
        assert segment.info.size == file.info.size == len(stream)


def test_sections_of_the_whole_go_through_all_segments():
    data = stored("two_meshes")
    with File(data, mesh=False) as file:
        offset, found = 0, []
        while offset < len(data):
            section = file.section(offset)
            found.append(section.id)
            offset = section.offset + section.size
        assert found.count(5) == 1  # SEGMENT
        assert found.count(1) == 2  # CONNECTIVITY
        assert found[-2:] == [130, 0]


@pytest.mark.parametrize("name", ["two_meshes", "one_frame_each"])
def test_a_stream_that_is_cut_off_holds_all_complete_blocks(name):
    data = stored(name)
    with File(data, mesh=False) as file:
        ends = [one.offset + one.size for one in file.segments]
    wanted = everything_of(data)
    for size in range(ends[0], len(data)):
        with File(data[:size], mesh=False) as file:
            assert not file.info.is_whole
            n_complete = sum(end <= size for end in ends)
            assert n_complete <= file.info.n_segments <= n_complete + 1
            assert file.info.size <= size
            for number in range(n_complete):
                assert values_of(file, number) == wanted[number]
                with file.open_segment(number) as segment:
                    assert segment.info.is_whole or number + 1 == file.info.n_segments


def test_a_damaged_byte_is_found_or_changes_nothing():
    data, rng = stored("two_meshes"), np.random.default_rng(3)
    wanted = everything_of(data)
    for place in rng.choice(len(data), 150, replace=False):
        damaged = bytearray(data)
        damaged[place] ^= 1 << int(rng.integers(8))
        host = Host()
        found = []
        refused = refusal(lambda d=damaged, h=host, f=found: f.append(everything_of(bytes(d), h)))
        assert not host.held
        if refused is None:
            assert len(found[0]) <= 2
            for one, of_all in zip(found[0], wanted, strict=False):
                for values, all_values in zip(one, of_all, strict=True):
                    assert all_values.startswith(values)
        else:
            assert refused.code in DAMAGED


def test_every_allocation_may_fail_and_nothing_leaks():
    for name in ("two_meshes", "two_meshes_no_index"):
        data, host = stored(name), Host()
        wanted = everything_of(data, host)
        assert not host.held
        for number in range(host.n_allocations):
            failing = Host(fails_at=number)
            refused = refusal(lambda d=data, h=failing: everything_of(d, h))
            assert refused.code == Code.NO_MEMORY, number
            assert not failing.held, number
        assert everything_of(data, Host(), by_calls(data)) == wanted


def test_what_cannot_be_read_is_told_apart_from_damage():
    data = stored("two_meshes")
    for place in range(0, len(data), 3):
        source = by_calls(data, lambda begin, end, place=place: not begin <= place < end)
        host = Host()
        refused = refusal(lambda h=host, s=source: everything_of(data, h, s))
        assert refused.code == Code.UNREADABLE, place
        assert refused.offset <= place < refused.offset + refused.size
        assert not host.held


def test_many_segments_take_memory_in_proportion_and_a_limit_is_kept():
    count = 3000
    stream = one_frame_each()[0]
    data, host = join_streams([stream] * count), Host()
    with File(data, host, mesh=False) as file:
        assert file.info.n_segments == file.info.n_frames == count
        assert sum(host.held.values()) < 300 * count
        assert file.segment_of_frame(count - 1) == count - 1
        assert values_of(file, count - 1) == bits_of(stream)
    limited = Host(limit=50_000)
    refused = refusal(lambda: File(data, limited, mesh=False))
    assert (refused.code, refused.size > 50_000, limited.held) == (Code.LIMIT, True, {})
