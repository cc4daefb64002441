"""Encoding of frames added in order, also if their faces change."""

import os
import signal
import subprocess
import sys
import textwrap
import time
from io import BytesIO
from itertools import pairwise
from unittest.mock import patch

import numpy as np
import pytest

import meshreel
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import info
from meshreel.codec.mesh_edits import MeshEdits
from meshreel.codec.reel_file import ReelFile
from meshreel.codec.streaming import Encoder
from meshreel.errors import InvalidInputError, TruncatedStreamError
from meshreel.model.sequence import MeshSequence
from samples.meshes import (
    irregular_sequence,
    kg_error_percent,
    octahedron_faces,
    quad_sheet,
    waving_grid,
)
from samples.streams import not_compact, recorded

SEQUENCE = waving_grid(43)


@pytest.mark.parametrize(
    ("method", "options"),
    [
        ("reel", {"step": 1e-4}),
        ("reel", {"max_error": 0.3, "effort": 5}),
        ("blocks", {"n_modes": 4}),
        ("pca-qp", {}),
    ],
)
def test_frames_of_one_block_equal_those_of_encode(method, options):
    sequence = irregular_sequence(9)
    online = decode(recorded(sequence, method=method, block_frames=9, **options))
    at_once = decode(encode(sequence, method, block_frames=9, **options))
    np.testing.assert_array_equal(online.vertices, at_once.vertices)
    np.testing.assert_array_equal(online.faces, at_once.faces)


@pytest.mark.parametrize("method", ["reel", "blocks", "pca-qp", "v2v"])
def test_error_is_small_with_many_blocks(method):
    data = recorded(SEQUENCE, method=method, block_frames=10)
    assert info(data).block_frames == (10, 10, 10, 10, 3)
    assert kg_error_percent(SEQUENCE.vertices, decode(data).vertices) < 2.5


def test_later_blocks_take_fewer_bytes_than_the_first():
    sequence = waving_grid(60, 40, 41)
    data = recorded(sequence, block_frames=20)
    alone = [
        len(encode(meshreel.MeshSequence(sequence.vertices[number : number + 20], sequence.faces)))
        for number in (20, 40)
    ]
    connectivity = info(data).budget_bytes["connectivity"]
    assert sum(info(data).block_bytes[1:]) < 0.8 * (sum(alone) - 2 * connectivity)


def test_latency_determines_the_block_length():
    data = recorded(SEQUENCE, max_latency_s=0.5)
    expected = int(0.5 * 15 / 16 * (SEQUENCE.fps or 25))
    assert info(data).block_frames[0] == expected


def test_growing_file_is_readable_up_to_the_last_block(tmp_path):
    path = tmp_path / "live.reel"
    encoder = Encoder(SEQUENCE.faces, path, block_frames=10)
    for frame in SEQUENCE.vertices[:25]:
        encoder.push(frame)
    encoder._wait_for_all()
    with meshreel.open(path) as reel:
        assert (len(reel), reel.is_whole) == (20, False)
        assert_parts_sum(reel.info())
    encoder.close()
    with meshreel.open(path) as reel:
        assert (len(reel), reel.is_whole) == (25, True)
        assert_parts_sum(reel.info())


def assert_parts_sum(stream):
    assert min(stream.part_bytes.values()) > 0
    assert sum(stream.part_bytes.values()) == stream.size_bytes


RECORDING = """
    import itertools, sys, time
    import meshreel
    sequence = meshreel.simulate_flag(40)
    encoder = meshreel.Encoder(sequence.faces, sys.argv[1], block_frames=5)
    for number in itertools.count():
        encoder.push(sequence.vertices[number % 40])
        print(number, flush=True)
        time.sleep(0.002)
"""


