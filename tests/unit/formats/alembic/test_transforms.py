import numpy as np
import pytest

from meshreel.formats.load import load
from samples import alembic as sample

OPERATIONS = {
    "translate": ("kTranslateOperation", sample.vector(1.5, -2, 3)),
    "scale": ("kScaleOperation", sample.vector(2, 0.5, -1)),
    "rotate": ("kRotateOperation", sample.vector(1, 2, 3), 40.0),
    "rotate_x": ("kRotateXOperation", 30.0),
    "rotate_y": ("kRotateYOperation", -75.0),
    "rotate_z": ("kRotateZOperation", 200.0),
    "matrix": (
        "kMatrixOperation",
        sample.matrix([[1, 0.5, 0, 0], [0, 2, 0.25, 0], [0.1, 0, 1, 0], [7, 8, 9, 1]]),
    ),
}


def write_below_transforms(path, chain, frames=(sample.POINTS,), sampling=None):
    """Write a mesh below a chain of transforms, each a pair of samples and a time sampling."""
    parent = sample.archive(path).getTop()
    for number, (samples, own) in enumerate(chain):
        parent = sample.add_transform(parent, f"t{number}", samples, own)
    sample.add_mesh(parent, "mesh", frames, sampling)
    return path


def library_positions(path):
    [(points, world)] = sample.library_meshes(path).values()
    return (points.astype(float) @ world[:3, :3] + world[3, :3]).astype(np.float32)


def assert_close(found, expected):
    """Allow for the last bit of float32, since sums may be in another order."""
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", OPERATIONS)
def test_load_applies_each_transform_operation_like_the_library(tmp_path, name):
    path = write_below_transforms(tmp_path / "a.abc", [([([OPERATIONS[name]], True)], None)])
    assert_close(load(path).vertices[0], library_positions(path))


def test_load_applies_nested_transforms_like_the_library(tmp_path):
    every = list(OPERATIONS.values())
    chain = [([(every, True)], None), ([(every[::-1], True)], None), ([], None)]
    path = write_below_transforms(tmp_path / "a.abc", chain)
    np.testing.assert_allclose(load(path).vertices[0], library_positions(path), rtol=1e-6)


def test_transform_that_does_not_inherit_ignores_its_parents(tmp_path):
    chain = [([([OPERATIONS["scale"]], True)], None), ([([OPERATIONS["translate"]], False)], None)]
    loaded = load(write_below_transforms(tmp_path / "a.abc", chain))
    np.testing.assert_array_equal(loaded.vertices[0], sample.POINTS + np.float32([1.5, -2, 3]))


def test_load_has_a_frame_at_every_sample_of_points_and_transforms(tmp_path):
    right = [([("kTranslateOperation", sample.vector(x, 0, 0))], True) for x in (0, 2)]
    up = [([("kTranslateOperation", sample.vector(0, 0, z))], True) for z in (0, 1, 2)]
    chain = [(right, sample.uniform(2.0, 0.0)), (up, sample.acyclic([0.5, 1.0, 3.0]))]
    frames = [sample.POINTS, sample.POINTS + np.float32([0, 8, 0])]
    path = write_below_transforms(tmp_path / "a.abc", chain, frames, sample.uniform(2.0, 1.0))
    loaded = load(path)
    times = np.array([0, 0.5, 1, 2, 3])
    shift = [np.interp(times, [0, 2], [0, 2]), np.interp(times, [1, 3], [0, 8])]
    shift.append(np.interp(times, [0.5, 1, 3], [0, 1, 2]))
    expected = sample.POINTS + np.stack(shift, axis=1)[:, np.newaxis]
    np.testing.assert_array_equal(loaded.vertices, expected.astype(np.float32))


def test_load_interpolates_rotations_spherically(tmp_path):
    turning = [
        ([("kMatrixOperation", sample.matrix(np.diag([2, 3, 1, 1]) @ rotation_z(angle)))], True)
        for angle in (0, 90)
    ]
    frames = [sample.POINTS, sample.POINTS + 1, sample.POINTS]
    chain = [(turning, sample.uniform(2.0, 0.0))]
    path = write_below_transforms(tmp_path / "a.abc", chain, frames, sample.uniform(1.0, 0.0))
    halfway = (sample.POINTS + 1.0) @ (np.diag([2, 3, 1, 1]) @ rotation_z(45))[:3, :3]
    assert_close(load(path).vertices[1], halfway)


def test_load_returns_float64_for_a_mesh_moved_far_from_the_origin(tmp_path):
    far = [([("kTranslateOperation", sample.vector(1e7 + 0.25, 0, 0))], True)]
    loaded = load(write_below_transforms(tmp_path / "a.abc", [(far, None)]))
    assert loaded.vertices.dtype == np.float64
    np.testing.assert_array_equal(loaded.vertices[0], sample.POINTS + np.array([1e7 + 0.25, 0, 0]))


def rotation_z(angle_deg):
    """Return the rotation of row vectors about the z axis."""
    cosine, sine = np.cos(np.deg2rad(angle_deg)), np.sin(np.deg2rad(angle_deg))
    matrix = np.eye(4)
    matrix[:2, :2] = [[cosine, sine], [-sine, cosine]]
    return matrix
