"""Segments of `.reel` files that are decoded when they are read."""

import gc
from weakref import WeakSet

import numpy as np
import pytest

import meshreel
from meshreel.codec import reel_file
from meshreel.codec.reel_file import MAX_OPEN_SEGMENTS, ReelFile
from meshreel.errors import CorruptStreamError, InvalidInputError, TruncatedStreamError
from meshreel.formats.frames import frame_stream
from meshreel.formats.options import ReadOptions
from meshreel.formats.reel import StoredSegment
from meshreel.formats.segments import open_any
from meshreel.formats.sources import find_files
from meshreel.model.tracks import Track
from samples.meshes import assert_same_surface, quad_sheet, waving_grid
from samples.tracks import assert_same_tracks


@pytest.fixture
def path(tmp_path):
    """A lossless file of three segments with surfaces; the second has a track."""
    sheet = quad_sheet(3)
    heat = np.random.default_rng(1).random((3, sheet.n_verts)).astype(np.float32)
    heated = sheet.replace(tracks={"heat": Track(heat)})
    segments = [one.replace(fps=25.0, name="") for one in (waving_grid(4), heated, quad_sheet(2))]
    data = meshreel.encode(meshreel.concatenate(segments), lossless=True)
    (tmp_path / "a.reel").write_bytes(data)
    return tmp_path / "a.reel"


def opened(path, **options):
    return open_any(find_files(path), ReadOptions(max_loaded_bytes=0, **options))


def test_stored_segments_are_those_that_load_decodes(path):
    result, expected = opened(path), meshreel.load(path)
    assert all(isinstance(segment, StoredSegment) for segment in result.segments)
    assert (result.starts, result.name, result.fps) == (expected.starts, "a", expected.fps)
    assert result.raw_size_bytes == expected.raw_size_bytes
    for one, other in zip(result.segments, expected.segments, strict=True):
        np.testing.assert_array_equal(one.read(0, one.n_frames), other.read(0, other.n_frames))
        np.testing.assert_array_equal(one.faces, other.faces)
        np.testing.assert_array_equal(one.extent.low, other.extent.low)
        np.testing.assert_array_equal(one.extent.high, other.extent.high)
        assert_same_surface(one.surface, other.surface)
        assert_same_tracks(one.tracks, other.tracks)


def test_stored_segments_have_the_frame_rate_of_the_options(path):
    result, expected = opened(path, fps=50), meshreel.load(path, fps=50)
    assert [segment.start_s for segment in result.segments] == [0, 4 / 50, 7 / 50]
    assert result.fps == expected.fps == 50


@pytest.mark.parametrize(("surplus", "is_stored"), [(0, False), (-1, True)])
def test_segments_are_stored_above_max_loaded_bytes(path, surplus, is_stored):
    expected = meshreel.load(path)
    size = sum(segment.read(0, segment.n_frames).nbytes for segment in expected.segments)
    result = open_any(find_files(path), ReadOptions(max_loaded_bytes=size + surplus))
    assert isinstance(result.segments[0], StoredSegment) == is_stored


def test_stored_segments_have_the_selected_attributes(path):
    result = opened(path, attributes="none")
    assert any(segment.surface.attributes for segment in opened(path).segments)
    assert not any(segment.surface.attributes for segment in result.segments)
    with pytest.raises(InvalidInputError, match=r"a\.reel: has no attribute or group 'skin'"):
        opened(path, attributes="skin")


@pytest.mark.slow
def test_few_segments_are_decoded_at_a_time_while_a_file_is_written(tmp_path, monkeypatch):
    grids = [waving_grid(2, 4 + number, 5) for number in range(12)]
    data = meshreel.encode(meshreel.concatenate(grids), lossless=True)
    (tmp_path / "a.reel").write_bytes(data)
    counts, alive, initialize = [], WeakSet(), ReelFile.__init__

    def initialize_noted(reel, *args, **options):
        alive.add(reel)
        initialize(reel, *args, **options)

    def count(_stage, _share):
        if len(alive) > MAX_OPEN_SEGMENTS + 1:
            gc.collect()
        counts.append(len(alive))

    monkeypatch.setattr(ReelFile, "__init__", initialize_noted)
    meshreel.save(opened(tmp_path / "a.reel"), tmp_path / "f_%02d.ply", progress=count)
    assert 1 <= max(counts) <= MAX_OPEN_SEGMENTS + 1
    assert len(counts) >= 24


def test_an_incomplete_file_is_refused_when_it_is_opened(path):
    data = path.read_bytes()
    path.write_bytes(data[:-20])
    with pytest.raises(TruncatedStreamError, match=r"a\.reel: "):
        opened(path)
    path.write_bytes(data + b"more")
    with pytest.raises(CorruptStreamError, match=r"a\.reel: bytes follow"):
        opened(path)


def test_a_damaged_segment_is_named_with_its_file_when_it_is_read(path):
    data = bytearray(path.read_bytes())
    with meshreel.open(path) as reel:
        last = reel.segments[2]
        middle = last._opened.file.block(0).offset + last._opened.file.block(0).size_bytes - 8
    data[middle] ^= 255
    path.write_bytes(data)
    result = opened(path)
    assert result.segments[0].read(0, 1).shape[0] == 1
    with pytest.raises(CorruptStreamError, match=r"a\.reel: "):
        result.segments[2].read(0, 1)


@pytest.mark.slow
@pytest.mark.parametrize(("limit", "n_decodings"), [(1 << 26, 1), (0, 3)])
def test_meshes_are_decoded_once_if_they_are_small(path, tmp_path, monkeypatch, limit, n_decodings):
    monkeypatch.setattr(frame_stream, "MAX_KEPT_BYTES", limit)
    monkeypatch.setattr(reel_file, "MAX_OPEN_SEGMENTS", 1)
    surface_of, numbers = vars(StoredSegment)["surface"].fget, []

    def counted(segment):
        numbers.append(segment.number)
        return surface_of(segment)

    sequence = opened(path)
    monkeypatch.setattr(StoredSegment, "surface", property(counted))
    meshreel.save(sequence, tmp_path / "a.vtkhdf", notes=[])
    assert max(np.bincount(numbers)) <= n_decodings + 1
    assert min(np.bincount(numbers)) >= n_decodings
    loaded = meshreel.load(tmp_path / "a.vtkhdf")
    for one, other in zip(loaded, meshreel.load(path), strict=True):
        np.testing.assert_array_equal(one.vertices, other.vertices)
