"""Sequences whose faces change, written and read back."""

from dataclasses import replace

import numpy as np
import pytest

import meshreel
from meshreel.errors import ConnectivityChangeError
from meshreel.model.tracks import Track
from samples.datasets import positions_of
from samples.meshes import assert_same_surface, quad_sheet, waving_grid
from samples.tracks import assert_same_tracks

FPS = 25.0


def with_heat(sequence, seed):
    rng = np.random.default_rng(seed)
    heat = rng.random((sequence.n_frames, sequence.n_verts)).astype(np.float32)
    return replace(sequence, fps=FPS, tracks={"heat": Track(heat)})


@pytest.fixture
def changing():
    """Three segments of a grid, a sheet of quads and the grid again, with a track each."""
    grid = waving_grid(4)
    meshes = [grid, quad_sheet(3), replace(grid, vertices=2 * grid.vertices[:1])]
    return meshreel.concatenate(
        [with_heat(replace(one, name="mesh"), seed) for seed, one in enumerate(meshes)]
    )


def assert_same_frames(found, expected, *, atol=0.0):
    assert found.starts == expected.starts
    for one, other in zip(found.segments, expected.segments, strict=True):
        np.testing.assert_array_equal(one.faces, other.faces)
        np.testing.assert_allclose(positions_of(one), positions_of(other), rtol=0, atol=atol)


def assert_data_as_of_single_segments(found, expected, folder, output):
    """Assert that each segment has the surface and tracks of a file of that segment alone."""
    for number, (one, segment) in enumerate(zip(found.segments, expected.segments, strict=True)):
        alone = folder / f"alone{number}"
        alone.mkdir()
        meshreel.save(segment, alone / output)
        is_pattern = "%" in output
        other = meshreel.load(alone if is_pattern else alone / output, fps=FPS)
        assert_same_surface(one.surface, other.surface)
        assert_same_tracks(one.tracks, other.tracks)


@pytest.mark.parametrize("extension", [".ply", ".obj", ".vtp", ".vtu", ".off"])
def test_frame_files_have_the_mesh_of_their_segment(changing, tmp_path, extension):
    written = meshreel.save(changing, tmp_path / f"f_%02d{extension}")
    assert len(written) == changing.n_frames
    found = meshreel.load_segments(str(tmp_path / f"f_*{extension}"), fps=FPS)
    assert_same_frames(found, changing)
    assert_data_as_of_single_segments(found, changing, tmp_path, f"f_%02d{extension}")


def test_stl_files_have_the_triangles_of_their_segment(changing, tmp_path):
    written = meshreel.save(changing, tmp_path / "f_%02d.stl")
    for path, frame in zip(written, changing, strict=True):
        corners = meshreel.load(path)
        np.testing.assert_array_equal(
            corners.vertices[0][corners.faces], frame.vertices[frame.faces]
        )


@pytest.mark.parametrize("extension", [".npz", ".mdd", ".pc2", ".h5", ".vat"])
def test_formats_with_constant_faces_refuse_changes(changing, tmp_path, extension):
    message = r"8 frames in 3 segments.*--split.*one file per frame"
    with pytest.raises(ConnectivityChangeError, match=message):
        meshreel.save(changing, tmp_path / f"a{extension}")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("extension", [".npz", ".mdd"])
def test_frames_of_one_segment_are_written_in_any_format(changing, tmp_path, extension):
    meshreel.save(changing[4:7], tmp_path / f"a{extension}")
    found = meshreel.load(tmp_path / f"a{extension}")
    np.testing.assert_array_equal(found.vertices, changing.segments[1].vertices)


def test_reel_has_a_segment_for_each(changing, tmp_path):
    notes = []
    meshreel.save(changing, tmp_path / "a.reel", notes=notes)
    assert_same_frames(meshreel.decode_segments(tmp_path / "a.reel"), changing, atol=0.02)
    assert any("encoded with a largest error of" in note for note in notes)


def test_segments_of_a_reel_are_written_without_loading_all(changing, tmp_path):
    data = meshreel.encode(changing, lossless=True)
    (tmp_path / "a.reel").write_bytes(data)
    with meshreel.open_segments(tmp_path / "a.reel") as reel:
        meshreel.save(reel, tmp_path / "f_%d.ply")
    found = meshreel.load_segments(str(tmp_path / "f_*.ply"), fps=FPS)
    assert_same_frames(found, changing)


def test_progress_counts_the_frames_of_all_segments(changing, tmp_path):
    shares = []
    meshreel.save(changing, tmp_path / "f_%d.ply", progress=lambda _, share: shares.append(share))
    assert [share.done for share in shares if hasattr(share, "done")] == [*range(1, 9)]


def test_notes_name_what_is_left_out_once(changing, tmp_path):
    notes = []
    meshreel.save(changing, tmp_path / "f_%d.stl", notes=notes)
    assert len(notes) == len(set(notes)) > 0