@pytest.mark.slow
def test_file_of_a_killed_encoder_is_readable_up_to_the_last_block(tmp_path):
    path = tmp_path / "killed.reel"
    command = [sys.executable, "-c", textwrap.dedent(RECORDING), str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        while int(process.stdout.readline()) < 33:
            pass
        process.send_signal(signal.SIGKILL)
    n_written = os.path.getsize(path)
    flag = meshreel.simulate_flag(40)
    with meshreel.open(path) as reel:
        assert not reel.is_whole
        assert len(reel) % 5 == 0
        assert len(reel) >= 20
        shown = np.stack([frame.vertices for frame in reel])[:40]
        assert kg_error_percent(flag.vertices[: len(shown)], shown) < 3
    assert os.path.getsize(path) == n_written


def test_pushed_frames_are_kept_when_the_source_fails(tmp_path):
    path = tmp_path / "stopped.reel"

    def record():
        with Encoder(SEQUENCE.faces, path, block_frames=10) as encoder:
            for number, frame in enumerate(SEQUENCE.vertices):
                if number == 17:
                    raise KeyboardInterrupt
                encoder.push(frame)

    with pytest.raises(KeyboardInterrupt):
        record()
    with meshreel.open(path) as reel:
        assert (len(reel), reel.is_whole) == (17, True)


def test_no_file_is_left_without_pushed_frames(tmp_path):
    path = tmp_path / "empty.reel"
    with pytest.raises(InvalidInputError, match="no frame was pushed"):
        Encoder(SEQUENCE.faces, path).close()
    assert not path.exists()


def test_existing_file_is_kept(tmp_path):
    path = tmp_path / "there.reel"
    path.write_bytes(b"mine")
    with pytest.raises(InvalidInputError, match="exists"):
        Encoder(SEQUENCE.faces, path)
    assert path.read_bytes() == b"mine"


def test_path_without_the_extension_reel_is_refused(tmp_path):
    with pytest.raises(InvalidInputError, match=r"live\.glb must end in \.reel; got \.glb"):
        Encoder(SEQUENCE.faces, tmp_path / "live.glb")
    assert list(tmp_path.iterdir()) == []


FILLING = """
    import resource, sys
    import meshreel
    resource.setrlimit(resource.RLIMIT_FSIZE, (1500, 1500))
    sequence = meshreel.simulate_flag(40)
    output = {"path": str, "file": lambda path: open(path, "wb", 0)}[sys.argv[2]](sys.argv[1])
    try:
        with meshreel.Encoder(sequence.faces, output, block_frames=5) as encoder:
            for frame in sequence.vertices:
                encoder.push(frame)
    except meshreel.OutputError as error:
        print(error.filename, isinstance(error, OSError))
"""


@pytest.mark.slow
@pytest.mark.parametrize("output", ["path", "file"])
def test_error_names_a_file_that_grows_too_large(tmp_path, output):
    pytest.importorskip("resource")
    path = tmp_path / "live.reel"
    command = [sys.executable, "-c", textwrap.dedent(FILLING), str(path), output]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert (done.stdout, done.stderr) == (f"{path} True\n", "")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        *(({name: 1.0}, "needs the whole sequence") for name in ("kg", "size")),
        ({"block_frames": "all"}, "'auto'; got 'all'"),
        ({"max_latency_s": 0}, "above 0; got 0"),
        ({"qualty": 3}, "option 'qualty' is unknown; did you mean 'quality'"),
        ({"fps": -1}, "fps"),
    ],
)
def test_options_without_a_meaning_for_live_frames_are_refused(options, message):
    with pytest.raises(InvalidInputError, match=message):
        Encoder(SEQUENCE.faces, BytesIO(), **options)


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        (np.zeros((5, 3), np.float32), "frame 1 has 5 vertices of type float32; frame 0 has 99"),
        (SEQUENCE.vertices[0].astype(np.float64), "of type float64"),
        (np.full_like(SEQUENCE.vertices[0], np.nan), "must be finite"),
        (SEQUENCE.vertices, r"shape \(V, 3\)"),
    ],
)
def test_recording_continues_after_a_refused_frame(frame, message):
    file = BytesIO()
    with Encoder(SEQUENCE.faces, file, block_frames=2) as encoder:
        encoder.push(SEQUENCE.vertices[0])
        with pytest.raises(InvalidInputError, match=message):
            encoder.push(frame)
        encoder.push(SEQUENCE.vertices[1])
    assert info(file.getvalue()).n_frames == 2


