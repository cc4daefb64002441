"""Keys are completed with the surface that other frames show beyond their boundary."""

import numpy as np
import pytest

from meshreel.model.geometry.connectivity import boundary_edges
from meshreel.registration.completing import RegisteredKey, complete_key, may_lack_surface
from meshreel.registration.graph import rotations_of
from meshreel.registration.refining import KeyMesh
from meshreel.registration.triangle_mesh import TriangleMesh
from meshreel.registration.verification import Tolerance
from samples.captures import capsule
from samples.meshes import grid_faces, waving_grid

TOLERANCE = Tolerance(0.005)
TURN = rotations_of(np.array([[0.3, -0.2, 0.5]]))[0]
SHIFT = np.array([0.4, -0.3, 0.2])


def cut(keeps, n_rings=42, n_around=38, phase=0.0):
    """The faces of a capsule whose centroids are kept."""
    vertices, faces = capsule(n_rings, n_around, phase)
    kept = faces[keeps(vertices[faces].mean(axis=1))]
    used, corners = np.unique(kept, return_inverse=True)
    return TriangleMesh(vertices[used], corners.reshape(-1, 3).astype(np.int32))


def registered_key(mesh, target):
    """A frame in which the key is turned and shifted."""
    moved, frame = (
        TriangleMesh(one.vertices @ TURN.T + SHIFT, one.faces) for one in (mesh, target)
    )
    return RegisteredKey(moved, np.tile(TURN, (len(mesh.vertices), 1, 1)), frame)


def completed_by(key, *targets):
    """Complete a key with the patches of frames in which it is turned and shifted."""
    patches = [
        patch
        for target in targets
        for patch in registered_key(key, target).patches(key.vertices, TOLERANCE)
    ]
    return complete_key(KeyMesh.of_mesh(key), key, patches, TOLERANCE)


def below(height):
    return lambda points: points[:, 2] < height


def away(*place):
    return lambda points: np.linalg.norm(points - place, axis=1) > 0.2


WHOLE = cut(lambda points: points[:, 2] < np.inf, 45, 40, 0.3)


@pytest.mark.parametrize("keeps", [below(0.5), away(0.3, 0, 0)], ids=["end", "hole"])
def test_a_patch_closes_the_boundary(keeps):
    key = cut(keeps)
    found = completed_by(key, WHOLE)
    mesh, n_given = found.mesh, len(key.faces)
    assert found.n_added == len(mesh.faces) - n_given > 20
    assert np.array_equal(mesh.faces[:n_given], key.faces)
    assert len(boundary_edges(mesh.faces)) <= 0.1 * len(boundary_edges(key.faces))
    assert WHOLE.closest(mesh.centroids).distances.max() < 0.02
    assert mesh.closest(WHOLE.centroids).distances.max() < 0.02
    assert mesh.orientation == 1
    assert has_sides_once(mesh)


def has_sides_once(mesh):
    """Return whether no two faces have a side in the same direction."""
    sides = np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2).reshape(-1, 2)
    return len(np.unique(sides, axis=0)) == len(sides)


def test_faces_of_patches_that_conflict_are_left_out():
    long_faces = cut(lambda points: points[:, 2] < np.inf, 24, 60)
    assert has_sides_once(completed_by(cut(away(0.3, 0, 0)), long_faces).mesh)


@pytest.mark.parametrize(
    ("last_angle", "is_flipped", "is_added"),
    [(0, False, True), (np.pi, False, False), (0, True, False)],
)
def test_only_surface_that_continues_the_key_is_added(last_angle, is_flipped, is_added):
    """Surface that rolls back over the key is mostly not beyond it; its back side is another."""
    angles = np.r_[np.zeros(20), np.linspace(0, last_angle, 10), np.full(20, last_angle)]
    steps = 0.05 * np.stack([np.cos(angles), 0 * angles, np.sin(angles)], axis=1)
    profile = np.cumsum(steps, axis=0)[:, np.newaxis]
    vertices = profile + np.linspace(0, 1, 21)[:, np.newaxis] * [0, 1, 0]
    flat = TriangleMesh(vertices[:20].reshape(-1, 3), grid_faces(20, 21))
    faces = grid_faces(50, 21)
    rolled = TriangleMesh(vertices.reshape(-1, 3), faces[:, ::-1] if is_flipped else faces)
    assert bool(completed_by(flat, rolled).n_added) == is_added


def test_corners_of_patches_are_at_the_nearest_places():
    key = cut(below(0.5))
    found = completed_by(key, WHOLE)
    added = slice(len(key.faces), None)
    closest = key.closest(found.mesh.centroids[added])
    assert (found.parents[added] == closest.faces[:, np.newaxis]).all()
    assert (found.weights[added] == np.eye(3)[closest.weights.argmax(axis=1)][:, None]).all()


def test_several_frames_complete_a_key():
    both = lambda points: away(0.3, 0, 0.3)(points) & away(-0.3, 0, -0.3)(points)  # noqa: E731
    key = cut(both)
    one, other = cut(away(0.3, 0, 0.3), 45, 40), cut(away(-0.3, 0, -0.3), 46, 39)
    found = [completed_by(key, *all_) for all_ in [(), (one,), (one, other), (one, other, one)]]
    assert [each.n_added for each in found] == [
        len(each.mesh.faces) - len(key.faces) for each in found
    ]
    n_open = [len(boundary_edges(each.mesh.faces)) for each in found]
    assert n_open[1] < 0.6 * n_open[0]
    assert n_open[2] < 0.3 * n_open[0]
    assert n_open[3] == n_open[2]


def test_a_frame_adds_what_an_earlier_one_left_open():
    """Each frame shows another part of a hole; parts of patches complete it."""
    key = cut(lambda points: np.abs(points - [0.3, 0, 0]).max(axis=1) > 0.25)
    low, high = below(0.1), lambda points: points[:, 2] > -0.05
    found = completed_by(key, cut(low, 45, 40), cut(high, 46, 39))
    assert len(boundary_edges(found.mesh.faces)) <= 0.1 * len(boundary_edges(key.faces))
    assert found.mesh.closest(WHOLE.centroids).distances.max() < 0.02


def test_a_frame_that_shows_no_more_changes_nothing():
    key = cut(below(0.5))
    for target in (cut(below(0.5)), cut(below(0.3)), cut(lambda points: points[:, 2] > 0.8)):
        assert not completed_by(key, target).n_added


def test_only_a_key_with_a_long_boundary_may_lack_surface():
    pinhole = cut(lambda points: np.linalg.norm(points - [0.3, 0, 0], axis=1) > 0.03)
    assert pinhole.is_boundary.any()
    assert [may_lack_surface(key, Tolerance(0.02)) for key in (WHOLE, pinhole)] == [False, False]
    assert may_lack_surface(cut(away(0.3, 0, 0)), Tolerance(0.02))


def test_the_outline_of_a_sheet_is_no_hole():
    sheet = waving_grid(1, 30, 30, np.float64)
    faces = sheet.faces
    centers = sheet.vertices[0][faces].mean(axis=1)[:, :2]
    is_inside = np.linalg.norm(centers - centers.mean(axis=0), axis=1) < 0.5
    assert not may_lack_surface(TriangleMesh(sheet.vertices[0], faces), Tolerance(0.02))
    assert may_lack_surface(TriangleMesh(sheet.vertices[0], faces[~is_inside]), Tolerance(0.02))
