import numpy as np
import pytest

import meshreel
from meshreel.errors import InvalidInputError
from meshreel.model.rig import Skeleton
from meshreel.model.rig_keys import compose, decode_rotations, to_matrices, unit
from meshreel.model.sequence import MeshSequence
from meshreel.rigging.correctives import CorrectiveSearch
from meshreel.rigging.decomposition import Decomposition, convex_weights, fit_rigid
from meshreel.rigging.fitting import bounds_of, byte_weights, fit_sequence
from meshreel.rigging.skeleton import Steps, encode_rotations, fit_tracks, to_quaternions
from samples.rigs import BOX, BOX_FACES, bending_tube, boxes, turn

EXACT = {"max_error": 0.01, "kg": 0.01}


def test_weights_are_four_bytes_with_sum_255():
    rig = meshreel.rig(bending_tube())
    assert rig.weights.dtype == np.uint8
    assert (rig.weights.sum(axis=1, dtype=int) == 255).all()
    assert (rig.joints < rig.n_bones).all()
    assert (rig.skeleton.parents < np.arange(rig.n_bones)).all()
    assert len(set(rig.skeleton.names)) == rig.n_bones


def test_rounded_weights_keep_their_sum():
    weights = np.random.default_rng(5).dirichlet(np.ones(4), 100)
    rounded = byte_weights(weights)
    assert (rounded.sum(axis=1, dtype=int) == 255).all()
    assert np.abs(rounded / 255 - weights).max() < 0.01


def test_rigid_components_have_one_bone_each():
    rig = meshreel.rig(boxes([lambda t: turn(0.1 * t), lambda t: turn(0.2 * t, 0)]), **EXACT)
    assert (rig.n_bones, rig.n_targets) == (2, 0)


UNEVEN_S = np.linspace(0, 3, 12) ** 2


@pytest.mark.parametrize(
    ("fps", "times_s", "expected"),
    [(25, None, np.arange(12) / 25), (25, UNEVEN_S, UNEVEN_S), (0, None, np.arange(12))],
)
def test_keys_are_at_given_times_those_of_the_sequence_or_numbers(fps, times_s, expected):
    sequence = boxes([lambda t: turn(0.1 * t)]).replace(fps=fps)
    np.testing.assert_array_equal(fit_sequence(sequence, times_s).times_s, expected)


def test_thousand_components_that_move_alike_have_one_bone():
    sequence = boxes([lambda t: np.eye(3)] * 1000, n_frames=4)
    turned = np.stack([frame @ turn(0.1 * t).T for t, frame in enumerate(sequence.vertices)])
    assert meshreel.rig(sequence.replace(vertices=turned), **EXACT).n_bones == 1


@pytest.mark.parametrize(
    "motion", [lambda t: np.eye(3) * (1 + 0.1 * t), lambda t: np.diag([1, 1, np.cos(0.3 * t)])]
)
def test_scale_and_mirror_are_met_without_reflections(motion):
    rig = meshreel.rig(boxes([motion], n_frames=20))
    assert rig.errors.largest_percent <= 1
    linear = rig.matrices[..., :3].astype(np.float64)
    assert (np.linalg.det(linear) > 0).all()


def test_one_frame_is_a_bone_without_motion():
    rig = meshreel.rig(MeshSequence(BOX[np.newaxis], BOX_FACES))
    assert (rig.n_bones, rig.errors.largest_percent) == (1, pytest.approx(0, abs=0.05))


NOISE = MeshSequence(
    np.random.default_rng(6).normal(size=(150, 60, 3)),
    np.arange(60, dtype=np.int32).reshape(-1, 3),
    25.0,
)
CHANGING = meshreel.concatenate([bending_tube(), boxes([lambda t: np.eye(3)])])
UNMET = r"2 bones and 64 corrective targets reach a KG er.*\(max_error, kg\) or up to 256 bones"


@pytest.mark.parametrize(
    ("sequence", "options", "message"),
    [
        (NOISE, {"bones": 2}, UNMET),
        (CHANGING, {}, r"2 segments .*meshreel register"),
        (CHANGING, {"quality": 40}, "register"),
        (bending_tube(), {"bones": 0}, "rig takes 1 to 256 bones; got 0"),
        (bending_tube(), {"bones": 257}, "rig takes 1 to 256 bones; got 257"),
        (bending_tube(), {"kg": 0}, "above 0 %; got a KG error of 0 %"),
    ],
)
def test_what_no_rig_can_meet_is_refused_with_its_remedy(sequence, options, message):
    with pytest.raises(InvalidInputError, match=message):
        meshreel.rig(sequence, **options)


@pytest.mark.parametrize("scale", [1e-30, 1e30])
def test_size_of_the_model_does_not_matter(scale):
    sequence = boxes([lambda t: turn(0.1 * t)])
    rig = meshreel.rig(sequence.replace(vertices=scale * sequence.vertices), **EXACT)
    assert rig.n_bones == 1


