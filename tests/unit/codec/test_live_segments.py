"""Live encoding of frames whose faces change."""

from io import BytesIO
from itertools import pairwise
from unittest.mock import patch

import numpy as np
import pytest

import meshreel
from meshreel.codec.decoder import decode
from meshreel.codec.inspect import info
from meshreel.codec.mesh_edits import MeshEdits
from meshreel.codec.reel_file import ReelFile
from meshreel.codec.streaming import Encoder
from meshreel.errors import InvalidInputError, TruncatedStreamError
from meshreel.model.sequence import MeshSequence
from samples.meshes import kg_error_percent, octahedron_faces, quad_sheet, waving_grid

GRIDS = [waving_grid(n, 5 + n, 6) for n in (7, 1, 4)]
"""Meshes with different vertices and faces, at 25 fps."""


def recorded(segments, file=None, **options):
    """Push the frames of segments, with faces at the first of each."""
    file = BytesIO() if file is None else file
    with Encoder(segments[0].faces, file, fps=25, **options) as encoder:
        for segment in segments:
            for number, frame in enumerate(segment.vertices):
                encoder.push(frame, faces=segment.faces if number == 0 else None)
    return file.getvalue()


@pytest.mark.parametrize("method", ["reel", "lossless", "grid"])
def test_each_push_with_other_faces_begins_a_segment(method):
    options = {"max_error": 0.5} if method == "grid" else {}
    data = recorded(GRIDS, method=method, block_frames=3, **options)
    decoded = decode(data)
    assert decoded.starts == (0, 7, 8, 12)
    for grid, segment in zip(GRIDS, decoded.segments, strict=True):
        np.testing.assert_array_equal(segment.faces, grid.faces)
        vertices = segment.read(0, segment.n_frames)
        assert kg_error_percent(grid.vertices, vertices) < 2
        if method == "lossless":
            np.testing.assert_array_equal(vertices, grid.vertices)


def test_blocks_end_where_a_segment_begins():
    assert info(recorded(GRIDS, block_frames=3)).block_frames == (3, 3, 1, 1, 3, 1)


def test_equal_faces_continue_the_segment():
    grid, file = GRIDS[0], BytesIO()
    with Encoder(grid.faces, file, block_frames=3) as encoder:
        for frame in grid.vertices:
            encoder.push(frame, faces=grid.faces.astype(np.int64))
        assert encoder.n_segments == 1
    np.testing.assert_array_equal(
        decode(file.getvalue()).vertices, decode(recorded([grid], block_frames=3)).vertices
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
    data = recorded(larger, max_error=0.4, block_frames=7)
    low, high = larger[0].extent.low, larger[0].extent.high
    bound = 0.004 * np.linalg.norm(high - low)
    assert info(data).error_bound_percent == 0.4
    for grid, segment in zip(larger, decode(data).segments, strict=True):
        errors = np.linalg.norm(segment.read(0, segment.n_frames) - grid.vertices, axis=2)
        assert 0.1 * bound < errors.max() <= bound


def test_the_start_counts_once():
    decoded = decode(recorded(GRIDS, start_s=2.0))
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
    recorded(GRIDS, file, block_frames=3)
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
