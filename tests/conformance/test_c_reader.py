"""The C decoder agrees with the package bit for bit, and refuses the same streams."""

import ctypes
import threading

import numpy as np
import pytest

import meshreel
from conformance.container import METHODS, read_container
from conformance.make import FOLDER, REFUSED_FOLDER, STREAMS
from conformance.reader import number_of
from meshreel.codec.open_stream import timing_of
from meshreel.kernel.files import OpenFile
from meshreel.kernel.library import library
from meshreel.kernel.normals import surface_normals
from meshreel.kernel.structures import NUMBER_TYPES
from samples import c_reader
from samples.c_interface import layouts
from samples.c_reader import (
    DAMAGED,
    Code,
    CSurface,
    Decoder,
    File,
    Host,
    Layout,
    by_calls,
    code_of,
    in_memory,
    refusal,
)
from samples.costs import draws

NORMAL = 3
"""`MESHREEL_TRACK_NORMAL`."""

PAPER_STREAMS = [name for name in STREAMS if name.startswith("paper_")]
DECODABLE = [name for name in STREAMS if name not in PAPER_STREAMS]
VARIED = (
    "cells_with_values",
    "corners_in_rows",
    "everything_quantised",
    "exact_of_faces",
    "grid_with_tracks",
    "key_blocks",
    "live_with_bound",
    "missing_values",
    "normals_of_polygons",
    "predicted_from_exact_positions",
    "reused_fields",
)
"""Streams that together have every kind of track, block and container."""


def stored(name):
    return (FOLDER / f"{name}.reel").read_bytes()


def decoded_all(file):
    """Return the bytes of the triangles and of the values of each track."""
    values = [file.values(number).tobytes() for number in range(file.info.n_tracks)]
    return [file.triangles.tobytes(), *values]


def everything_of(data, host, source=None):
    """Decode a whole file with its surface, close it, and return `decoded_all`."""
    with File(source or in_memory(data), host) as file:
        file.read_surface()
        return decoded_all(file)


def same(found, wanted):
    """Whether two arrays have the same type, shape and bits."""
    return (found.dtype, found.shape) == (wanted.dtype, wanted.shape) and (
        found.tobytes() == np.ascontiguousarray(wanted).tobytes()
    )


# ---- the same bits ----


@pytest.mark.every_case
@pytest.mark.parametrize("name", DECODABLE)
def test_positions_tracks_and_cells_equal_those_of_the_package(name):
    data = stored(name)
    wanted = meshreel.decode(data)
    with File(data) as file:
        assert np.array_equal(file.triangles, wanted.faces)
        assert same(file.values(), wanted.vertices)
        assert [str(track.name) for track in file.tracks[1:]] == list(wanted.tracks)
        for number, track in enumerate(wanted.tracks.values(), 1):
            info = file.track(number)
            assert (str(info.unit), info.n_columns) == (track.unit, track.values.shape[2])
            assert same(file.values(number), np.asarray(track.values)), info.name
        if wanted.surface.cells:
            np.testing.assert_array_equal(file.cells.nodes, wanted.surface.cells.nodes)


@pytest.mark.parametrize("name", VARIED)
def test_threads_and_sources_do_not_change_bits(name):
    data = stored(name)
    wanted = everything_of(data, Host())
    assert everything_of(data, Host(n_threads=2)) == wanted
    assert everything_of(data, Host(), by_calls(data)) == wanted


@pytest.mark.parametrize("n_modes", [1, 8, 30])
def test_previews_equal_those_of_the_package(n_modes):
    for name in ("key_blocks", "reused_fields", "corrections", "doubles", "max_error"):
        data = stored(name)
        wanted = meshreel.decode(data, n_modes=n_modes).vertices
        with File(data) as file:
            assert same(file.values(n_modes=n_modes), wanted), name


def test_preview_does_not_affect_later_frames():
    data = stored("key_blocks")
    with File(data) as file, Decoder(file) as decoder:
        wanted = decoder.frames()
        preview = decoder.frames(n_modes=2)
        assert not np.array_equal(preview, wanted)
        assert same(decoder.frames(), wanted)
        assert same(decoder.frames(n_modes=2), preview)