def test_pushed_frames_are_copied():
    frame, file = np.empty_like(SEQUENCE.vertices[0]), BytesIO()
    with Encoder(SEQUENCE.faces, file, block_frames=43) as encoder:
        for vertex in SEQUENCE.vertices:
            frame[:] = vertex
            encoder.push(frame)
    expected = decode(recorded(SEQUENCE, block_frames=43)).vertices
    np.testing.assert_array_equal(decode(file.getvalue()).vertices, expected)


def test_latency_is_measured_until_blocks_are_written():
    start = time.perf_counter()
    with Encoder(SEQUENCE.faces, BytesIO(), block_frames=10) as encoder:
        for frame in SEQUENCE.vertices:
            encoder.push(frame)
    assert 0 < encoder.latency_s <= time.perf_counter() - start


def test_error_of_a_block_is_raised_when_the_next_one_is_complete():
    far = SEQUENCE.vertices * np.float32(1e12)
    encoder = Encoder(SEQUENCE.faces, BytesIO(), block_frames=5, max_error=1e-3)
    for frame in SEQUENCE.vertices[:5]:
        encoder.push(frame)
    for frame in far[:4]:
        encoder.push(frame)
    encoder.push(far[4])
    with pytest.raises(InvalidInputError, match="cannot be guaranteed"):
        encoder.close()


@pytest.mark.parametrize("max_error", [1e-9, 1e-12])
def test_bounds_finer_than_the_integers_of_a_stream_are_kept(max_error):
    sequence = waving_grid(6, dtype=np.float64)
    data = recorded(sequence, block_frames=3, max_error=max_error)
    errors = np.linalg.norm(decode(data).vertices - sequence.vertices, axis=2)
    assert errors.max() <= max_error / 100 * info(data).diagonal


GRIDS = [waving_grid(n, 5 + n, 6) for n in (7, 1, 4)]
"""Meshes with different vertices and faces, at 25 fps."""


def recorded_segments(segments, file=None, **options):
    """Push the frames of segments, with faces at the first of each."""
    file = BytesIO() if file is None else file
    with Encoder(segments[0].faces, file, fps=25, **options) as encoder:
        for segment in segments:
            for number, frame in enumerate(segment.vertices):
                encoder.push(frame, faces=segment.faces if number == 0 else None)
    return file.getvalue()


def test_blocks_end_where_a_segment_begins():
    assert info(recorded_segments(GRIDS, block_frames=3)).block_frames == (3, 3, 1, 1, 3, 1)


def test_equal_faces_continue_the_segment():
    grid, file = GRIDS[0], BytesIO()
    with Encoder(grid.faces, file, block_frames=3) as encoder:
        for frame in grid.vertices:
            encoder.push(frame, faces=grid.faces.astype(np.int64))
        assert encoder.n_segments == 1
    np.testing.assert_array_equal(
        decode(file.getvalue()).vertices, decode(recorded_segments([grid], block_frames=3)).vertices
    )


def test_a_mesh_that_returns_is_stored_once():
    file = BytesIO()
    with (
        patch.object(MeshEdits, "edit_to", return_value=None),  # smaller grids are parts of others
        Encoder(GRIDS[0].faces, file, lossless=True) as encoder,
    ):
        for number in (0, 1, 0, 2, 1, 0):
            encoder.push(GRIDS[number].vertices[0], faces=GRIDS[number].faces)
    opened = info(file.getvalue())
    assert opened.budget_bytes["reference"] == 3 * 9
    with not_compact():
        sizes = [info(meshreel.encode(grid, lossless=True)).budget_bytes for grid in GRIDS]
    assert opened.budget_bytes["connectivity"] == sum(size["connectivity"] for size in sizes)
    for number, frame in zip((0, 1, 0, 2, 1, 0), decode(file.getvalue()), strict=True):
        np.testing.assert_array_equal(frame.faces, GRIDS[number].faces)
        np.testing.assert_array_equal(frame.vertices, GRIDS[number].vertices[0])


