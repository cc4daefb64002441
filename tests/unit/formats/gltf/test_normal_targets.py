import numpy as np
import pytest

from meshreel.formats.gltf.moving_mesh import Wanted, fit_part
from meshreel.formats.gltf.normal_targets import NormalChoice, _turning_targets, still_normals
from meshreel.model.flag import simulate_flag
from meshreel.model.geometry.normals import vertex_normals
from samples.meshes import octahedron_faces, waving_grid
from samples.surfaces import rich_cube


def angles_deg(moving, vertices, faces):
    """Between normals as a viewer has them and those of the frames, of every vertex."""
    turned = np.tensordot(
        moving.morphs.weights[:, moving.normals.numbers], moving.normals.targets / 127, 1
    )
    normals = moving.normals.base / 127 + turned
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    expected = np.stack([vertex_normals(frame, faces) for frame in vertices])
    return np.degrees(np.arccos(np.clip((normals * expected).sum(axis=2), -1, 1)))


def test_fit_normals_follow_when_a_flag_flutters():
    flag = simulate_flag(30, n_rows=16, n_columns=16)
    moving = fit_part(flag.vertices, flag.faces, Wanted(None, 0.002, normals=NormalChoice.ALL))
    angles = angles_deg(moving, flag.vertices, flag.faces)
    assert (angles.mean() < 1, angles.max() < 10, moving.errors.max() <= 0.002) == (True,) * 3


def test_fit_normals_follow_when_a_body_turns_around():
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    body = np.concatenate([np.eye(3), -np.eye(3)])[[0, 3, 1, 4, 2, 5]]
    turns = np.stack([[np.cos(a), -np.sin(a), 0, np.sin(a), np.cos(a), 0, 0, 0, 1] for a in turn])
    vertices = (body @ turns.reshape(-1, 3, 3)).astype(np.float32)
    moving = fit_part(vertices, octahedron_faces(), Wanted(None, 0.002, normals=NormalChoice.ALL))
    assert angles_deg(moving, vertices, octahedron_faces()).max() < 2


def test_fit_normals_has_the_number_of_targets_when_it_is_given():
    grid = waving_grid(20)
    moving = fit_part(grid.vertices, grid.faces, Wanted(6, 0.0, normals=NormalChoice.ALL))
    assert len(moving.morphs.targets) == len(moving.normals.targets) == 6


def test_still_normals_point_along_z_when_no_face_has_an_area():
    found = still_normals(np.zeros((3, 3), np.float32), np.array([[0, 1, 2]], np.int32))
    np.testing.assert_array_equal(found.base, np.tile(np.float32([0, 0, 1]), (3, 1)))


@pytest.mark.parametrize("choice", [NormalChoice.SMOOTH, NormalChoice.ALL])
def test_angle_is_that_of_the_bytes_when_normals_move(choice):
    flag = simulate_flag(24, n_rows=12, n_columns=12)
    moving = fit_part(flag.vertices, flag.faces, Wanted(None, 0.002, normals=choice))
    measured = angles_deg(moving, flag.vertices, flag.faces).mean()
    assert moving.normals.angle_deg == pytest.approx(measured, rel=1e-2)


@pytest.mark.slow
def test_fewer_targets_turn_normals_when_these_need_be_near_only():
    flag = simulate_flag(60, n_rows=20, n_columns=20)
    near, exact = (
        fit_part(flag.vertices, flag.faces, Wanted(None, 0.0005, normals=choice))
        for choice in (NormalChoice.SMOOTH, NormalChoice.ALL)
    )
    assert len(near.normals.numbers) < 0.7 * len(exact.normals.numbers)
    assert near.normals.angle_deg < 5
    assert near.errors.max() <= 0.0005


def test_mesh_has_no_normals_when_it_is_creased_unless_all_are_asked_for():
    box = rich_cube(4)
    found = [fit_part(box.vertices, box.faces, Wanted(None, 0.001, one)) for one in NormalChoice]
    assert [one.normals is not None for one in found] == [False, True, False]


@pytest.mark.parametrize(("error_share", "n_targets"), [(1.01, 1), (0.99, 2), (0.2, 3)])
def test_as_few_targets_turn_normals_as_bring_them_near(error_share, n_targets):
    """Of three targets that turn normals by 3, 2 and 1; the second and the third leave out 5."""
    rng = np.random.default_rng(4)
    basis, _ = np.linalg.qr(np.column_stack([np.ones(7), rng.standard_normal((7, 3))]))
    fields, _ = np.linalg.qr(rng.standard_normal((30, 3)))
    amounts = np.array([3.0, 2.0, 1.0])
    turns = (basis[:, 1:] * amounts) @ fields.T
    weights = (basis[:, 1:] * amounts).astype(np.float32)
    length_error = error_share * np.sqrt(5 / (turns.size / 3))
    found = _turning_targets(weights, turns.astype(np.float32), length_error)
    assert found.tolist() == list(range(n_targets))