@pytest.mark.slow
def test_modes_of_a_block_reproduce_its_values():
    rng = np.random.default_rng(6)
    n_checked = 0
    for name in DECODABLE:
        with File(stored(name)) as file, Decoder(file) as decoder:
            blocks = [file.block(number) for number in range(file.info.n_blocks)]
            wanted = [file.values(number) for number in range(file.info.n_tracks)]
            for first, second in rng.integers(len(blocks), size=(max(2, draws(12)), 2)):
                for track, values in enumerate(wanted):
                    decoder.load(track, int(first))
                    decoder.load(track, int(second))
                    result = decoder.values_of_modes(track, int(first))
                    start, n_frames = blocks[first].first_frame, blocks[first].n_frames
                    expected = values[start : start + n_frames]
                    assert same(decoder.frames(track, start, n_frames), expected), name
                    if result is None or file.track(track).kind == NORMAL:
                        continue
                    missing = np.isnan(expected)
                    largest = np.abs(expected[~missing]).max(initial=0.0)
                    off = np.abs(result - expected)[~missing].max(initial=0.0)
                    rounding = np.finfo(expected.dtype).smallest_subnormal
                    assert off <= 1e-6 * largest + rounding, (name, track, off)
                    n_checked += 1
    assert n_checked > 100


@pytest.mark.parametrize("name", VARIED)
def test_ranges_of_frames_equal_those_of_the_whole(name):
    rng = np.random.default_rng(3)
    with File(stored(name)) as file, Decoder(file) as decoder:
        n_frames, n_tracks = file.info.n_frames, file.info.n_tracks
        wholes = [file.values(track) for track in range(n_tracks)]
        for _ in range(20):
            first, track = int(rng.integers(n_frames)), int(rng.integers(n_tracks))
            count = int(rng.integers(n_frames - first + 1))
            result = decoder.frames(track, first, count)
            assert same(result, wholes[track][first : first + count]), (track, first, count)


@pytest.mark.parametrize("name", ["doubles", "tracks_of_polygons", "corners_in_rows"])
def test_only_strided_values_are_written(name):
    with File(stored(name)) as file, Decoder(file) as decoder:
        for number, track in enumerate(file.tracks):
            wanted = file.values(number)
            n_frames, n_items, width = wanted.shape
            buffer = np.full((n_frames, n_items + 1, width + 2), 7, wanted.dtype)
            size = buffer.itemsize
            layout = Layout(
                value_stride=(width + 2) * size, frame_stride=(n_items + 1) * (width + 2) * size
            )
            decoder.decode(buffer, number, 0, n_frames, layout=layout)
            assert same(buffer[:, :n_items, :width], wanted), track.name
            assert (buffer[:, n_items:] == 7).all()
            assert (buffer[:, :, width:] == 7).all()


@pytest.mark.parametrize("name", ["doubles", "lossless_doubles", "grid_doubles", "exact_f8"])
def test_float64_values_decode_to_rounded_float32(name):
    with File(stored(name)) as file, Decoder(file) as decoder:
        for number, track in enumerate(file.tracks):
            wanted = file.values(number)
            if wanted.dtype != np.float64:
                continue
            assert same(decoder.frames(number, dtype=np.float32), wanted.astype(np.float32))
            buffer = np.full((len(wanted), *wanted.shape[1:-1], track.n_columns + 1), 7, np.float32)
            layout = Layout(type=c_reader.FLOAT32, value_stride=4 * (track.n_columns + 1))
            decoder.decode(buffer, number, 0, len(wanted), layout=layout)
            assert same(buffer[..., :-1], wanted.astype(np.float32))


def test_float64_values_beyond_float32_are_refused_only_as_float32():
    huge = np.array([[0.0, 0, 0], [1e300, 0, 0], [0, 1e300, 0]])
    sequence = meshreel.MeshSequence(np.stack([huge, huge / 2]), [[0, 1, 2]])
    with File(meshreel.encode(sequence, method="lossless")) as file, Decoder(file) as decoder:
        assert code_of(lambda: decoder.frames(dtype=np.float32)) == Code.RANGE
        assert np.array_equal(decoder.frames(), sequence.vertices)


def test_normals_equal_those_of_the_core():
    for name in ("sphere", "doubles"):
        with File(stored(name)) as file, Decoder(file) as decoder:
            positions = decoder.frames(first=2, count=1)
            wanted = surface_normals(positions, file.triangles.astype(np.int32))[0]
            assert same(decoder.normals(positions[0]), wanted.astype(positions.dtype))


# ---- information about a file ----