def test_the_error_bound_refers_to_the_first_box_in_all_segments():
    larger = [
        meshreel.MeshSequence(grid.vertices * np.float32(scale), grid.faces)
        for grid, scale in zip(GRIDS, (1, 4, 20), strict=True)
    ]
    data = recorded_segments(larger, max_error=0.4, block_frames=7)
    low, high = larger[0].extent.low, larger[0].extent.high
    bound = 0.004 * np.linalg.norm(high - low)
    assert info(data).error_bound_percent == 0.4
    for grid, segment in zip(larger, decode(data).segments, strict=True):
        errors = np.linalg.norm(segment.read(0, segment.n_frames) - grid.vertices, axis=2)
        assert 0.1 * bound < errors.max() <= bound


def test_the_start_counts_once():
    decoded = decode(recorded_segments(GRIDS, start_s=2.0))
    starts = [segment.timing.start_s for segment in decoded.segments]
    assert starts == pytest.approx([2.0, 2.28, 2.32])


def test_vertices_of_another_count_and_equal_faces_begin_a_segment():
    points = np.random.default_rng(1).normal(size=(9, 3)).astype(np.float32)
    file = BytesIO()
    with Encoder(octahedron_faces(), file) as encoder:
        encoder.push(points[:6])
        encoder.push(points, faces=octahedron_faces())
    assert [segment.n_verts for segment in decode(file.getvalue()).segments] == [6, 9]


class LoggedFile(BytesIO):
    """A file that notes its size after each write."""

    def __init__(self):
        super().__init__()
        self.sizes = []

    def write(self, data):
        written = super().write(data)
        self.sizes.append(len(self.getvalue()))
        return written


def test_a_file_cut_after_any_write_plays_up_to_there():
    file = LoggedFile()
    recorded_segments(GRIDS, file, block_frames=3)
    whole = decode(file.getvalue())
    frames, ends = list(whole), np.cumsum([0, 3, 3, 1, 1, 3, 1])
    counts = []
    for size in file.sizes:
        data = BytesIO(file.getvalue()[:size])
        try:
            reel = ReelFile(data)
        except TruncatedStreamError:
            counts.append(0)
            continue
        with reel:
            counts.append(len(reel))
            for frame, expected in zip(reel, frames, strict=False):
                np.testing.assert_array_equal(frame.vertices, expected.vertices)
                np.testing.assert_array_equal(frame.faces, expected.faces)
            assert reel.is_whole == (size == file.sizes[-1])
    assert all(a <= b for a, b in pairwise(counts))
    assert set(counts) == set(ends.tolist())


def test_recording_continues_after_refused_faces():
    grid, file = GRIDS[0], BytesIO()
    with Encoder(grid.faces, file) as encoder:
        encoder.push(grid[0].vertices)
        with pytest.raises(InvalidInputError, match=r"indices must be in 0\.\.98"):
            encoder.push(waving_grid().vertices[0], faces=grid.faces + 98)
        with pytest.raises(InvalidInputError, match=r"frame 1 has 99 .* 0 has 72 .* its faces"):
            encoder.push(waving_grid().vertices[0])
        encoder.push(grid[1].vertices)
        assert (encoder.n_frames, encoder.n_segments) == (2, 1)
    np.testing.assert_array_equal(decode(file.getvalue()).faces, grid.faces)


def test_methods_of_the_paper_refuse_other_faces():
    with Encoder(GRIDS[0].faces, BytesIO(), method="blocks") as encoder:
        encoder.push(GRIDS[0].vertices[0])
        with pytest.raises(InvalidInputError, match="method blocks needs the same in every frame"):
            encoder.push(GRIDS[1].vertices[0], faces=GRIDS[1].faces)


def test_each_segment_has_its_surface():
    sheet, grid = quad_sheet(2), GRIDS[0]
    file = BytesIO()
    with Encoder(sheet.faces, file, surface=sheet.surface, uv_bits=10) as encoder:
        for frame in sheet.vertices:
            encoder.push(frame, surface=sheet.surface)
        encoder.push(grid[0].vertices, faces=grid.faces)
        encoder.push(sheet[0].vertices, faces=sheet.faces, surface=sheet.surface)
    surfaces = [segment.surface for segment in decode(file.getvalue()).segments]
    names = [[attribute.name for attribute in surface.attributes] for surface in surfaces]
    assert names == [[attribute.name for attribute in sheet.surface.attributes], [], names[0]]