def test_odd_meshes_are_rigged():
    """Edges with three faces, an isolated vertex that flies away, and vertices that coincide."""
    faces = np.concatenate([BOX_FACES, [[0, 1, 2], [0, 1, 7], [0, 1, 5]]]).astype(np.int32)
    frames = [np.concatenate([BOX @ turn(0.1 * t).T, [[5, 5, t]]]) for t in range(12)]
    assert meshreel.rig(MeshSequence(np.stack(frames), faces)).n_bones == 2
    assert meshreel.rig(MeshSequence(np.zeros((5, 8, 3)), BOX_FACES)).errors.kg_percent == 0


def test_progress_reaches_the_end():
    shares = []
    meshreel.rig(bending_tube(), progress=lambda stage, share: shares.append(share))
    assert shares == sorted(shares)
    assert shares[-1] == 1


def test_a_length_is_a_bound_of_every_mesh():
    point = MeshSequence(np.ones((2, 3, 3)), np.array([[0, 1, 2]], np.int32), 25.0)
    assert meshreel.rig(point, max_error="1u").errors.largest_percent == 0


def test_quality_bounds_positions_as_in_a_stream():
    tube = bending_tube()
    stream = meshreel.encode(tube, quality=40, order="keep")
    stored = meshreel.compare(tube, meshreel.decode(stream))
    bounds = bounds_of(tube, quality=40, kg=None, max_error=None)
    assert (bounds.kg, bounds.largest) == (stored.kg_error_percent, stored.max_error_percent)
    errors = meshreel.rig(tube, quality=40).errors
    assert 0 < errors.kg_percent <= bounds.kg
    assert errors.largest_percent <= bounds.largest


def test_a_length_is_a_percentage_of_the_diagonal_of_all_frames():
    corners = boxes([lambda t: turn(0.1 * t)]).vertices.reshape(-1, 3)
    bounds = bounds_of(boxes([lambda t: turn(0.1 * t)]), quality=None, kg=0.1, max_error="0.01u")
    diagonal = np.linalg.norm(corners.max(axis=0) - corners.min(axis=0))
    assert (bounds.kg, bounds.largest) == (0.1, pytest.approx(1 / diagonal))


def search(rank=3, n_frames=20, n_verts=30):
    rng = np.random.default_rng(7)
    fields = rng.normal(size=(rank, n_verts, 3))
    weights = rng.normal(size=(n_frames, rank))
    rotation = turn(1.0) @ turn(0.5, 0)
    blended = np.tile(rotation, (n_frames, n_verts, 1, 1)).astype(np.float32)
    residuals = np.einsum("ab,tk,kvb->tva", rotation, weights, fields).astype(np.float32)
    return CorrectiveSearch(residuals, blended, 1.0, 1e-4), residuals


def test_residual_of_few_modes_needs_as_many_targets():
    correctives, residuals = search()
    spread = float(np.sqrt(np.square(residuals).sum(axis=2).mean()))
    assert correctives.count_for(1e-6) == 3
    found, mean, _ = correctives.round(3, np.inf)
    assert found.targets.shape == (3, 30, 3)
    assert mean < 0.03 * spread


def test_further_rounds_reduce_the_largest_error():
    correctives, _ = search(rank=8)
    bound = 0.8 * correctives.round(4, np.inf)[2]
    largest = [correctives.round(4, bound)[2] for _ in range(8)]
    assert largest[-1] < largest[0]


def test_weights_can_be_made_nonnegative_without_changing_the_motion():
    correctives, _ = search()
    found, _, _ = correctives.round(3, np.inf)
    moved, positive = found.nonnegative()
    assert found.weights.min() < 0 <= positive.weights.min()
    before = np.tensordot(found.weights, found.targets / 127, 1)
    after = moved + np.tensordot(positive.weights, found.targets / 127, 1)
    np.testing.assert_allclose(after, before, atol=1e-5 * np.abs(before).max())


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
def test_decoded_rotations_are_close(bits):
    codes = encode_rotations(quaternions(), bits)
    cosine = np.abs((unit(decode_rotations(codes).astype(float)) * quaternions()).sum(axis=1))
    assert 2 * np.arccos(cosine.min().clip(0, 1)) < 5.5 / 2**bits


def placed(tracks, skeleton):
    world = []
    for track, parent in zip(tracks, skeleton.parents, strict=True):
        local = track.matrices(TIMES_S)
        world.append(local if parent < 0 else compose(world[parent], local))
    return world


def test_rounding_errors_do_not_add_up_along_a_chain():
    n_bones = 12
    angles = 0.05 * np.sin(np.arange(40) / 7)
    joints = np.column_stack([np.arange(n_bones), np.zeros((n_bones, 2))]).astype(float)
    transforms, above = [], np.tile(np.eye(3, 4), (40, 1, 1))
    for joint in joints:
        local = moving([turn(angle) for angle in angles], [joint - turn(a) @ joint for a in angles])
        above = compose(above, local)
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