def test_structures_have_the_layout_of_the_header():
    results = []
    for name, structure in c_reader.STRUCTURES.items():
        results.append(f"size meshreel_{name} {ctypes.sizeof(structure)}")
        for field, _ in structure._fields_:
            place = getattr(structure, field).offset
            results.append(f"offset meshreel_{name}.{field} {place}")
    wanted = layouts()
    assert sorted(results) == sorted(one for one in wanted if one.startswith(("size", "offset")))
    codes = [f"code MESHREEL_{code.name} {code.value}" for code in Code]
    assert set(codes) <= set(wanted)


def test_info_agrees_with_the_plain_reader():
    for name in STREAMS:
        data = stored(name)
        container = read_container(data)
        header = container.header
        with File(data, mesh=False) as file:
            info = file.info
            assert header.n_frames in (0, info.n_frames), name
            assert (info.n_verts, info.n_triangles) == (header.n_verts, header.n_faces), name
            assert (info.diagonal, tuple(info.center)) == (header.scale, header.origin), name
            assert (info.n_blocks, info.n_tracks) == (
                len(container.blocks),
                1 + len(container.all_of("TRACK")),
            ), name
            assert info.order == header.order, name
            times = container.times
            span_s = times[-1] - times[0] if times else 0
            assert info.fps == ((len(times) - 1) / span_s if span_s else header.fps), name
            assert (info.laplacian, str(info.name)) == (header.laplacian, header.name), name
            assert METHODS[info.method] == header.method, name
            bound_percent = number_of(container, "ERROR_BOUND") or 0
            assert file.track(0).bound == bound_percent / 100 * header.scale, name
            assert info.is_whole, name


@pytest.mark.parametrize("name", ["times", "live_times", "named", "two_frames"])
def test_frames_are_found_by_time(name):
    data = stored(name)
    timing, n_frames = timing_of(OpenFile(data, np.inf)), len(meshreel.decode(data))
    with File(data, mesh=False) as file:
        assert file.times == (None if timing.times is None else timing.times.tolist())
        seconds = [timing.at(frame) for frame in range(n_frames)]
        if timing.fps:
            assert [file.frame_at(time) for time in seconds] == list(range(n_frames))
        for time in (
            -np.inf,
            -1e9,
            *np.linspace(seconds[0] - 1, seconds[-1] + 1, 97),
            np.inf,
            np.nan,
        ):
            assert file.frame_at(time) == timing.frame_at(time, n_frames), time


def test_sections_are_contiguous_up_to_the_end():
    for name in ("everything", "paper_blocks", "live"):
        data = stored(name)
        with File(data, mesh=False) as file:
            offset, result = 0, []
            while refused_end(file, offset) is None:
                section = file.section(offset)
                assert data[section.offset] == section.id
                assert section.payload + section.payload_size + 4 == section.offset + section.size
                result.append(section.id)
                offset = section.offset + section.size
            assert offset == file.info.size <= len(data)
            assert 1 in result  # CONNECTIVITY


def refused_end(file, offset):
    """Return the refusal at the end of the sections; None before it."""
    refused = refusal(lambda: file.section(offset))
    assert refused is None or refused.code == Code.INVALID
    return refused


def test_blocks_cover_all_frames_in_order_without_overlap():
    for name in ("key_blocks", "corners_in_rows", "grid_with_tracks"):
        with File(stored(name)) as file:
            frame, at = 0, 0
            for number in range(file.info.n_blocks):
                for track in range(file.info.n_tracks):
                    block = file.block(number, track)
                    assert block.first_frame == frame
                    assert block.offset == at or not at
                    at = block.offset + block.size
                for inside in (frame, frame + block.n_frames - 1):
                    assert file.block_of_frame(inside) == number
                frame += block.n_frames
            assert frame == file.info.n_frames


@pytest.mark.parametrize("check", [True, False])
def test_group_reports_modes_and_key_block(check):
    data = stored("reused_fields")
    with File(data) as file:
        groups = [file.group(number, check=check) for number in range(file.info.n_blocks)]
    assert tuple(group.n_modes for group in groups) == meshreel.info(data).n_modes
    assert all(0 < group.step < 1 for group in groups)
    assert groups[0].key_block == 0
    assert groups[-1].key_block < len(groups) - 1


def test_streams_of_the_paper_have_triangles_but_no_decoder():
    for name in PAPER_STREAMS:
        data = stored(name)
        with File(data) as file:
            assert np.array_equal(file.triangles, meshreel.decode(data).faces), name
            assert code_of(lambda file=file: Decoder(file)) == Code.METHOD, name


# ---- arguments ----


