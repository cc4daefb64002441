import numpy as np
import pytest

import meshreel
from meshreel.errors import InvalidInputError
from meshreel.model.sequence import MeshSequence, concatenate, single_segment
from meshreel.model.tracks import Track
from samples.meshes import quad_sheet, waving_grid

GRID, SHEET = waving_grid(3).replace(fps=25.0), quad_sheet(4).replace(fps=25.0)


def test_frames_are_numbered_across_segments():
    sequence = concatenate([GRID, SHEET])
    assert (len(sequence), sequence.n_segments, sequence.starts) == (7, 2, (0, 3, 7))
    for number in range(7):
        segment, local = (GRID, number) if number < 3 else (SHEET, number - 3)
        frame = sequence[number]
        np.testing.assert_array_equal(frame.vertices, segment.vertices[local])
        assert frame.faces is segment.faces
    assert [len(vertices) for vertices, _ in sequence] == 3 * [GRID.n_verts] + 4 * [SHEET.n_verts]
    np.testing.assert_array_equal(sequence[-1].vertices, SHEET.vertices[-1])


def test_slices_cut_segments_and_keep_time_and_tracks():
    heat = Track(np.arange(GRID.n_verts * 3.0).reshape(3, -1).astype(np.float32))
    sequence = concatenate([GRID.replace(tracks={"heat": heat}), SHEET])
    part = sequence[2:5]
    assert (part.starts, part.start_s) == ((0, 1, 3), 2 / 25)
    np.testing.assert_array_equal(part.segments[0].tracks["heat"].read(0, 1), heat.values[2:3])
    assert part[:1].segments[0].n_frames == 1


def test_addition_appends_sequences():
    sequence = concatenate([GRID]) + SHEET + GRID
    assert [segment.n_verts for segment in sequence.segments] == [
        GRID.n_verts,
        SHEET.n_verts,
        GRID.n_verts,
    ]


def test_extent_is_the_box_of_all_segments():
    moved = SHEET.replace(vertices=SHEET.vertices + np.float32(100))
    extent = concatenate([GRID, moved]).extent
    np.testing.assert_array_equal(extent.low, GRID.extent.low)
    np.testing.assert_array_equal(extent.high, moved.extent.high)
    mean = (3 * GRID.extent.mean_diagonal + 4 * moved.extent.mean_diagonal) / 7
    assert extent.mean_diagonal == pytest.approx(mean)


def test_segments_need_one_frame_rate():
    with pytest.raises(InvalidInputError, match="24 and 25 frames per second"):
        concatenate([GRID, SHEET.replace(fps=24.0)])
    with pytest.raises(InvalidInputError, match="at least one segment"):
        MeshSequence.of_segments([])


def test_slices_with_a_step_or_no_frame_are_rejected():
    sequence = concatenate([GRID, SHEET])
    for chosen in (slice(0, 7, 2), slice(5, 5)):
        with pytest.raises(InvalidInputError, match=r"no step|select no frame"):
            sequence[chosen]
    with pytest.raises(IndexError, match="there is no frame 7"):
        sequence[7]


def test_single_segment_rejects_changing_faces():
    with pytest.raises(meshreel.ConnectivityChangeError, match="7 frames in 2 segments; plotting"):
        single_segment(concatenate([GRID, SHEET]), "plotting")
    assert single_segment(concatenate([GRID]), "plotting") is GRID


def test_replace_names_what_several_segments_do_not_have():
    whole = concatenate([GRID, SHEET])
    assert whole.replace(fps=50.0, name="both").fps == 50.0
    with pytest.raises(meshreel.ConnectivityChangeError, match=r"segments\[0\]\.surface"):
        whole.replace(surface=SHEET.surface)
    with pytest.raises(TypeError, match="unexpected argument 'color'"):
        whole.replace(color=1)