def test_straight_motion_and_turns_near_the_joint_need_few_keys():
    corner = np.minimum(np.arange(40), 25) * 0.01
    offsets = np.column_stack([corner, np.zeros((40, 2))])
    still = np.tile(np.eye(3, 4), (40, 1, 1))
    turning = moving([turn(0.01 * np.sin(frame)) for frame in range(40)], np.zeros((40, 3)))
    bones = still, moving([np.eye(3)] * 40, offsets), still, turning, turning
    skeleton, radii = Skeleton(np.array([-1, 0, 0, 0, 0]), np.zeros((5, 3))), [1, 1, 1, 5e-4, 2e-3]
    tracks = fit_tracks(
        np.stack(bones, axis=1), skeleton, np.array(radii), TIMES_S, Steps(12, -20), 1e-5
    )
    root, child, resting, near, far = tracks
    assert len(root.frames) == 40  # tells readers the times of all frames
    assert (child.frames.tolist(), resting.frames.tolist()) == ([0, 25, 39], [0])
    assert len(near.frames) == 1 < len(far.frames)
    np.testing.assert_array_equal(resting.matrices(TIMES_S), still)
    assert np.abs(child.matrices(TIMES_S)[:, 0, 3] - corner).max() <= 1e-5


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


def rigid_fit(points, targets, weights, former):
    lifted = np.column_stack([points, np.ones(len(points))]) * weights[:, np.newaxis]
    moments = np.einsum("tva,vb->tab", targets, lifted)
    return fit_rigid(moments, lifted.T @ lifted, former)


@pytest.mark.parametrize("is_mirrored", [False, True])
def test_rigid_motion_is_found_exactly_without_reflections(is_mirrored):
    rng = np.random.default_rng(1)
    points, weights = rng.normal(size=(20, 3)), rng.uniform(0.2, 1, 20)
    rotation, offset = turn(1.0) @ turn(-0.6, 0), rng.normal(size=3)
    matrix = rotation * [1, 1, -1] if is_mirrored else rotation
    targets = ((points @ matrix.T + offset) * weights[:, np.newaxis])[np.newaxis]
    [found] = rigid_fit(points, targets, weights, np.eye(3, 4)[np.newaxis])
    if is_mirrored:
        assert np.linalg.det(found[:, :3]) == pytest.approx(1)
    else:
        np.testing.assert_allclose(found, np.column_stack([rotation, offset]), atol=1e-5)


def test_collinear_points_keep_the_free_rotation():
    points = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0.0]])
    former = np.column_stack([turn(0.5, 0), np.zeros(3)])[np.newaxis]
    found = rigid_fit(points, points[np.newaxis], np.ones(3), former)
    np.testing.assert_allclose(found[0, :, :3], former[0, :, :3], atol=1e-3)


def test_weights_are_convex_and_few():
    rng = np.random.default_rng(3)
    places = rng.normal(size=(50, 9, 12))
    truth = np.zeros((50, 9))
    truth[:, [1, 4, 7]] = [0.5, 0.3, 0.2]
    target = np.einsum("vi,vid->vd", truth, places)
    gram = np.einsum("vid,vjd->vij", places, places)
    weights = convex_weights(gram, np.einsum("vid,vd->vi", places, target))
    np.testing.assert_allclose(weights, truth, atol=1e-4)
    matches = rng.normal(size=(50, 9))
    noisy = convex_weights(gram, matches)
    assert (noisy >= 0).all()
    assert (np.count_nonzero(noisy, axis=1) <= 4).all()
    np.testing.assert_allclose(noisy.sum(axis=1), 1)
    # At the minimum on the sum 1, the gradient is the same for all candidates that are left.
    gradients = np.einsum("vij,vj->vi", gram, noisy) - matches
    for gradient, own in zip(gradients, noisy > 0, strict=True):
        np.testing.assert_allclose(gradient[own], gradient[own][0], atol=1e-6)


def test_influences_that_hardly_count_are_left_out():
    gram = np.array([[[1.0, 0.999], [0.999, 1.0]]])
    matches = np.array([[0.9996, 0.9994]])
    assert np.count_nonzero(convex_weights(gram, matches)) == 2
    assert np.count_nonzero(convex_weights(gram, matches, cost=1e-3)) == 1


def test_rounds_reduce_the_error():
    vertices = bending_tube().vertices.astype(np.float64)
    frames = vertices.transpose(0, 2, 1).reshape(-1, vertices.shape[1])
    fit = Decomposition(frames, frames[:3].T, np.zeros(vertices.shape[1], np.int64))
    fit.add_bones(fit.component_seeds(1, 0.0))
    errors = []
    for _ in range(3):
        fit.round(fits_rest=False)
        errors.append(float(np.square(fit.residuals()).sum()))
        fit.add_bones(fit.seeds(fit.residuals(), 1))
    fit.round()
    residuals = fit.residuals()
    fit.copy().prune(1.0)
    np.testing.assert_array_equal(fit.residuals(), residuals)
    errors.append(float(np.square(residuals).sum()))
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.05 * errors[0]