def test_decoder_still_works_after_refused_arguments():
    with File(stored("tracks")) as file, Decoder(file) as decoder:
        n_frames, n_tracks = file.info.n_frames, file.info.n_tracks
        before = decoder.frames()
        calls = {
            "frame": lambda: decoder.frames(0, n_frames, 1),
            "count": lambda: decoder.frames(0, 1, n_frames),
            "track": lambda: decoder.decode(before, n_tracks, 0, 1),
            "block": lambda: decoder.load(0, file.info.n_blocks),
            "preview of a track": lambda: decoder.frames(1, n_modes=3),
            "type": lambda: decoder.decode(before, 0, 0, 1, layout=Layout(type=8)),
            "stride": lambda: decoder.decode(before, 0, 0, 1, layout=Layout(value_stride=8)),
            "odd stride": lambda: decoder.decode(before, 0, 0, 1, layout=Layout(value_stride=13)),
            "alignment": lambda: decoder.decode(before.view(np.uint8).ravel()[1:], 0, 0, 1),
            "alignment of normals": lambda: decoder.normals(misaligned(before[0])),
            "section": lambda: file.section(3),
            "track of file": lambda: file.track(n_tracks),
            "block of file": lambda: file.block(file.info.n_blocks),
        }
        assert {name: code_of(act) for name, act in calls.items()} == dict.fromkeys(
            calls, Code.INVALID
        )
        assert same(decoder.frames(), before)


def misaligned(values):
    """Return a copy of floats at a misaligned address."""
    buffer = np.zeros(values.nbytes + 1, np.uint8)[1:]
    result = buffer.view(values.dtype).reshape(values.shape)
    result[...] = values
    return result


def test_null_pointers_are_refused():
    for name in ("open", "read_mesh", "read_surface", "begin", "load", "decode", "normals"):
        nothing = [None] * {"open": 3, "begin": 2, "decode": 7, "normals": 4, "load": 4}.get(
            name, 1
        )
        assert code_of(lambda name=name, nothing=nothing: c_reader.call(name, *nothing)) == (
            Code.INVALID
        )
    library().meshreel_close(None)
    library().meshreel_end(None)


def test_decoder_requires_the_mesh():
    with File(stored("torus"), mesh=False) as file:
        assert file.triangles is None
        assert code_of(lambda: Decoder(file)) == Code.INVALID
        file.read_mesh()
        Decoder(file).close()


# ---- memory ----


