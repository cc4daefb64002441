"""Raw meshes are welded, and lose degenerate faces, small components and debris."""

import numpy as np
import pytest

from meshreel import MeshFrame
from meshreel.registration.cleaning import clean
from meshreel.registration.debris import debris_faces
from samples.captures import capsule
from samples.shapes import cube, square


def frame(vertices, faces):
    return MeshFrame(np.asarray(vertices, np.float32), np.asarray(faces, np.int32))


def test_vertices_at_one_position_are_welded():
    vertices, faces = cube()
    cleaned = clean(frame(vertices[faces].reshape(-1, 3), np.arange(36).reshape(-1, 3)))
    assert len(cleaned.vertices) == 8
    assert np.array_equal(cleaned.vertices[cleaned.faces], vertices[faces])


def test_faces_without_area_are_removed_and_counted():
    vertices, faces = cube()
    cleaned = clean(frame(vertices, np.vstack([[[0, 0, 1]], faces, [[3, 3, 3]]])))
    assert cleaned.removed.n_degenerate == 2
    assert np.array_equal(cleaned.raw_faces, np.arange(1, 13))


def test_components_below_an_area_are_removed_and_counted():
    vertices, faces = capsule(12, 12)
    crumb = 5 + 1e-3 * np.eye(3)
    both = frame(np.vstack([crumb, vertices]), np.vstack([[[0, 1, 2]], faces + 3]))
    cleaned = clean(both)
    assert (cleaned.n_components, cleaned.removed.n_small_components) == (1, 1)
    assert len(cleaned.vertices) == len(vertices)
    assert clean(both, max_removed_area=1e-7).removed.n_small_components == 0


def test_signs_of_zero_are_one_position():
    cleaned = clean(frame([[0, 0, 0], [-0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 2, 3], [1, 3, 2]]))
    assert len(cleaned.vertices) == 3


def test_a_frame_without_area_is_empty():
    assert clean(frame(np.zeros((3, 3)), [[0, 1, 2]])).is_empty


def test_vertices_at_cracks_are_welded():
    """But for the outline of a mesh whose edges are shorter than the distance."""
    vertices, faces = square(n=11)
    rng = np.random.default_rng(0)
    corners = vertices[faces].reshape(-1, 3)
    offsets = rng.uniform(-1e-3, 1e-3, corners.shape) * (rng.random((len(corners), 1)) < 0.5)
    soup = frame(corners + offsets, np.arange(len(corners)).reshape(-1, 3))
    cleaned = clean(soup, max_crack=0.01)
    assert (len(cleaned.vertices), len(cleaned.faces), cleaned.n_components) == (121, 200, 1)
    assert cleaned.removed.n_welded > 100
    np.testing.assert_allclose(cleaned.vertices[cleaned.faces], vertices[faces], atol=2e-3)
    closer = clean(soup, max_crack=1e-5)
    assert closer.removed.n_welded == 0
    fine = clean(frame(vertices, faces), max_crack=0.11)
    assert (len(fine.vertices), fine.removed.n_welded) == (121, 0)


BESIDE = np.array([1.0, 0.0, 0.0])
RADIUS = 0.05


def with_balls(places, number, is_turned=False):
    """A capsule that moves by 0.02 in each frame, and small balls next to it, cleaned."""
    body, faces = capsule(30 + number % 2, 20)
    ball, ball_faces = capsule(8, 8)
    ball = RADIUS * ball * [3.3, 3.3, 1]
    vertices = [
        body + 0.02 * number * BESIDE,
        *(ball + BESIDE + RADIUS * np.array(p) for p in places),
    ]
    starts = len(body) + len(ball) * np.arange(len(places))
    faces = np.concatenate([faces, *(ball_faces + start for start in starts)])
    cleaned = clean(frame(np.concatenate(vertices), faces), max_removed_area=0.01)
    return cleaned.turned() if is_turned else cleaned


def debris_of(meshes):
    """The number of components in each frame that are debris."""
    get_mesh = dict(enumerate(meshes)).get
    return [
        mesh.without(debris_faces(get_mesh, n)).removed.n_debris for n, mesh in enumerate(meshes)
    ]


@pytest.mark.parametrize(
    ("places", "n_debris"),
    [
        ([[], [(0, 0, 0)], [], []], [0, 1, 0, 0]),
        ([[], [], [], [(0, 0, 0)]], [0, 0, 0, 1]),
        ([[(0, 9, 9), (0, 0, 9)], [(0, 9, -9)], [(0, -9, -9)], [(0, -9, 0)]], [2, 1, 1, 1]),
        (4 * [[(0, 0, 0)]], [0, 0, 0, 0]),
        ([[(0, 0, 0)], [(0, 0, 0)], [], []], [0, 0, 0, 0]),
        ([[], [(0, 0, 0)], [(0, 0, 0)], [], []], [0, 1, 1, 0, 0]),
        ([[], [], [(0, 0, 0)], [(0, 0, 0.8)]], [0, 0, 0, 0]),
        ([[(0, 0, z)] for z in (0, 4, 9, 13)], [0, 0, 0, 0]),
        ([[(0, 0, z)] for z in (0, 4, -4, 0)], [1, 1, 1, 1]),
        (3 * [[]] + [[(0, y, z) for y in range(-9, 9, 3) for z in range(-9, 9, 3)]], [0, 0, 0, 0]),
    ],
    ids=[
        "one frame",
        "last frame",
        "random places",
        "still",
        "leaves",
        "two frames",
        "enters",
        "fast",
        "back and forth",
        "too many",
    ],
)
@pytest.mark.parametrize("turned", [None, 1])
def test_components_that_neighboring_frames_lack_are_debris(places, n_debris, turned):
    meshes = [with_balls(one, number, number == turned) for number, one in enumerate(places)]
    assert debris_of(meshes) == n_debris


def test_parts_that_holes_cut_off_are_no_debris():
    whole, end = with_balls([], 0), with_balls([], 1)
    heights = end.vertices[end.faces][:, :, 2].mean(axis=1)
    cut = clean(frame(end.vertices, end.faces[np.abs(heights - 0.9) > 0.03]))
    assert cut.n_components == 2
    assert debris_of([whole, cut, whole]) == [0, 0, 0]


def test_without_debris_a_mesh_refers_to_the_same_raw_faces():
    mesh = with_balls([(0, 0, 0)], 0)
    left = mesh.without(debris_faces({0: mesh, 1: with_balls([], 1)}.get, 0))
    body = with_balls([], 0)
    assert (left.n_components, left.removed.n_debris) == (1, 1)
    assert np.array_equal(left.raw_faces, np.arange(len(body.faces)))
    assert np.array_equal(left.vertices[left.faces], body.vertices[body.faces])
    assert 0.005 < left.removed.debris_share < 0.02
