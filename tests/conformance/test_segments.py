"""Streams of several segments: contents, refusals, and the C library."""

import numpy as np
import pytest

from conformance import segments
from conformance.bits import DamagedError
from conformance.by_core import read_all_by_core, reported_by_core
from conformance.check import differences
from conformance.container import read_container
from conformance.edit import read_mesh
from conformance.reader import read_all
from conformance.segments import (
    FOLDER,
    REFUSED_FOLDER,
    STREAMS,
    meshes,
    of_one_look,
    one_frame_each,
    returning,
    with_edit,
    without_end,
)
from meshreel.codec.bitstream.container import write_header
from meshreel.codec.decoder import decode
from meshreel.codec.joining import header_of, join_streams, separate_stream
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
from samples.streams import not_compact

CONNECTIVITY, SEGMENT, REFERENCE, ATTRIBUTE, MATERIAL, IMAGE = 1, 5, 6, 132, 136, 137
FROM_POINTS = 141
REFUSED_FILES = sorted(REFUSED_FOLDER.glob("*.reel"))


def stored(name):
    return (FOLDER / f"{name}.reel").read_bytes()


def everything_of(data, host=None, source=None):
    """Return triangles and track values of all segments, decoded by the C library."""
    with File(source or in_memory(data), host, mesh=False) as whole:
        return [values_of(whole, number) for number in range(whole.info.n_segments)]


def values_of(whole, number):
    with whole.open_segment(number) as file:
        file.read_surface()
        tracks = range(file.info.n_tracks if file.info.method >= 7 else 0)
        return [file.triangles.tobytes(), *(file.values(track).tobytes() for track in tracks)]


def bits_of(stream):
    """Return the same for a stream of one segment, decoded by the package."""
    sequence = decode(stream)
    values = sequence.vertices, *(track.values for track in sequence.tracks.values())
    return [array.tobytes() for array in (sequence.faces, *values)]


# ---- contents ----


def test_every_stream_is_stored_with_its_description():
    assert {path.stem for path in FOLDER.glob("*.reel")} == set(STREAMS)
    assert {path.stem for path in FOLDER.glob("*.json")} == set(STREAMS)
    assert {path.stem for path in REFUSED_FILES} == set(segments.REFUSED)


@pytest.mark.parametrize("name", STREAMS)
def test_readers_reproduce_the_description(name):
    assert differences(name, read_all, folder=FOLDER) == []
    assert differences(name, read_all_by_core, reported_by_core, FOLDER) == []


def test_segments_equal_the_joined_streams():
    streams = meshes()
    data = join_streams(streams)
    assert everything_of(data) == list(map(bits_of, streams))
    assert everything_of(stored("two_meshes_no_index")) == everything_of(data)


VERTEX_ROWS = ("verts_kept", "verts_dropped", "verts_new")
FACE_ROWS = ("kept", "dropped", "new")
EDITS = {
    "every kind of step": {
        "verts_kept": [5, 1],
        "verts_dropped": [0, 1],
        "verts_new": [0, 1],
        "kept": [3, 2, 1],
        "dropped": [1, 1, 2],
        "new": [0, 2, 2],
        "corners": [0, 7, -1, 0, -6, 1, 0, 1, 5, 0, -7, 1],
    },
    "all faces anew": {"kept": [0], "dropped": [12], "new": [12], "corners": [7, -7, 1, *33 * [0]]},
    "as many steps as allowed": {
        **{name: 16 * [0] for name in VERTEX_ROWS},
        **{name: 24 * [0] for name in FACE_ROWS},
    },
}
"""Edits of a box of 8 vertices and 12 faces that lead to a mesh of as many."""