@pytest.mark.slow
@pytest.mark.parametrize("name", VARIED)
def test_failing_allocations_leak_nothing(name):
    data = stored(name)
    host = Host()
    everything_of(data, host)
    assert not host.held
    for number in range(0, host.n_allocations, max(1, host.n_allocations // draws(600))):
        failing = Host(fails_at=number)
        refused = refusal(lambda failing=failing: everything_of(data, failing))
        assert refused.code == Code.NO_MEMORY, number
        assert refused.size > 0
        assert not failing.held, number


def test_call_without_memory_succeeds_when_repeated():
    data = stored("corners_in_rows")
    with File(data) as file:
        file.read_surface()
        wanted = attribute_values(file), decoded_all(file)
    host = Host()
    with File(data, host, mesh=False) as file:
        assert until_it_succeeds(host, file.read_mesh) > 5
        assert until_it_succeeds(host, file.read_surface) > 5
        assert attribute_values(file) == wanted[0]
        with Decoder(file) as decoder:
            for track in range(file.info.n_tracks):
                assert until_it_succeeds(host, lambda track=track: decoder.load(track, 0)) > 1
        assert decoded_all(file) == wanted[1]
    assert not host.held


def attribute_values(file):
    surface = c_reader.returned("surface_of", ctypes.POINTER(CSurface), file.handle).contents
    return [
        c_reader.array_at(one.values, (one.n_rows, one.width), NUMBER_TYPES[one.type]).tobytes()
        for one in surface.attributes[: surface.n_attributes]
    ]


def until_it_succeeds(host, act):
    """Repeat a call with one more successful allocation each; return the number of refusals."""
    for n_failures in range(10_000):
        host.fails_at = host.n_allocations + n_failures
        before = sum(host.held.values())
        code = code_of(act)
        if code == Code.OK:
            host.fails_at = None
            return n_failures
        assert code == Code.NO_MEMORY
        assert sum(host.held.values()) <= before + 2**22  # memory of earlier steps may be kept
    raise AssertionError("the call never succeeds")


@pytest.mark.parametrize("name", ["key_blocks", "corners_in_rows", "lossless"])
def test_memory_limit_holds_and_refusals_state_the_required_size(name):
    data = stored(name)
    host = Host()
    wanted = everything_of(data, host)
    limit = 1000
    for _ in range(10_000):
        limited = Host(limit=limit)
        refused = refusal(lambda limited=limited: everything_of(data, limited))
        assert not limited.held
        assert limited.largest <= 2 * limit  # a file and one decoder
        if refused is None:
            break
        assert refused.code == Code.LIMIT
        assert refused.size > limit
        limit = refused.size
    assert everything_of(data, Host(limit=limit)) == wanted
    assert limit <= host.largest
    with File(data, Host(limit=limit), mesh=False) as file:
        file.check()


def test_order_of_blocks_does_not_affect_memory():
    data = stored("key_blocks")
    host = Host()
    with File(data, host) as file, Decoder(file) as decoder:
        decoder.frames()
        largest = host.largest
        for _ in range(3):
            for block in np.random.default_rng(1).permutation(file.info.n_blocks):
                decoder.load(0, int(block))
        assert host.largest <= 1.5 * largest
    assert not host.held


# ---- reading ----


@pytest.mark.parametrize("name", ["two_frames", "everything", "tracks_of_polygons"])
def test_failed_reads_can_be_repeated(name):
    data = stored(name)
    with File(data) as file:
        wanted = [file.triangles.tobytes(), *decoded_all(file)]
    for piece in (len(data) // 3, 700):
        fetched_pieces = set()  # numbers of pieces that were fetched
        source = by_calls(
            data,
            lambda begin, end, fetched_pieces=fetched_pieces, piece=piece: all(
                number in fetched_pieces for number in range(begin // piece, (end - 1) // piece + 1)
            ),
        )

        def fetched(act, fetched_pieces=fetched_pieces, piece=piece):
            """Repeat a call until all bytes that it reads are fetched."""
            while refused := refusal(act):
                assert refused.code == Code.UNREADABLE
                end = refused.offset + refused.size
                assert end <= len(data)
                new = set(range(refused.offset // piece, (end - 1) // piece + 1)) - fetched_pieces
                assert new
                fetched_pieces |= new

        opened = []
        fetched(lambda source=source, opened=opened: opened.append(File(source, mesh=False)))
        with opened[0] as file:
            fetched(file.read_mesh)
            fetched(file.read_surface)
            results = [file.triangles.tobytes(), file.triangles.tobytes()]
            with Decoder(file) as decoder:
                for track in range(file.info.n_tracks):
                    for block in range(file.info.n_blocks):
                        fetched(lambda track=track, block=block: decoder.load(track, block))
                    fetched(lambda track=track: decoder.frames(track))
                    results.append(decoder.frames(track).tobytes())
            assert results == wanted


@pytest.mark.slow
def test_failing_reads_are_not_reported_as_damage():
    data = stored("two_frames")
    for place in range(len(data)):
        source = by_calls(data, lambda begin, end, place=place: not begin <= place < end)
        host = Host()
        refused = refusal(lambda host=host, source=source: everything_of(data, host, source))
        assert refused.code == Code.UNREADABLE, place
        assert refused.offset <= place < refused.offset + refused.size
        assert not host.held


# ---- threads ----


def test_decoders_of_one_file_run_concurrently():
    data = stored("corners_in_rows")
    with File(by_calls(data), Host(n_threads=2)) as file:
        wanted, result = decoded_all(file), {}

        def decode(number):
            result[number] = decoded_all(file)

        threads = [threading.Thread(target=decode, args=(number,)) for number in range(3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert all(result[number] == wanted for number in range(3))


# ---- damage ----


@pytest.mark.every_case
@pytest.mark.parametrize("path", sorted(REFUSED_FOLDER.glob("*.reel")), ids=lambda path: path.stem)
def test_streams_that_break_a_rule_are_refused(path):
    host = Host()
    refused = refusal(lambda: everything_of(path.read_bytes(), host))
    assert refused.code in DAMAGED
    assert refused.offset != c_reader.UNKNOWN_OFFSET
    assert not host.held


@pytest.mark.parametrize("name", ["no_index", "sphere"])
def test_bytes_after_the_end_are_reported(name):
    data = stored(name)
    with File(data + b"more") as file:
        assert not file.info.is_whole
        assert file.info.damage.offset == len(data)
        assert file.info.damage.message == b"bytes follow the section END"
