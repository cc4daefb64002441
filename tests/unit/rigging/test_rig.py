import numpy as np
import pytest

import meshreel
from meshreel.errors import ConnectivityChangeError, InvalidInputError
from meshreel.metrics.position_errors import position_errors
from meshreel.model.sequence import MeshSequence
from meshreel.rigging.fitting import byte_weights
from samples.rigs import BOX, BOX_FACES, bending_tube, boxes, turn

EXACT = {"max_error": 0.01, "kg": 0.01}


def shown(rig):
    return rig.positions() + rig.origin


def test_tube_needs_two_bones_and_meets_its_bounds():
    tube = bending_tube()
    rig = meshreel.rig(tube, kg=0.3, max_error=0.5)
    errors = position_errors(tube.vertices, shown(rig))
    assert errors.kg_error_percent == rig.errors.kg_percent <= 0.3
    assert errors.max_error_percent == rig.errors.largest_percent <= 0.5
    assert rig.n_bones <= 8
    assert rig.n_targets == 0


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


def test_correctives_meet_what_bones_do_not():
    tube = bending_tube(bulge=0.3)
    rig = meshreel.rig(tube, 2, kg=0.5)
    assert rig.n_bones == 2
    assert rig.n_targets > 0
    assert position_errors(tube.vertices, shown(rig)).kg_error_percent <= 0.5


def test_unmet_bounds_are_refused_and_named_unless_forced():
    noise = np.random.default_rng(6).normal(size=(150, 60, 3))
    faces = np.arange(60, dtype=np.int32).reshape(-1, 3)
    sequence = MeshSequence(noise, faces, 25.0)
    with pytest.raises(InvalidInputError, match=r"2 bones and 64 corrective targets reach a KG er"):
        meshreel.rig(sequence, 2)
    rig = meshreel.rig(sequence, 2, force=True)
    assert rig.errors.kg_percent > 0.5


def test_one_frame_is_a_bone_without_motion():
    rig = meshreel.rig(MeshSequence(BOX[np.newaxis], BOX_FACES))
    assert (rig.n_bones, rig.errors.largest_percent) == (1, pytest.approx(0, abs=0.05))


def test_changing_faces_are_refused_with_the_remedy():
    both = meshreel.concatenate([bending_tube(), boxes([lambda t: np.eye(3)])])
    with pytest.raises(ConnectivityChangeError, match=r"2 segments .*meshreel register"):
        meshreel.rig(both)


@pytest.mark.parametrize("bones", [0, 257])
def test_number_of_bones_out_of_range_is_refused(bones):
    with pytest.raises(InvalidInputError, match=f"rig takes 1 to 256 bones; got {bones}"):
        meshreel.rig(bending_tube(), bones)


def test_bounds_must_be_above_zero():
    with pytest.raises(InvalidInputError, match=r"above 0 %; got a KG error of 0 %"):
        meshreel.rig(bending_tube(), kg=0)


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


def test_a_quality_or_a_length_is_a_bound_of_every_mesh():
    changing = meshreel.concatenate([bending_tube(), boxes([lambda t: np.eye(3)])])
    with pytest.raises(ConnectivityChangeError, match="register"):
        meshreel.rig(changing, quality=40)
    point = MeshSequence(np.ones((2, 3, 3)), np.array([[0, 1, 2]], np.int32), 25.0)
    assert meshreel.rig(point, max_error="1u").errors.largest_percent == 0


def test_quality_bounds_positions_as_in_a_stream():
    tube = bending_tube()
    stream = meshreel.encode(tube, quality=40, order="keep")
    stored = meshreel.compare(tube, meshreel.decode(stream))
    errors = meshreel.rig(tube, quality=40).errors
    assert 0 < errors.kg_percent <= stored.kg_error_percent
    assert errors.largest_percent <= stored.max_error_percent
