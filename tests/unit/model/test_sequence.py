import pickle
from copy import deepcopy

import numpy as np
import pytest

import meshreel
from meshreel.errors import InvalidInputError
from meshreel.model.cells import Cells
from meshreel.model.extent import extent_of
from meshreel.model.sequence import MeshSequence, concatenate, positions_size_bytes, single_segment
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Surface
from meshreel.model.tracks import Track
from samples.meshes import quad_sheet, waving_grid

FACES = np.array([[0, 1, 2]])
VERTICES = np.zeros((2, 3, 3))


@pytest.fixture
def given_arrays():
    """Arrays of a sequence with everything that has arrays; a view is read-only in name alone."""
    sheet = quad_sheet(4)
    arrays = {
        "vertices": np.array(sheet.vertices),
        "faces": np.array(sheet.faces),
        "times": np.array([0.0, 1.0, 3.0, 4.0]),
        "track": np.ones((4, sheet.n_verts)),
        "face_sizes": np.array(sheet.surface.face_sizes),
        "values": np.ones((sheet.n_verts, 3), np.float32),
        "numbers": np.zeros(sheet.surface.n_faces(sheet.n_faces), np.int32),
        "hard_edges": np.array([[0, 1]]),
    }
    return arrays | {"track": np.broadcast_to(arrays["track"][0], arrays["track"].shape)}


def sequence_of(arrays):
    surface = Surface(
        face_sizes=arrays["face_sizes"],
        attributes=(Attribute("color", Kind.COLOR, Domain.VERTEX, arrays["values"]),),
        groups=(FaceGroups("material", ("skin",), arrays["numbers"]),),
        hard_edges=arrays["hard_edges"],
    )
    return MeshSequence(
        *(arrays["vertices"], arrays["faces"]),
        surface=surface,
        tracks={"heat": arrays["track"]},
        times=arrays["times"],
    )


def arrays_of(sequence):
    surface = sequence.surface
    return {
        "vertices": sequence.vertices,
        "faces": sequence.faces,
        "times": sequence.times,
        "track": sequence.tracks["heat"].values[..., 0],
        "face_sizes": surface.face_sizes,
        "values": surface.attributes[0].values,
        "numbers": surface.groups[0].numbers,
        "hard_edges": surface.hard_edges,
    }


def test_a_caller_who_changes_his_arrays_does_not_change_the_sequence(given_arrays):
    sequence = sequence_of(given_arrays)
    before = {name: array.copy() for name, array in given_arrays.items()}
    for array in given_arrays.values():
        owner = array if array.flags.writeable else array.base
        owner += 1
    for name, array in arrays_of(sequence).items():
        np.testing.assert_array_equal(array, before[name], name)
    types, nodes = np.full(1, 10), np.arange(4)
    cells = MeshSequence(np.eye(4, 3)[None], cells=Cells(types, nodes)).surface.cells
    types[0], nodes[0] = 5, 3
    assert (cells.types[0], cells.nodes[0]) == (10, 0)


@pytest.mark.parametrize("copied", [lambda s: s, deepcopy, lambda s: pickle.loads(pickle.dumps(s))])
def test_arrays_are_read_only_in_copies_too(given_arrays, copied):
    for name, array in arrays_of(copied(sequence_of(given_arrays))).items():
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
        with pytest.raises(ValueError, match="cannot set WRITEABLE"):
            array.view().flags.writeable = True
        assert given_arrays[name].size == array.size


def test_arrays_that_nobody_can_write_are_not_copied():
    mine = VERTICES.copy()
    mine.flags.writeable = False
    assert np.shares_memory(MeshSequence(mine, FACES).vertices, mine)
    sequence = MeshSequence(VERTICES, FACES)
    assert np.shares_memory(sequence.replace(fps=3)[1:].vertices, sequence.vertices)
    decoded = meshreel.decode(meshreel.encode(sequence))
    assert np.shares_memory(decoded[1:].vertices, decoded.vertices)


