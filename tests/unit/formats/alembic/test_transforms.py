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


def written(path, chain, frames=(sample.POINTS,), sampling=None):
    """A file with a mesh below transforms, each of samples and maybe a time sampling."""
    parent = sample.archive(path).getTop()
    for number, (samples, own) in enumerate(chain):
        parent = sample.add_transform(parent, f"t{number}", samples, own)
    sample.add_mesh(parent, "mesh", frames, sampling)
    return path


def as_library_places(path):
    [(points, world)] = sample.library_meshes(path).values()
    return (points.astype(float) @ world[:3, :3] + world[3, :3]).astype(np.float32)


def nearly_same(found, expected):
    """Equal but for the last place of float32, for sums may be added in another order."""
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", OPERATIONS)
def test_load_places_a_mesh_as_the_library_does_when_a_transform_has_one_operation(tmp_path, name):
    path = written(tmp_path / "a.abc", [([([OPERATIONS[name]], True)], None)])
    nearly_same(load(path).vertices[0], as_library_places(path))


def test_load_places_a_mesh_as_the_library_does_when_transforms_are_nested(tmp_path):
    every = list(OPERATIONS.values())
    chain = [([(every, True)], None), ([(every[::-1], True)], None), ([], None)]
    path = written(tmp_path / "a.abc", chain)
    np.testing.assert_allclose(load(path).vertices[0], as_library_places(path), rtol=1e-6)


def test_load_forgets_transforms_above_when_one_does_not_inherit(tmp_path):
    chain = [([([OPERATIONS["scale"]], True)], None), ([([OPERATIONS["translate"]], False)], None)]
    found = load(written(tmp_path / "a.abc", chain))
    np.testing.assert_array_equal(found.vertices[0], sample.POINTS + np.float32([1.5, -2, 3]))


def test_load_samples_where_points_or_any_transform_do_when_both_move(tmp_path):
    right = [([("kTranslateOperation", sample.vector(x, 0, 0))], True) for x in (0, 2)]
    up = [([("kTranslateOperation", sample.vector(0, 0, z))], True) for z in (0, 1, 2)]
    chain = [(right, sample.uniform(2.0, 0.0)), (up, sample.acyclic([0.5, 1.0, 3.0]))]
    frames = [sample.POINTS, sample.POINTS + np.float32([0, 8, 0])]
    path = written(tmp_path / "a.abc", chain, frames, sample.uniform(2.0, 1.0))
    found = load(path)
    times = np.array([0, 0.5, 1, 2, 3])
    shift = [np.interp(times, [0, 2], [0, 2]), np.interp(times, [1, 3], [0, 8])]
    shift.append(np.interp(times, [0.5, 1, 3], [0, 1, 2]))
    expected = sample.POINTS + np.stack(shift, axis=1)[:, np.newaxis]
    np.testing.assert_array_equal(found.vertices, expected.astype(np.float32))


def test_load_turns_evenly_when_a_transform_is_between_two_rotations(tmp_path):
    turning = [
        ([("kMatrixOperation", sample.matrix(np.diag([2, 3, 1, 1]) @ rotated(angle)))], True)
        for angle in (0, 90)
    ]
    frames = [sample.POINTS, sample.POINTS + 1, sample.POINTS]
    chain = [(turning, sample.uniform(2.0, 0.0))]
    path = written(tmp_path / "a.abc", chain, frames, sample.uniform(1.0, 0.0))
    halfway = (sample.POINTS + 1.0) @ (np.diag([2, 3, 1, 1]) @ rotated(45))[:3, :3]
    nearly_same(load(path).vertices[1], halfway)


def test_load_gives_float64_when_a_transform_puts_a_mesh_far_from_the_origin(tmp_path):
    far = [([("kTranslateOperation", sample.vector(1e7 + 0.25, 0, 0))], True)]
    found = load(written(tmp_path / "a.abc", [(far, None)]))
    assert found.vertices.dtype == np.float64
    np.testing.assert_array_equal(found.vertices[0], sample.POINTS + np.array([1e7 + 0.25, 0, 0]))


def rotated(angle_deg):
    """A matrix that turns rows about the third axis."""
    cosine, sine = np.cos(np.deg2rad(angle_deg)), np.sin(np.deg2rad(angle_deg))
    found = np.eye(4)
    found[:2, :2] = [[cosine, sine], [-sine, cosine]]
    return found
