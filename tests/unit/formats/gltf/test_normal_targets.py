import numpy as np
import pytest

from meshreel.formats.gltf.morph_mesh import (
    fit_part,
    select_normal_targets,
    static_normals,
)
from meshreel.formats.options import WriteOptions
from meshreel.model.flag import simulate_flag
from meshreel.model.geometry.normals import vertex_normals
from samples.meshes import octahedron_faces, waving_grid
from samples.surfaces import rich_cube


def angles_deg(fitted, vertices, faces):
    """Return the angles between animated and original normals of every vertex and frame."""
    displacements = np.tensordot(
        fitted.morphs.weights[:, fitted.normals.numbers], fitted.normals.targets / 127, 1
    )
    normals = fitted.normals.base / 127 + displacements
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    expected = np.stack([vertex_normals(frame, faces) for frame in vertices])
    return np.degrees(np.arccos(np.clip((normals * expected).sum(axis=2), -1, 1)))


@pytest.mark.slow
def test_normals_follow_a_fluttering_flag():
    flag = simulate_flag(30, n_rows=16, n_columns=16)
    options = WriteOptions(normals=True, compression=False)
    fitted = fit_part(flag.vertices, flag.faces, 0.002, options)
    angles = angles_deg(fitted, flag.vertices, flag.faces)
    assert (angles.mean() < 1, angles.max() < 10, fitted.errors.max() <= 0.002) == (True,) * 3


def test_normals_follow_a_rotating_body():
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    body = np.concatenate([np.eye(3), -np.eye(3)])[[0, 3, 1, 4, 2, 5]]
    rotations = np.stack(
        [[np.cos(a), -np.sin(a), 0, np.sin(a), np.cos(a), 0, 0, 0, 1] for a in angles]
    )
    vertices = (body @ rotations.reshape(-1, 3, 3)).astype(np.float32)
    options = WriteOptions(normals=True, compression=False)
    fitted = fit_part(vertices, octahedron_faces(), 0.002, options)
    assert angles_deg(fitted, vertices, octahedron_faces()).max() < 2


def test_fixed_number_of_targets_includes_those_of_normals():
    grid = waving_grid(20)
    fitted = fit_part(
        grid.vertices, grid.faces, 0.0, WriteOptions(targets=6, normals=True, compression=False)
    )
    assert len(fitted.morphs.targets) == len(fitted.normals.targets) == 6


def test_normals_of_degenerate_faces_point_along_z():
    result = static_normals(np.zeros((3, 3), np.float32), np.array([[0, 1, 2]], np.int32))
    np.testing.assert_array_equal(result.base, np.tile(np.float32([0, 0, 1]), (3, 1)))


@pytest.mark.slow
@pytest.mark.parametrize("choice", [None, True])
def test_stated_angle_is_that_of_the_stored_normals(choice):
    flag = simulate_flag(24, n_rows=12, n_columns=12)
    fitted = fit_part(
        flag.vertices, flag.faces, 0.002, WriteOptions(normals=choice, compression=False)
    )
    measured = angles_deg(fitted, flag.vertices, flag.faces).mean()
    assert fitted.normals.angle_deg == pytest.approx(measured, rel=1e-2)


@pytest.mark.slow
def test_smooth_normals_need_fewer_targets_than_exact_ones():
    flag = simulate_flag(60, n_rows=20, n_columns=20)
    near, exact = (
        fit_part(flag.vertices, flag.faces, 0.0005, WriteOptions(normals=choice, compression=False))
        for choice in (None, True)
    )
    assert len(near.normals.numbers) < 0.7 * len(exact.normals.numbers)
    assert near.normals.angle_deg < 5
    assert near.errors.max() <= 0.0005


def test_creased_mesh_has_normals_only_on_request():
    box = rich_cube(4)
    results = [
        fit_part(box.vertices, box.faces, 0.001, WriteOptions(normals=one, compression=False))
        for one in (None, True, False)
    ]
    assert [result.normals is not None for result in results] == [False, True, False]


@pytest.mark.parametrize(("error_share", "n_targets"), [(1.01, 1), (0.99, 2), (0.2, 3)])
def test_fewest_targets_that_reach_the_error_of_normals_are_selected(error_share, n_targets):
    """Of three targets that change normals by 3, 2 and 1, the last two have a squared sum of 5."""
    rng = np.random.default_rng(4)
    basis, _ = np.linalg.qr(np.column_stack([np.ones(7), rng.standard_normal((7, 3))]))
    fields, _ = np.linalg.qr(rng.standard_normal((30, 3)))
    amounts = np.array([3.0, 2.0, 1.0])
    offsets = (basis[:, 1:] * amounts) @ fields.T
    weights = (basis[:, 1:] * amounts).astype(np.float32)
    length_error = error_share * np.sqrt(5 / (offsets.size / 3))
    result = select_normal_targets(weights, offsets.astype(np.float32), length_error)
    assert result.tolist() == list(range(n_targets))