def test_each_segment_has_its_tracks():
    heat = [np.linspace(0, n + 1, grid.n_verts) for n, grid in enumerate(GRIDS)]
    file = BytesIO()
    with Encoder(GRIDS[0].faces, file, tracks={"heat": "1%"}) as encoder:
        encoder.push(GRIDS[0].vertices[0], {"heat": heat[0]})
        encoder.push(GRIDS[1].vertices[0], faces=GRIDS[1].faces)
        with pytest.raises(InvalidInputError, match=r"frame 2 has the tracks .*; frame 1 has none"):
            encoder.push(GRIDS[1].vertices[0], {"heat": heat[1]})
        encoder.push(GRIDS[2].vertices[0], {"heat": heat[2]}, faces=GRIDS[2].faces)
    segments = decode(file.getvalue()).segments
    assert [list(segment.tracks) for segment in segments] == [["heat"], [], ["heat"]]
    for number in (0, 2):
        values = segments[number].tracks["heat"].read(0, 1)[0, :, 0]
        assert np.abs(values - heat[number]).max() <= 0.01 * (number + 1) * (1 + 1e-6)


@pytest.mark.slow
def test_memory_is_bounded_by_a_block_while_faces_change(monkeypatch):
    """Every frame begins a segment: nothing but the last mesh is kept."""
    import gc
    import weakref

    alive = weakref.WeakSet()
    frames = list(MeshSequence.of_segments(GRIDS)) * 4
    with Encoder(frames[0].faces, BytesIO()) as encoder:
        for number, (vertices, faces) in enumerate(frames):
            shifted = np.roll(faces, number % 3, axis=1)
            encoder.push(vertices, faces=np.roll(shifted, number, axis=0))
            encoder._wait_for_all()
            if number:  # a segment is encoded when the next one begins
                alive.add(encoder._segment)
            if number % 12 == 11:
                gc.collect()
                assert 0 < len(alive) <= 2
    assert encoder.n_segments > 30


@pytest.mark.slow
def test_a_file_in_segments_is_encoded_within_its_memory_limit(tmp_path):
    grids = [waving_grid(200, 5 + n, 6) for n in range(12)]
    path = tmp_path / "a.reel"
    path.write_bytes(meshreel.encode(MeshSequence.of_segments(grids), "lossless"))
    needed = sum(grid.vertices.nbytes + grid.faces.nbytes for grid in grids)
    with meshreel.open(path, memory=0.9 * needed) as reel:
        assert len(list(reel)) == 2400
        with pytest.raises(meshreel.MemoryLimitError, match="frames 0:2400"):
            meshreel.encode(reel)
    with meshreel.open(path, memory=1.1 * needed) as reel:
        assert decode(meshreel.encode(reel, "lossless")).n_segments == 12


@pytest.mark.parametrize("size", [1e-5, 1.0])
def test_values_beyond_the_range_of_the_first_block_begin_a_segment(size):
    """The first values are round-off; relative to their range, others exceed integers or floats."""
    moving = waving_grid(20)
    values = np.random.default_rng(3).normal(size=(20, moving.n_verts))
    values *= np.where(np.arange(20) < 10, 1e-16, size)[:, None]
    file = BytesIO()
    with meshreel.Encoder(moving.faces, file, bound="0.1%", block_frames=10) as encoder:
        for vertices, stress in zip(moving.vertices, values, strict=True):
            encoder.push(vertices, {"stress": stress})
    segments = meshreel.decode(file.getvalue()).segments
    assert encoder.n_segments == len(segments) == 2
    for segment, original in zip(segments, (values[:10], values[10:]), strict=True):
        track = segment.tracks["stress"]
        assert isinstance(track, meshreel.Track)
        assert np.abs(track.values[..., 0] - original).max() <= track.error_bound
        assert track.error_bound <= 1.001e-3 * np.ptp(original)
