import numpy as np
import pytest

import meshreel
from meshreel.formats.load import load
from meshreel.formats.save import save
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Attribute, Domain, Kind, Surface
from meshreel.model.timing import Timing
from meshreel.model.tracks import Track
from samples.meshes import quad_sheet, waving_grid
from samples.tracks import assert_same_tracks


@pytest.fixture
def changing(tmp_path):
    """Write three frames of one mesh and two of another into a folder."""
    save(waving_grid(3), tmp_path / "a_%02d.ply")
    save(quad_sheet(2), tmp_path / "b_%02d.ply")
    return tmp_path


def test_changing_faces_begin_a_new_segment(changing):
    sequence = load(changing, fps=10)
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


@pytest.mark.parametrize("extension", [".ply", ".vtp"])
def test_each_segment_has_its_tracks(tmp_path, extension):
    rng = np.random.default_rng(4)
    wholes = []
    for name, sheet in (("a", waving_grid(3)), ("b", quad_sheet(2))):
        heat = rng.random((sheet.n_frames, sheet.n_verts)).astype(np.float32)
        wholes.append(sheet.replace(tracks={"heat": Track(heat)}))
        save(wholes[-1], tmp_path / f"{name}_%02d{extension}")
    for segment, whole in zip(load(tmp_path).segments, wholes, strict=True):
        assert_same_tracks(segment.tracks, whole.tracks)


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
    assert any("matched 4 segments that differ only in the order" in note for note in notes)
    assert load(reordered, attributes="none").segments[0].surface.attributes == ()


@pytest.mark.filterwarnings("ignore:the faces change", "ignore:matched 4 segments")
@pytest.mark.parametrize(("order", "n_segments"), [(None, 1), ("drop", 1), ("keep", 4)])
def test_frames_are_not_matched_if_their_order_is_to_be_kept(reordered, order, n_segments):
    data = meshreel.encode(reordered, **({} if order is None else {"order": order}))
    info = meshreel.info(data)
    assert max(1, len(info.segments)) == n_segments
    assert info.order == (order or "drop")
