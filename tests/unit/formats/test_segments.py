import numpy as np
import pytest

import meshreel
from meshreel.errors import InvalidInputError
from meshreel.formats.load import load
from meshreel.formats.options import ReadOptions
from meshreel.formats.save import save
from meshreel.formats.segments import find_segments
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Attribute, Domain, Kind, Surface
from meshreel.model.tracks import Track
from samples.datasets import positions_of
from samples.meshes import quad_sheet, waving_grid
from samples.tracks import assert_same_tracks


@pytest.fixture
def changing(tmp_path):
    """Write three frames of one mesh and two of another into a folder."""
    save(waving_grid(3), tmp_path / "a_%02d.ply")
    save(quad_sheet(2), tmp_path / "b_%02d.ply")
    return tmp_path


def test_changing_faces_begin_a_new_segment(changing):
    first, second = find_segments(changing, ReadOptions(fps=10))
    assert (first.start, first.stop, second.start, second.stop) == (0, 3, 3, 5)
    np.testing.assert_array_equal(positions_of(first.open()), waving_grid(3).vertices)
    np.testing.assert_array_equal(positions_of(second.open()), quad_sheet(2).vertices)
    assert (second.open().start_s, second.open().fps) == (0.3, 10)


def test_progress_counts_the_frames_of_all_segments(changing):
    stages = {}

    def progress(stage, share):
        stages.setdefault(stage, []).append((share.done, share.total))

    load(changing, progress=progress)
    assert stages["reading"][-4:] == [(one, 5) for one in range(2, 6)]


def test_segment_paths_have_frame_ranges(changing, tmp_path):
    first, second = find_segments(changing, ReadOptions())
    assert first.path(tmp_path / "walk.reel").name == "walk_0-2.reel"
    assert second.path(tmp_path / "walk.reel").name == "walk_3-4.reel"


def test_constant_faces_give_one_segment(tmp_path):
    save(waving_grid(4), tmp_path / "a.npz")
    (segment,) = find_segments(tmp_path / "a.npz", ReadOptions())
    assert (segment.start, segment.stop) == (0, 4)
    np.testing.assert_array_equal(positions_of(segment.open()), waving_grid(4).vertices)


def test_missing_source_of_segments_is_an_error(tmp_path):
    with pytest.raises(InvalidInputError, match="there is no file"):
        find_segments(tmp_path / "none.abc", ReadOptions())


@pytest.mark.parametrize("extension", [".ply", ".vtp"])
def test_each_segment_has_its_tracks(tmp_path, extension):
    rng = np.random.default_rng(4)
    wholes = []
    for name, sheet in (("a", waving_grid(3)), ("b", quad_sheet(2))):
        heat = rng.random((sheet.n_frames, sheet.n_verts)).astype(np.float32)
        wholes.append(sheet.replace(tracks={"heat": Track(heat)}))
        save(wholes[-1], tmp_path / f"{name}_%02d{extension}")
    found = [one.open() for one in find_segments(tmp_path, ReadOptions())]
    for one, whole in zip(found, wholes, strict=True):
        assert_same_tracks(one.tracks, whole.tracks)


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


def test_frames_in_another_order_are_matched_by_texture_coordinates(reordered):
    notes = []
    sequence = load(reordered, notes=notes)
    assert sequence.starts == (0, 4)
    assert not sequence.segments[0].surface.is_ordered
    assert any("matched 4 segments that differ only in the order" in note for note in notes)
    assert load(reordered, attributes="none").segments[0].surface.attributes == ()


@pytest.mark.filterwarnings("ignore:the faces change", "ignore:matched 4 segments")
@pytest.mark.parametrize(("order", "n_segments"), [(None, 1), ("drop", 1), ("keep", 4)])
def test_frames_are_not_matched_if_their_order_is_to_be_kept(reordered, order, n_segments):
    data = meshreel.encode(reordered, **({} if order is None else {"order": order}))
    found = meshreel.info(data)
    assert max(1, len(found.segments)) == n_segments
    assert found.order == (order or "drop")
