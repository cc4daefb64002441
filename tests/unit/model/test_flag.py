import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.model.flag import simulate_flag
from meshreel.model.geometry.connectivity import boundary_edges, component_labels, undirected_edges
from meshreel.model.geometry.normals import face_normals
from samples.costs import slow_but

SMALL = {"n_rows": 14, "n_columns": 20}


@pytest.fixture(scope="module", params=slow_but([28], [28, 52]))
def side(request):
    """Rows and columns of a flag."""
    return request.param


@pytest.fixture(scope="module")
def flag(side):
    return simulate_flag(100, n_rows=side, n_columns=side)


@pytest.fixture(scope="module")
def small_flag():
    return simulate_flag(20, **SMALL)


def edge_lengths(flag, positions):
    edges = undirected_edges(flag.faces)
    return np.linalg.norm(positions[..., edges[:, 0], :] - positions[..., edges[:, 1], :], axis=-1)


def rest_positions(n_rows, n_columns):
    y, x = np.meshgrid(np.linspace(1, 0, n_rows), np.linspace(0, 1.5, n_columns), indexing="ij")
    return np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)


def test_longer_flag_begins_with_the_shorter_one(small_flag):
    shorter = simulate_flag(8, **SMALL)
    np.testing.assert_array_equal(shorter.vertices, small_flag.vertices[:8])


@pytest.mark.slow
def test_simulate_flag_keeps_the_pole_at_rest(flag, side):
    pole = flag.vertices[:, ::side]
    np.testing.assert_array_equal(pole, np.broadcast_to(pole[0], pole.shape))


@pytest.mark.slow
def test_simulate_flag_stretches_no_edge_by_a_tenth_and_compresses_none_by_a_fifth(flag, side):
    stretch = edge_lengths(flag, flag.vertices) / edge_lengths(flag, rest_positions(side, side))
    assert 0.8 < stretch.min() <= stretch.max() < 1.1


@pytest.mark.slow
@pytest.mark.parametrize("first", [0, 60])
def test_simulate_flag_moves_its_whole_free_edge_also_late(flag, side, first):
    free_edge = flag.vertices[first:, side - 1 :: side]
    assert np.linalg.norm(np.ptp(free_edge, axis=0), axis=1).min() > 0.2


def test_simulate_flag_moves_without_jitter(flag):
    velocity = np.diff(flag.vertices.astype(float), axis=0)
    turn = np.diff(velocity, axis=0)
    assert np.square(turn).mean() < np.square(velocity).mean()


def test_simulate_flag_stays_within_its_diagonal(flag):
    to_corner = np.linalg.norm(flag.vertices - flag.vertices[0, 0], axis=2)
    assert to_corner.max() < 1.02 * np.hypot(1.5, 1.0)


def test_simulate_flag_has_several_folds_along_its_diagonal(flag, side):
    """The diagonal from the lower pole corner crosses ridges and valleys."""
    grid = flag.vertices[30:, :, 2].reshape(-1, side, side)
    slope = np.diff(grid[:, np.arange(side)[::-1], np.arange(side)], axis=1)
    ridges_and_valleys = (np.diff(np.sign(slope), axis=1) != 0).sum(axis=1)
    assert np.median(ridges_and_valleys) >= 4


def test_simulate_flag_is_one_sheet(flag, side):
    assert component_labels(flag.faces, flag.n_verts).max() + 1 == 1
    assert len(boundary_edges(flag.faces)) == 4 * (side - 1)


def test_simulate_flag_has_consistent_orientation():
    flat = simulate_flag(1, **SMALL)
    assert (face_normals(flat.vertices[0], flat.faces)[:, 2] > 0).all()


def test_simulate_flag_has_float32_positions_at_30_fps_by_default():
    flag = simulate_flag(1)
    assert (flag.vertices.dtype, flag.n_verts, flag.n_faces) == (np.float32, 2704, 5202)
    assert (flag.fps, flag.name) == (30.0, "flag")


@pytest.mark.parametrize("shape", [(3, 3), (120, 5), (31, 4), (3, 40), (8, 12)])
@pytest.mark.parametrize("fps", [30, 24, 1.0, 1000])
def test_simulate_flag_stays_bounded_when_grid_or_frame_rate_are_unusual(shape, fps):
    n_frames = 20 if fps == 30 else 4
    odd = simulate_flag(n_frames, n_rows=shape[0], n_columns=shape[1], fps=fps)
    stretch = edge_lengths(odd, odd.vertices) / edge_lengths(odd, rest_positions(*shape))
    assert stretch.max() < 1.1


def test_simulate_flag_reports_its_progress():
    reports = []
    simulate_flag(4, **SMALL, progress=lambda stage, share: reports.append((stage, share)))
    assert reports == [("simulating", share) for share in (0.25, 0.5, 0.75, 1.0)]


@pytest.mark.parametrize(
    "arguments",
    [
        {"n_frames": 0},
        {"n_frames": 2.5},
        {"n_rows": 2},
        {"n_columns": 2},
        {"fps": 0.5},
        {"fps": float("nan")},
        {"fps": float("inf")},
    ],
    ids=str,
)
def test_simulate_flag_names_the_argument_when_it_is_out_of_range(arguments):
    with pytest.raises(InvalidInputError, match=next(iter(arguments))):
        simulate_flag(**arguments)