@pytest.mark.parametrize("sequence", [waving_grid(2), concatenate([waving_grid()] * 2)])
def test_no_attribute_can_be_assigned(sequence):
    for name in ("vertices", "tracks", "fps", "name"):
        with pytest.raises(AttributeError, match=rf"use sequence\.replace\({name}=\.\.\.\)"):
            setattr(sequence, name, 0)
    with pytest.raises(AttributeError, match=r"use sequence\.replace\(\.\.\.\), which"):
        sequence.n_frames = 3
    with pytest.raises(AttributeError, match="does not change"):
        del sequence.name
    track = Track(np.zeros((2, 5)))
    with pytest.raises(AttributeError, match="cannot assign"):
        track.values = np.zeros((2, 6))
    with pytest.raises(TypeError, match="does not support item assignment"):
        waving_grid().tracks["heat"] = track


def test_raw_size_counts_positions_and_faces_when_float32():
    assert MeshSequence(VERTICES.astype(np.float32), FACES).raw_size_bytes == 2 * 3 * 3 * 4 + 12


def test_raw_size_counts_tracks_and_the_surface_once():
    uv = Attribute("uv", Kind.UV, Domain.VERTEX, np.zeros((3, 2), np.float32))
    surface = Surface(attributes=(uv,))
    tracks = {"heat": np.zeros((2, 3)), "on": np.zeros((2, 1, 4), np.uint8)}
    sequence = MeshSequence(VERTICES, FACES, surface=surface, tracks=tracks)
    assert sequence.raw_size_bytes == (2 * 3 * 3 * 8 + 12) + 3 * 2 * 4 + (2 * 3 * 8 + 2 * 4)


@pytest.mark.parametrize(
    ("vertices", "faces", "fps", "message"),
    [
        (np.zeros((120, 2904)), FACES, 0, r"shape \(T, V, 3\); got \(120, 2904\)"),
        (np.zeros((2, 3, 3), int), FACES, 0, "float32 or float64; got int64"),
        (np.zeros((2, 3, 3), np.float16), FACES, 0, "got float16"),
        (np.zeros((0, 3, 3)), FACES, 0, "at least one frame"),
        (np.zeros((2, 0, 3)), FACES, 0, "at least one vertex"),
        (np.zeros((2, 2, 3)), np.zeros((0, 3), int), 0, "2 vertices without faces"),
        (VERTICES, [[0, 1, 3]], 0, r"face 0 is \[0, 1, 3\]; indices must be in 0..2, .* V = 3"),
        (VERTICES, [[0, 1, 2], [0, -1, 2]], 0, r"face 1 is \[0, -1, 2\]"),
        (VERTICES, [[0, 1, 2, 0]], 0, r"shape \(M, 3\); got \(1, 4\)"),
        (VERTICES, [[0.0, 1.0, 2.0]], 0, "faces must be integers; got float64"),
        (VERTICES, FACES, -1, "fps must be finite and at least 0"),
        (VERTICES, FACES, float("nan"), "fps must be finite"),
    ],
)
def test_error_says_why_a_sequence_is_invalid(vertices, faces, fps, message):
    with pytest.raises(InvalidInputError, match=message):
        MeshSequence(vertices, np.asarray(faces), fps)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_error_names_frame_and_vertex_of_a_value_that_is_not_finite(bad):
    vertices = np.zeros((4, 3, 3))
    vertices[2, 1, 1] = bad
    with pytest.raises(InvalidInputError, match=f"vertex 1 of frame 2 has y = {bad}"):
        MeshSequence(vertices, FACES)


@pytest.mark.parametrize("n_verts", [1, 127, 128, 1000])
def test_extent_of_all_frames_combines_those_of_single_frames(n_verts):
    rng = np.random.default_rng(n_verts)
    vertices = rng.normal(size=(3, n_verts, 3)) * 10.0 ** rng.integers(-3, 3, (3, 1, 1))
    extent = extent_of(vertices)
    diagonals = [np.linalg.norm(frame.max(axis=0) - frame.min(axis=0)) for frame in vertices]
    np.testing.assert_array_equal(extent.low, vertices.min(axis=(0, 1)))
    np.testing.assert_array_equal(extent.high, vertices.max(axis=(0, 1)))
    assert extent.mean_diagonal == pytest.approx(np.mean(diagonals), rel=1e-12)


def test_extent_does_not_overflow_when_coordinates_are_huge():
    vertices = np.array([[[-1.5e308, 0.0, 0.0], [0.0, 0.0, 0.0]], [[-1e308, 0, 0], [1e308, 0, 0]]])
    assert extent_of(vertices[:1]).mean_diagonal == 1.5e308
    assert extent_of(vertices).mean_diagonal == 1.75e308


