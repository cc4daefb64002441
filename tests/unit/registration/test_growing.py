"""Frames are followed without folds, with as few attempts as they need."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import meshreel
from meshreel import MeshFrame, MeshSequence
from meshreel.registration import growing
from meshreel.registration.capture import Topology
from meshreel.registration.cleaning import clean
from meshreel.registration.folds import Folds
from meshreel.registration.growing import Failure, Fit, Follower, Segment, Success
from meshreel.registration.refining import KeyMesh
from meshreel.registration.register import register
from meshreel.registration.stores import TemporaryStore
from meshreel.registration.tracking import ATTEMPTS, Tracker
from meshreel.registration.triangle_mesh import TriangleMesh
from meshreel.registration.verification import FrameErrors, Tolerance, measure
from samples.captures import as_frames, bent, capsule
from samples.shapes import square

TOLERANCE = Tolerance(0.003)

UNLESS_NEAR = [one for one in ATTEMPTS if one.if_failed is not False]
"""The attempts if the first one loses the surface, or faces fold."""


def lifted(mesh, heights):
    return TriangleMesh(mesh.vertices + heights[:, None] * [0.0, 0.0, 1.0], mesh.faces)


def with_spike(plane):
    radii = np.linalg.norm(plane.vertices[:, :2] - [0.5, 0.5], axis=1)
    return lifted(plane, 0.05 * np.maximum(0, 1 - radii / 0.08))


@pytest.fixture
def plane():
    return TriangleMesh(*square(0.0, 41))


@pytest.fixture
def n_attempts(monkeypatch):
    """A list that grows by one with each attempt."""
    counted, track = [], Tracker.track

    def counting(self, state, target, attempt=ATTEMPTS[0]):
        counted.append(attempt)
        return track(self, state, target, attempt)

    monkeypatch.setattr(Tracker, "track", counting)
    return counted


@pytest.mark.slow
def test_folds_at_a_crease_are_opened_within_the_tolerance(plane):
    creased = lifted(plane, np.abs(plane.vertices[:, 0] - 0.5))
    is_patch = np.abs(creased.vertices[:, :2] - 0.5).max(axis=1) < 0.13
    moved = creased.vertices + is_patch[:, None] * [0.0, 0.05, 0.0]
    folded = TriangleMesh(moved, creased.faces)
    folds, errors = Folds(creased), measure(folded, creased, TOLERANCE)
    assert len(folds.find(folded, creased)) > 0
    assert not errors.exceeds(TOLERANCE)
    assert measure(folds.flatten(folded, creased), creased, TOLERANCE).exceeds(TOLERANCE)
    follower = Follower(creased, TOLERANCE)
    pose, posed = follower.tracker.track(follower.tracker.start(), creased)
    fit = Fit(pose, posed, folded, errors, n_steps=1)
    follower._repair_folds(fit, creased)
    assert (fit.n_folded, len(folds.find(fit.mesh, creased))) == (0, 0)
    assert fit.errors == measure(fit.mesh, creased, TOLERANCE)
    assert not fit.errors.exceeds(TOLERANCE)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("n_steps", "repaired", "restored", "n_attempts", "chosen", "n_folded"),
    [
        (4, [0], {}, 1, 0, 0),
        (4, [5, 0], {}, 2, 1, 0),
        (4, [5, 3], {1: 0}, 2, 1, 0),
        (4, [5, 3, 4], {1: 2, 2: 0}, 3, 2, 0),
        (4, [2, 3, 3], {0: 0}, 3, 0, 0),
        (3, [5, 3, 4], {0: 0, 1: 1, 2: 1}, 3, 1, 1),
        (2, [5], {0: 0}, 1, 0, 0),
        (2, [5, 3], {0: 4, 1: 0}, 2, 1, 0),
    ],
)
def test_attempts_follow_each_other_while_faces_fold(
    plane, monkeypatch, n_steps, repaired, restored, n_attempts, chosen, n_folded
):
    """Those of a close fit of the first attempt are restored last.

    Folds that repairs leave are scripted by attempt; the height of a mesh is its attempt.
    """
    tried = []

    def attempted(self, state, target, attempt):
        tried.append(attempt)
        height = np.full(len(plane.vertices), float(UNLESS_NEAR.index(attempt)))
        pose, posed = self.tracker.track(state, target)
        return Fit(pose, posed, lifted(plane, height), FrameErrors(*9 * [0.0]), n_steps)

    def repair(self, fit, target):
        fit.n_folded = repaired[round(fit.mesh.vertices[0, 2])]

    def restore(self, fit, target):
        fit.n_folded = restored.get(round(fit.mesh.vertices[0, 2]), fit.n_folded)

    for name, scripted in {
        "_attempt": attempted,
        "_repair_folds": repair,
        "_restore_folds": restore,
    }.items():
        monkeypatch.setattr(Follower, name, scripted)
    follower = Follower(plane, TOLERANCE)
    result = follower.follow(follower.tracker.start(), plane)
    assert tried == UNLESS_NEAR[:n_attempts]
    assert np.all(result.positions[:, 2] == chosen)
    assert result.n_folded == n_folded


@pytest.mark.slow
def test_folds_are_restored_only_within_the_tolerance(plane):
    """The key has a bump that the surface lacks: restored, it is farther than a small tolerance."""
    radii = np.linalg.norm(plane.vertices[:, :2] - [0.5, 0.5], axis=1)
    bump = lifted(plane, 0.03 * np.maximum(0, 1 - radii / 0.08))
    pressed = bump.vertices * [1.0, 1.0, 0.0]
    pressed[radii < 0.03] += [0.1, 0.0, 0.0]
    for length, is_restored in ((0.001, False), (0.02, True)):
        tolerance = Tolerance(length)
        follower = Follower(bump, tolerance)
        mesh = TriangleMesh(pressed, plane.faces)
        pose, posed = follower.tracker.track(follower.tracker.start(), bump)
        fit = Fit(pose, posed, mesh, measure(mesh, plane, tolerance), n_steps=1)
        fit.n_folded = n_before = len(Folds(bump).find(fit.mesh, plane))
        assert n_before > 0
        follower._restore_folds(fit, plane)
        assert fit.n_folded == (0 if is_restored else n_before)
        assert fit.n_folded == len(Folds(bump).find(fit.mesh, plane))
        assert fit.errors == measure(fit.mesh, plane, tolerance)


def test_an_easy_frame_takes_one_attempt(plane, n_attempts):
    follower = Follower(plane, TOLERANCE)
    raised = lifted(plane, 0.01 * plane.vertices[:, 0])
    assert isinstance(follower.follow(follower.tracker.start(), raised), Success)
    assert n_attempts == [ATTEMPTS[0]]


def test_a_frame_that_is_near_is_not_tried_from_a_stiff_start(plane, n_attempts):
    """The key has no vertex at the spike, which exceeds the tolerance, but is near elsewhere."""
    follower = Follower(TriangleMesh(*square(0.0, 6)), TOLERANCE)
    assert isinstance(follower.follow(follower.tracker.start(), with_spike(plane)), Failure)
    assert n_attempts == UNLESS_NEAR[:2]


@pytest.mark.slow
def test_a_frame_out_of_reach_is_tried_in_all_ways(plane, n_attempts):
    follower = Follower(plane, TOLERANCE)
    far = TriangleMesh(plane.vertices * [1.0, 1.0, -1.0] + [0.0, 0.0, 0.9], plane.faces[:, ::-1])
    assert isinstance(follower.follow(follower.tracker.start(), far), Failure)
    assert n_attempts == UNLESS_NEAR


@pytest.mark.slow
def test_more_steps_are_tried_where_the_first_ones_nearly_suffice(plane, n_attempts):
    """The key has no vertex at the hill, which exceeds the tolerance by little."""
    follower = Follower(TriangleMesh(*square(0.0, 6)), TOLERANCE)
    hill = lifted(plane, 0.008 * np.sin(10 * np.pi * plane.vertices[:, 0]) ** 2)
    assert isinstance(follower.follow(follower.tracker.start(), hill), Failure)
    assert n_attempts == list(ATTEMPTS[:3])


@pytest.mark.slow
def test_a_frame_that_folds_keep_from_the_tolerance_is_followed(plane, monkeypatch):
    """A patch is mirrored above the surface: normals disagree, so the fit does not move it back."""
    is_patch = np.abs(plane.vertices[:, :2] - 0.5).max(axis=1) < 0.105
    positions = np.where(is_patch[:, None], [1.0, 0.0, 0.01], 0.0)
    positions += plane.vertices * np.where(is_patch[:, None], [-1.0, 1.0, 1.0], 1.0)
    follower = Follower(plane, TOLERANCE)
    state = follower.tracker.start()
    posed = replace(follower.tracker.track(state, plane)[1], positions=positions)
    monkeypatch.setattr(follower.tracker, "track", lambda *_: (state.pose, posed))
    assert not follower._attempt(state, plane, ATTEMPTS[0]).errors.exceeds(TOLERANCE)
    monkeypatch.setattr(Folds, "open", lambda self, mesh, target: mesh)
    assert follower._attempt(state, plane, ATTEMPTS[0]).errors.exceeds(TOLERANCE)


@pytest.mark.slow
@pytest.mark.parametrize("joins", [False, True])
def test_only_a_key_with_the_components_of_the_next_frame_may_lack_vertices(plane, joins):
    """More vertices help a key to follow a spike, but not a frame that joins its components."""
    coarse, spiked = TriangleMesh(*square(0.0, 6)), with_spike(plane)
    frames = []
    for mesh in (coarse, spiked):
        beside = mesh.vertices + np.array([1.2, 0.0, 0.0])
        vertices = np.concatenate([mesh.vertices, beside])
        faces = np.concatenate([mesh.faces, mesh.faces + len(mesh.vertices)])
        if joins and mesh is spiked:
            is_corner = np.isclose(np.abs(vertices[:, 0] - 1.1), 0.1) & (vertices[:, 1] < 0.03)
            bridge = np.flatnonzero(is_corner)[[0, 2, 1]]
            faces = np.concatenate([faces, bridge[None]])
        frames.append(MeshSequence(vertices[None].astype(np.float32), faces.astype(np.int32)))
    registered = register(meshreel.concatenate(frames), tolerance=0.4)
    assert [segment.n_frames for segment in registered.segments] == [1, 1]
    assert registered.segments[0].may_lack_vertices != joins


def test_fragments_that_holes_cut_off_make_no_better_key():
    """A capsule without a ring near its end, with a hole there, and without holes."""
    vertices, faces = capsule(30, 20)
    centroids = vertices[faces].mean(axis=1)
    is_ring = np.abs(centroids[:, 2] - 0.8) < 0.08
    cut, holed, closed = (
        Topology.of_mesh(clean(MeshFrame(vertices, faces[~removed])))
        for removed in (is_ring, is_ring & (centroids[:, 0] > 0), np.zeros(len(faces), bool))
    )
    assert cut < holed < closed
    assert [one.n_components for one in (cut, holed, closed)] == [1, 1, 1]


@pytest.mark.parametrize(
    ("n_frames", "n_in_run", "n_grown", "is_refined_kept"),
    [(20, 60, 2, False), (60, 60, 2, True), (20, 20, 1, False)],
)
def test_a_refined_key_is_kept_if_its_frames_cost_fewer_bits(
    plane, n_frames, n_in_run, n_grown, is_refined_kept, monkeypatch
):
    """Its vertices move in every frame: twice the frames do not pay for twice the vertices.

    In 20 frames no segment of such a key could pay, so none is tried.
    """
    spiked, grown = with_spike(plane), []

    def grow(frames, key, key_mesh, name, *_):
        grown.append(name)
        n_followed = 10 if name == "0" else n_frames
        positions = np.zeros((n_followed, len(key_mesh.mesh.vertices), 3))
        return Segment(0, key, positions, key_mesh, (), 0, (), may_lack_vertices=True)

    def refined(self, _):
        return KeyMesh.of_mesh(TriangleMesh(*square(0.0, 57)))

    monkeypatch.setattr(growing, "_grow", grow)
    monkeypatch.setattr(growing, "_complete", lambda frames, key, key_mesh, *_: key_mesh)
    monkeypatch.setattr(KeyMesh, "refined", refined)
    frames = SimpleNamespace(mesh=lambda _: spiked, wedges=lambda _: None)
    run = range(n_in_run)
    chosen = growing._longest(frames, 0, run, TOLERANCE, TemporaryStore(), lambda _: None)
    n_verts = {1681: False, 3249: True}
    assert n_verts[len(chosen.key_mesh.mesh.vertices)] == is_refined_kept
    assert len(grown) == n_grown


@pytest.mark.parametrize(
    ("n_added", "side", "names"),
    [
        (0, 43, ["0"]),
        (1, 43, ["0"]),
        (3200, 43, ["0", "0_given"]),
        (0, 46, ["0", "0_refined"]),
        (1, 46, ["0", "0_refined"]),
    ],
)
def test_a_key_is_registered_again_without_large_additions_or_refined(
    plane, n_added, side, names, monkeypatch
):
    """It is refined, and then completed, if its frame lacks vertices."""
    spiked, grown, completed_keys = with_spike(plane), [], []

    def grow(frames, key, key_mesh, name, *_):
        grown.append(name)
        positions = np.zeros((10, len(key_mesh.mesh.vertices), 3))
        return Segment(0, key, positions, key_mesh, (), 0, ((10, "lost"),), may_lack_vertices=True)

    monkeypatch.setattr(growing, "_grow", grow)
    larger = KeyMesh.of_mesh(TriangleMesh(*square(0.0, side)))  # 1.1 or 1.26 times the vertices
    monkeypatch.setattr(KeyMesh, "refined", lambda self, _: larger)

    def completed(frames, key, key_mesh, *_):
        completed_keys.append(key_mesh)
        return replace(key_mesh, n_added=n_added) if n_added else key_mesh

    monkeypatch.setattr(growing, "_complete", completed)
    frames = SimpleNamespace(mesh=lambda _: spiked, wedges=lambda _: None)
    growing._longest(frames, 0, range(60), TOLERANCE, TemporaryStore(), lambda _: None)
    assert grown == names
    assert any(key_mesh is larger for key_mesh in completed_keys) == ("0_refined" in names)


@pytest.mark.parametrize(
    ("height", "n_waves", "length", "is_found", "attempts"),
    [(0.1, 3, 1e-3, True, [0]), (0.05, 3, 3e-4, True, [0, 2]), (0.1, 5, 1e-3, False, [0, 2])],
)
def test_a_frame_completes_a_key_after_as_many_attempts_as_it_needs(
    plane, n_attempts, height, n_waves, length, is_found, attempts
):
    """A fit of one step misses all of them. Frames after one out of reach are not tried."""
    wave = lifted(plane, height * np.sin(n_waves * np.pi * plane.vertices[:, 0]) ** 2)
    frames = [wave] if is_found else [wave, plane]
    found = list(Follower(plane, Tolerance(length)).registered_keys(frames))
    assert len(found) == is_found
    assert n_attempts == [ATTEMPTS[number] for number in attempts]


@pytest.mark.slow
def test_a_key_whose_completion_ends_earlier_stays_as_given():
    """Only the last frame of a capsule has its upper third: the other frames lack too much of it.

    The completed key follows none of them. Without it, the given key follows all but the last.
    """
    frames = []
    for number in range(6):
        vertices, faces = capsule(42 + number, 38 + number, number / 6)
        is_low = vertices[faces][:, :, 2].mean(axis=1) < 0.3
        faces = faces if number == 5 else faces[is_low]
        frames.append((bent(vertices, 0.05 * number), faces))
    registered = register(as_frames(frames), tolerance=0.5)
    first, last = registered.segments
    assert (first.numbers, last.numbers) == (range(5), range(5, 6))
    assert first.key_mesh.n_added == 0
    assert [number for number, _ in first.reasons] == [5]


def test_a_missing_part_is_not_pulled_to_a_distant_surface():
    """A flap lies 0.1 above a plane that it was 0.4 above in the key; the frame lacks the flap."""
    ground, faces = square(0.0, 31)
    flap = ground[:, [0, 1, 2]] * [0.5, 0.5, 1.0] + [0.25, 0.25, 0.4]
    key = TriangleMesh(np.concatenate([ground, flap]), np.concatenate([faces, faces + len(ground)]))
    tracker = Tracker(key)
    state = tracker.start()
    low = key.vertices - np.arange(len(key.vertices))[:, None] // len(ground) * [0.0, 0.0, 0.3]
    state = replace(state, details=low - key.vertices)
    _, posed = tracker.track(state, TriangleMesh(ground, faces))
    assert posed.positions[len(ground) :, 2].min() > 0.09