def edit_with(rows):
    """Return the edit of a box with these rows; the counts of steps and faces follow from them."""
    n_steps = (len(rows.get(names[0], ())) for names in (VERTEX_ROWS, FACE_ROWS))
    return with_edit(8, 12, *n_steps, len(rows.get("corners", ())) // 3, **rows)


def one_off(rows):
    """Yield the rows with one number 1 smaller, 1 larger or huge, and with a step more."""
    for name, row in rows.items():
        for index in range(len(row)):
            for number in (row[index] - 1, row[index] + 1, 1 << 30):
                yield rows | {name: [*row[:index], number, *row[index + 1 :]]}
    for names in (VERTEX_ROWS, FACE_ROWS):
        yield rows | {name: [*rows.get(name, ()), 0] for name in names}


def plain_mesh(data):
    """Return internal faces, output faces and order, or None if the plain reader refuses them."""
    try:
        internal, _, order, faces = read_mesh(read_container(data))
    except DamagedError:
        return None
    return list(map(list, internal)), list(map(list, faces)), order


def mesh_of_core(data):
    """Return the same as `plain_mesh`, from the core."""
    try:
        file = whole_stream(data).file
        internal, order = file.stored_mesh
        return internal.tolist(), file.faces.tolist(), order.tolist()
    except CorruptStreamError:
        return None


@pytest.mark.slow
@pytest.mark.parametrize("name", EDITS)
def test_readers_agree_on_edits_whose_numbers_are_one_off(name):
    """The bounds of an edit: the core refuses what the plain reader refuses, and nothing else."""
    meshes_read = []
    for rows in (EDITS[name], *one_off(EDITS[name])):
        data = edit_with(rows)
        meshes_read.append(plain_mesh(data))
        assert mesh_of_core(data) == meshes_read[-1], rows
    assert meshes_read[0] is not None
    assert None in meshes_read[1:]


@pytest.mark.slow
def test_a_mesh_that_returns_is_stored_once():
    streams = returning()
    data = join_streams(streams)
    assert everything_of(data) == everything_of(without_end(data)) == list(map(bits_of, streams))
    with File(data, mesh=False) as file:
        ids = [section_ids(file, segment) for segment in file.segments]
    # The fifth has only a connectivity of a few bytes, which a reference would not save.
    assert [found.count(CONNECTIVITY) for found in ids] == [1, 1, 0, 0, 1, 0]
    assert [found[1] == REFERENCE for found in ids] == [False, False, True, True, False, True]
    n_attributes = [found.count(ATTRIBUTE) + found.count(FROM_POINTS) for found in ids]
    assert n_attributes == [0, 1, 9, 0, 0, 0]
    for number, stream in enumerate(streams):
        separate = separate_stream(whole_stream(data, segment=number))
        assert read_all(separate)[0].surface == read_all(stream)[0].surface
        assert bits_of(separate) == bits_of(stream)


def test_materials_and_images_of_different_meshes_are_stored_once():
    streams = of_one_look()
    data = join_streams(streams)
    assert everything_of(data) == list(map(bits_of, streams))
    with File(data, mesh=False) as file:
        ids = [section_ids(file, segment) for segment in file.segments]
    assert [found.count(IMAGE) for found in ids] == [2, 0, 0, 0, 0]
    assert [found.count(MATERIAL) for found in ids] == [2, 0, 0, 0, 0]
    assert [found.count(REFERENCE) for found in ids] == [0, 1, 1, 1, 1]
    for one, stream in zip(decode(data).segments, streams, strict=True):
        expected = decode(stream).surface
        assert (one.surface.materials, one.surface.images) == (expected.materials, expected.images)


def section_ids(file, segment):
    offset, ids = segment.offset, []
    while offset < segment.offset + segment.size:
        section = file.section(offset)
        ids.append(section.id)
        offset = section.offset + section.size
    return ids


def test_joining_one_stream_returns_it_unchanged():
    for stream in meshes():
        assert join_streams([stream]) == stream


def test_a_segment_of_one_frame_adds_less_than_50_bytes():
    with not_compact():
        streams = one_frame_each()
    without_header = [len(s) - len(write_header(header_of(whole_stream(s)))) for s in streams]
    added = len(join_streams(streams)) - len(streams[0]) - sum(without_header[1:])
    assert added / len(streams[1:]) < 50


# ---- refusals ----


@pytest.mark.parametrize("path", REFUSED_FILES, ids=lambda path: path.stem)
def test_every_reader_refuses_segments_that_break_a_rule(path):
    data = path.read_bytes()
    with pytest.raises((DamagedError, ValueError)):
        read_all(data)
    with pytest.raises(CorruptStreamError):
        read_all_by_core(data)
    host = Host()
    refused = refusal(lambda: everything_of(data, host))
    if refused is None:  # the first segments are complete
        with File(data, host, mesh=False) as file:
            assert not file.info.is_whole
            assert file.info.damage.code == Code.CORRUPT
    else:
        assert refused.code in DAMAGED
        assert 0 < refused.offset < len(data)
    assert not host.held


def test_joining_refuses_incompatible_streams():
    first, second = meshes()
    with pytest.raises(InvalidInputError, match="no streams"):
        join_streams([])
    with pytest.raises(InvalidInputError, match="0 and 24 frames per second"):
        join_streams([first, one_frame_each()[0]])
    with pytest.raises(InvalidInputError, match="2 segments"):
        join_streams([join_streams([first, second]), first])


# ---- the C library ----


def test_a_file_of_several_segments_must_be_opened_by_segment():
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


def test_segments_report_frames_meshes_and_bytes():
    data = stored("two_meshes")
    with File(data, mesh=False) as file:
        first, second = file.segments
        counts = [(s.first_frame, s.n_frames, s.n_verts, s.n_triangles) for s in file.segments]
        assert counts == [(0, 5, 4, 4), (5, 4, 8, 12)]
        assert second.offset == first.offset + first.size
        assert data[second.offset] == 5  # SEGMENT
        assert data[second.offset + second.size] == 130  # INDEX
        assert [file.segment_of_frame(frame) for frame in range(9)] == [0] * 5 + [1] * 4
        assert code_of(lambda: file.segment(2)) == Code.INVALID
        assert code_of(lambda: file.open_segment(2)) == Code.INVALID


def test_times_of_a_segment_are_those_of_its_frames():
    with File(stored("two_meshes_timed"), mesh=False) as file:
        times = file.times
        with file.open_segment(1) as segment:
            assert segment.times == times[5:]
            assert segment.frame_at(times[7]) == 2


def test_an_open_segment_is_an_independent_file():
    data, host = stored("two_meshes"), Host()
    with File(data, host, mesh=False) as whole:
        file = whole.open_segment(1)
        segment = whole.segment(1)
    with file:  # the whole file is closed
        info = file.info
        assert (info.n_segments, info.n_frames, info.n_verts, info.n_tracks) == (1, 4, 8, 2)
        assert (str(info.name), info.start_s, info.number_bytes) == ("two meshes", 1.5 + 5 / 24, 8)
        assert info.size == segment.offset + segment.size
        assert [file.block_of_frame(frame) for frame in range(4)] == [0] * 4
        assert file.block(0).first_frame == 0
        assert file.block(0, 1).offset + file.block(0, 1).size == info.size
        assert file.segment(0).first_frame == 5
        assert file.section(0).id == 5  # SEGMENT
        assert file.section(0).offset == segment.offset
        assert code_of(lambda: file.section(info.size)) == Code.INVALID
        assert code_of(lambda: file.open_segment(0)) == Code.INVALID
    assert not host.held


def test_a_single_segment_can_be_opened_too():
    stream = meshes()[1]
    with File(stream) as file, file.open_segment(0) as segment:
        assert segment.values().tobytes() == file.values().tobytes()
        assert segment.info.size == file.info.size == len(stream)


def test_sections_of_a_file_span_all_segments():
    data = stored("two_meshes")
    with File(data, mesh=False) as file:
        offset, ids = 0, []
        while offset < len(data):
            section = file.section(offset)
            ids.append(section.id)
            offset = section.offset + section.size
        assert ids.count(5) == 1  # SEGMENT
        assert ids.count(1) == 2  # CONNECTIVITY
        assert ids[-2:] == [130, 0]


@pytest.mark.slow
@pytest.mark.parametrize("streams", [meshes, one_frame_each])
def test_a_truncated_stream_keeps_all_complete_blocks(streams):
    data = join_streams(streams())
    with File(data, mesh=False) as file:
        ends = [segment.offset + segment.size for segment in file.segments]
    expected = everything_of(data)
    for size in range(ends[0], len(data)):
        with File(data[:size], mesh=False) as file:
            assert not file.info.is_whole
            n_complete = sum(end <= size for end in ends)
            assert n_complete <= file.info.n_segments <= n_complete + 1
            assert file.info.size <= size
            for number in range(n_complete):
                assert values_of(file, number) == expected[number]
                with file.open_segment(number) as segment:
                    assert segment.info.is_whole or number + 1 == file.info.n_segments


def test_a_damaged_byte_is_detected_or_harmless():
    data, rng = stored("two_meshes"), np.random.default_rng(3)
    expected = everything_of(data)
    for position in rng.choice(len(data), 150, replace=False):
        damaged = bytearray(data)
        damaged[position] ^= 1 << int(rng.integers(8))
        host = Host()
        decoded = []
        refused = refusal(lambda d=damaged, h=host, r=decoded: r.append(everything_of(bytes(d), h)))
        assert not host.held
        if refused is None:
            assert len(decoded[0]) <= 2
            for segment, expected_segment in zip(decoded[0], expected, strict=False):
                for values, all_values in zip(segment, expected_segment, strict=True):
                    assert all_values.startswith(values)
        else:
            assert refused.code in DAMAGED


@pytest.mark.slow
def test_failing_allocations_leak_nothing():
    returned = join_streams(one_frame_each())
    for data in (join_streams(meshes()), returned, without_end(returned)):
        host = Host()
        expected = everything_of(data, host)
        assert not host.held
        for number in range(host.n_allocations):
            failing = Host(fails_at=number)
            refused = refusal(lambda d=data, h=failing: everything_of(d, h))
            assert refused.code == Code.NO_MEMORY, number
            assert not failing.held, number
        assert everything_of(data, Host(), by_calls(data)) == expected


@pytest.mark.slow
@pytest.mark.parametrize("streams", [meshes, one_frame_each])
def test_failing_reads_are_not_reported_as_damage(streams):
    data = join_streams(streams())
    for position in range(0, len(data), 3):
        source = by_calls(data, lambda begin, end, at=position: not begin <= at < end)
        host = Host()
        refused = refusal(lambda h=host, s=source: everything_of(data, h, s))
        assert refused.code == Code.UNREADABLE, position
        assert refused.offset <= position < refused.offset + refused.size
        assert not host.held


@pytest.mark.slow
def test_memory_of_many_segments_is_linear_and_limited():
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