def test_positions_size_is_that_of_the_array_when_in_memory():
    sequence = MeshSequence(VERTICES, FACES)
    assert positions_size_bytes(sequence) == sequence.vertices.nbytes


def test_extent_does_not_underflow_when_coordinates_are_tiny():
    vertices = np.array([[[0.0, 0.0, 0.0], [3e-200, 4e-200, 0.0]]])
    assert extent_of(vertices).mean_diagonal == pytest.approx(5e-200, rel=1e-12)


def test_errors_of_shapes_say_how_to_pass_the_array():
    vertices, faces = np.zeros((2, 4, 3)), [[0, 1, 2], [1, 2, 3]]
    assert MeshSequence(vertices, faces).shape == (2, 4, 3)
    with pytest.raises(InvalidInputError, match=r"got \(4, 3\); .* pass vertices\[None\]"):
        MeshSequence(vertices[0], faces)
    with pytest.raises(InvalidInputError, match=r"pass vertices\.swapaxes\(0, 1\)"):
        MeshSequence(vertices.swapaxes(0, 1), faces)
    with pytest.raises(InvalidInputError, match=r"face 1 is \[1, 2, 9\].* have V = 4$"):
        MeshSequence(vertices, [[0, 1, 2], [1, 2, 9]])


GRID, SHEET = waving_grid(3).replace(fps=25.0), quad_sheet(4).replace(fps=25.0)


def test_frames_are_numbered_across_segments():
    sequence = concatenate([GRID]) + SHEET
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


def test_extent_is_the_box_of_all_segments():
    moved = SHEET.replace(vertices=SHEET.vertices + np.float32(100))
    extent = concatenate([GRID, moved]).extent
    np.testing.assert_array_equal(extent.low, GRID.extent.low)
    np.testing.assert_array_equal(extent.high, moved.extent.high)
    mean = (3 * GRID.extent.mean_diagonal + 4 * moved.extent.mean_diagonal) / 7
    assert extent.mean_diagonal == pytest.approx(mean)


def test_number_type_is_the_finest_of_all_segments():
    fine = SHEET.replace(vertices=SHEET.vertices.astype(np.float64))
    assert {concatenate(pair).dtype for pair in ([GRID, fine], [fine, GRID])} == {fine.dtype}


def test_segments_need_one_frame_rate():
    with pytest.raises(InvalidInputError, match="24 and 25 frames per second"):
        concatenate([GRID, SHEET.replace(fps=24.0, start_s=0.0)])
    with pytest.raises(InvalidInputError, match="at least one segment"):
        MeshSequence.of_segments([])


def test_a_slice_backwards_reverses_segments_times_and_velocities():
    values = np.arange(float(3 * GRID.n_verts * 3)).reshape(3, -1, 3)
    moving = GRID.replace(tracks={"v": Track(values, kind="velocity"), "a": values})
    part = concatenate([SHEET, moving])[:1:-2]
    assert part.starts == (0, 2, 3)
    first, second = (MeshSequence.of_segments([segment]) for segment in part.segments)
    np.testing.assert_array_equal(second.times, part.times[2:])
    np.testing.assert_array_equal(first.times, part.times[:2])
    for name, sign in (("v", -1), ("a", 1)):
        np.testing.assert_array_equal(first.tracks[name].read(0, 2), sign * values[::-2])
    np.testing.assert_array_equal(second.vertices, SHEET.vertices[2:3])


def test_an_array_of_a_sequence_is_its_positions():
    assert np.asarray(GRID) is GRID.vertices
    assert np.asarray(GRID, np.float64).tolist() == GRID.vertices.tolist()
    with pytest.raises(meshreel.ConnectivityChangeError, match=r"sequence.segments\[0\].vertices"):
        np.asarray(concatenate([GRID, SHEET]))


def test_slices_without_a_frame_and_missing_frames_are_rejected():
    sequence = concatenate([GRID, SHEET])
    with pytest.raises(InvalidInputError, match="select no frame"):
        sequence[5:5]
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
    with pytest.raises(InvalidInputError, match="no parameter 'color'; it has faces, fps"):
        whole.replace(color=1)
