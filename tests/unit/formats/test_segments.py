import gc
from weakref import WeakSet

import numpy as np
import pytest

import meshreel
from meshreel.codec import reel_file
from meshreel.codec.reel_file import MAX_OPEN_SEGMENTS, ReelFile
from meshreel.errors import CorruptStreamError, InvalidInputError, TruncatedStreamError
from meshreel.formats.frames import frame_stream
from meshreel.formats.frames.stored_frames import StoredFrames
from meshreel.formats.load import load
from meshreel.formats.options import Reading
from meshreel.formats.segments import _describe_match as describe_match
from meshreel.formats.segments import open_any
from meshreel.formats.sources import find_files
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Attribute, Domain, Kind, Surface
from meshreel.model.timing import Timing
from meshreel.model.tracks import Track
from meshreel.operations.save import save
from samples.meshes import assert_same_surface, quad_sheet, waving_grid
from samples.tracks import assert_same_tracks


@pytest.fixture
def changing(tmp_path):
    """Write three frames of one mesh and two of another into a folder."""
    save(waving_grid(3), tmp_path / "a_%02d.ply")
    save(quad_sheet(2), tmp_path / "b_%02d.ply")
    return tmp_path


def test_changing_faces_begin_a_new_segment(changing, notes):
    sequence = load(changing, fps=10, notes=notes)
    assert notes == ["the faces change: 5 frames in 2 segments of constant connectivity"]
    assert sequence.starts == (0, 3, 5)
    first, second = sequence.segments
    np.testing.assert_array_equal(first.read(0, 3), waving_grid(3).vertices)
    np.testing.assert_array_equal(second.read(0, 2), quad_sheet(2).vertices)
    assert second.timing == Timing(10, 0.3)


def test_progress_counts_the_frames_of_all_segments(changing):
    stages = {}

    def progress(stage, share):
        stages.setdefault(stage, []).append((share.done, share.total))

    load(changing, progress=progress)
    assert stages["reading"][-4:] == [(n_read, 5) for n_read in range(2, 6)]


@pytest.fixture
def reordered(tmp_path):
    """Write a mesh in motion with texture coordinates, its faces in another order in each file."""
    sheet, rng = waving_grid(4), np.random.default_rng(3)
    uvs = rng.random((sheet.n_verts, 2)).astype(np.float32)
    for number in range(4):
        faces = rng.permutation(sheet.faces)
        surface = Surface(attributes=(Attribute("uv", Kind.UV, Domain.CORNER, uvs, faces.ravel()),))
        frame = MeshSequence(sheet.vertices[number : number + 1], faces, surface=surface)
        save(frame, tmp_path / f"{number}_%d.obj")
    return tmp_path


def test_frames_in_another_order_are_matched_by_texture_coordinates(reordered, notes):
    sequence = load(reordered, notes=notes)
    assert sequence.starts == (0, 4)
    assert not sequence.segments[0].surface.is_ordered
    assert notes[1:] == [
        "matched 4 segments that differ only in the order of vertices and faces, which leaves 1 "
        "segment"
    ]
    assert load(reordered, attributes="none").segments[0].surface.attributes == ()


def test_a_note_counts_the_faces_that_complete_matched_segments():
    lacking = waving_grid(3).replace(faces=waving_grid(3).faces[2:])
    text = describe_match([lacking, waving_grid(2)], [waving_grid(5)])
    assert text.endswith("leaves 1 segment; 6 faces that add no area complete them")


@pytest.mark.filterwarnings("ignore:the faces change", "ignore:matched 4 segments")
@pytest.mark.parametrize(("order", "n_segments"), [(None, 1), ("drop", 1), ("keep", 4)])
def test_frames_are_not_matched_if_their_order_is_to_be_kept(reordered, order, n_segments):
    data = meshreel.encode(reordered, **({} if order is None else {"order": order}))
    info = meshreel.info(data)
    assert max(1, len(info.segments)) == n_segments
    assert info.order == (order or "drop")


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
    return open_any(find_files(path), Reading(max_loaded_bytes=0, **options))


def test_stored_segments_are_those_that_load_decodes(path):
    result, expected = opened(path), meshreel.load(path)
    assert all(isinstance(segment, StoredFrames) for segment in result.segments)
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
    result = open_any(find_files(path), Reading(max_loaded_bytes=size + surplus))
    assert isinstance(result.segments[0], StoredFrames) == is_stored


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
    monkeypatch.setattr(frame_stream, "MAX_CACHED_BYTES", limit)
    monkeypatch.setattr(reel_file, "MAX_OPEN_SEGMENTS", 1)
    surface_of, numbers = vars(ReelFile)["surface"].fget, []

    def counted(segment):
        numbers.append(segment._number)
        return surface_of(segment)

    sequence = opened(path)
    monkeypatch.setattr(ReelFile, "surface", property(counted))
    meshreel.save(sequence, tmp_path / "a.vtkhdf", notes=[])
    assert max(np.bincount(numbers)) <= n_decodings + 1
    assert min(np.bincount(numbers)) >= n_decodings
    loaded = meshreel.load(tmp_path / "a.vtkhdf")
    for one, other in zip(loaded, meshreel.load(path), strict=True):
        np.testing.assert_array_equal(one.vertices, other.vertices)
