import numpy as np
import pytest

from meshreel.formats.gltf.meshopt import FILTERS
from meshreel.rigging.keys import (
    Steps,
    composed,
    decode_rotations,
    encode_rotations,
    fit_tracks,
    to_matrices,
    to_quaternions,
    unit,
)
from meshreel.rigging.skeleton import Skeleton
from samples.rigs import turn

TIMES_S = np.arange(40) / 25


def quaternions(n=200):
    return unit(np.random.default_rng(4).normal(size=(n, 4)))


def moving(matrices, offsets):
    return np.concatenate([np.stack(matrices), np.stack(offsets)[..., np.newaxis]], axis=2)


def test_quaternions_of_matrices_are_those_of_the_matrices():
    given = quaternions()
    found = to_quaternions(to_matrices(given, np.zeros((len(given), 3)))[:, :, :3])
    np.testing.assert_allclose(np.abs((found * given).sum(axis=1)), 1)


@pytest.mark.parametrize("bits", [6, 11, 16])
def test_rotations_are_decoded_as_by_the_filter(bits):
    codes = encode_rotations(quaternions(), bits)
    filtered = FILTERS["QUATERNION"](codes.view(np.uint8)).view("<i2")
    np.testing.assert_array_equal(decode_rotations(codes), filtered)
    cosine = np.abs((unit(decode_rotations(codes).astype(float)) * quaternions()).sum(axis=1))
    assert 2 * np.arccos(cosine.min().clip(0, 1)) < 5.5 / 2**bits


def placed(tracks, skeleton):
    world = []
    for track, parent in zip(tracks, skeleton.parents, strict=True):
        local = track.matrices(TIMES_S)
        world.append(local if parent < 0 else composed(world[parent], local))
    return world


def test_rounding_errors_do_not_add_up_along_a_chain():
    n_bones = 12
    angles = 0.05 * np.sin(np.arange(40) / 7)
    joints = np.column_stack([np.arange(n_bones), np.zeros((n_bones, 2))]).astype(float)
    transforms, above = [], np.tile(np.eye(3, 4), (40, 1, 1))
    for joint in joints:
        local = moving([turn(angle) for angle in angles], [joint - turn(a) @ joint for a in angles])
        above = composed(above, local)
        transforms.append(above)
    skeleton = Skeleton(np.arange(n_bones) - 1, joints)
    steps = Steps(bits=10, exponent=-10)
    tracks = fit_tracks(
        np.stack(transforms, axis=1), skeleton, np.ones(n_bones), TIMES_S, steps, 0.0
    )
    for bone, matrices in enumerate(placed(tracks, skeleton)):
        errors = matrices[:, :, 3] - transforms[bone][:, :, :3] @ joints[bone]
        errors = errors - transforms[bone][:, :, 3]
        assert np.abs(errors).max() <= 2.0**-11 + 1e-5


def test_straight_motion_needs_few_keys_and_bends_have_one():
    corner = np.minimum(np.arange(40), 25) * 0.01
    offsets = np.column_stack([corner, np.zeros((40, 2))])
    still = np.tile(np.eye(3, 4), (40, 1, 1))
    transforms = np.stack([still, moving([np.eye(3)] * 40, offsets)], axis=1)
    skeleton = Skeleton(np.array([-1, 0]), np.zeros((2, 3)))
    root, child = fit_tracks(transforms, skeleton, np.ones(2), TIMES_S, Steps(12, -20), 1e-5)
    assert len(root.frames) == 40  # tells readers the times of all frames
    assert child.frames.tolist() == [0, 25, 39]
    assert np.abs(child.matrices(TIMES_S)[:, 0, 3] - corner).max() <= 1e-5


def test_bone_that_rests_has_one_key():
    transforms = np.tile(np.eye(3, 4), (40, 2, 1, 1))
    skeleton = Skeleton(np.array([-1, 0]), np.zeros((2, 3)))
    _, child = fit_tracks(transforms, skeleton, np.ones(2), TIMES_S, Steps(12, -10), 1e-3)
    assert child.frames.tolist() == [0]
    assert child.matrices(TIMES_S).shape == (40, 3, 4)


def test_equal_first_and_last_frames_have_equal_keys():
    angles = 0.3 * np.sin(np.linspace(0, 2 * np.pi, 40))
    angles[-1] = angles[0]
    transforms = moving([turn(angle) for angle in angles], np.zeros((40, 3)))[:, np.newaxis]
    [track] = fit_tracks(
        transforms, Skeleton(np.array([-1]), np.zeros((1, 3))), np.ones(1), TIMES_S,
        Steps(10, -10), 1e-3,
    )  # fmt: skip
    np.testing.assert_array_equal(track.codes[0], track.codes[-1])
    np.testing.assert_array_equal(track.translations[0], track.translations[-1])
