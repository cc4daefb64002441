"""Decimation keeps surfaces, boundaries, seams and topology."""

import numpy as np
import pytest

from meshreel import InvalidInputError
from meshreel.kernel.decimation import decimated
from meshreel.kernel.order import opposite_sides
from meshreel.registration.triangle_mesh import TriangleMesh
from samples.captures import capsule
from samples.shapes import square

FAR = 1e9


def mesh_of(vertices, faces):
    used, numbers = np.unique(faces, return_inverse=True)
    return TriangleMesh(vertices[used], numbers.reshape(-1, 3).astype(np.int32))


@pytest.mark.parametrize("offset", [0.0, 1000.0])
def test_a_closed_surface_stays_closed_and_near(offset):
    vertices, faces = capsule(40, 36)
    n_remaining = []
    for max_rms in (1e-4, 1e-3, 1e-2):
        remaining, _ = decimated(vertices + offset, faces, faces, max_rms, FAR, FAR)
        mesh = mesh_of(vertices, remaining)
        assert not np.any(
            opposite_sides(mesh.faces, len(mesh.vertices)) == np.arange(mesh.faces.size)
        )
        assert len(mesh.vertices) - len(mesh.faces) / 2 == 2
        distances = mesh.closest(vertices).distances
        assert np.sqrt(np.mean(distances**2)) < 2 * max_rms
        n_remaining.append(len(remaining))
    assert 0.9 * len(faces) > n_remaining[0] > 1.5 * n_remaining[1] > 3 * n_remaining[2]


def test_a_vertex_bound_holds_where_the_mean_does_not():
    vertices, faces = square(0.0, 41)
    vertices[:, 2] = 0.05 * np.exp(-((vertices[:, :2] - 0.5) ** 2).sum(axis=1) / 0.001)
    far, near = (
        mesh_of(vertices, decimated(vertices, faces, faces, 0.01, limit, FAR)[0])
        for limit in (FAR, 0.002)
    )
    assert far.closest(vertices).distances.max() > 0.03
    assert near.closest(vertices).distances.max() < 0.01


def test_weights_keep_vertices_where_they_are_large():
    vertices, faces = capsule(40, 36)
    is_upper = vertices[:, 2] > 0
    weights = np.where(is_upper, 4.0, 1.0)
    limits = 1e-3, FAR, FAR
    used = np.unique(decimated(vertices, faces, faces, *limits, weights)[0])
    assert is_upper[used].sum() > 1.5 * (~is_upper[used]).sum()
    equal = decimated(vertices, faces, faces, *limits, np.full(len(vertices), 4.0))[0]
    assert np.array_equal(equal, decimated(vertices, faces, faces, *limits)[0])


def test_a_flat_sheet_keeps_its_outline():
    vertices, faces = square(0.0, 21)
    remaining, _ = decimated(vertices, faces, faces, 1e-6, FAR, FAR)
    assert len(remaining) == 2
    assert mesh_of(vertices, remaining).areas.sum() == pytest.approx(1.0)


def test_edges_become_no_longer_than_the_limit():
    vertices, faces = square(0.0, 21)
    remaining, _ = decimated(vertices, faces, faces, 1e-6, FAR, 0.21)
    corners = vertices[remaining]
    lengths = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    assert 0.1 < lengths.max() < 0.2101
    assert len(remaining) < len(faces) / 4


def test_seams_stay_in_place_and_corners_on_their_side():
    vertices, faces = square(0.0, 21)
    is_right = vertices[faces].mean(axis=1)[:, 0] > 0.5
    wedges = faces + len(vertices) * is_right[:, None]
    remaining, remaining_wedges = decimated(vertices, faces, wedges, 1e-6, FAR, FAR)
    assert len(remaining) < 20
    assert np.array_equal(remaining_wedges % len(vertices), remaining)
    on_right = remaining_wedges >= len(vertices)
    assert np.array_equal(on_right.all(axis=1), on_right.any(axis=1))
    corners = vertices[remaining][..., 0]
    assert (corners[on_right[:, 0]] >= 0.5).all()
    assert (corners[~on_right[:, 0]] <= 0.5).all()
    assert mesh_of(vertices, remaining).areas.sum() == pytest.approx(1.0)


def test_wedges_of_all_faces_keep_all_vertices():
    vertices, faces = capsule(12, 10)
    wedges = np.arange(faces.size).reshape(-1, 3)
    remaining, remaining_wedges = decimated(vertices, faces, wedges, 1.0, FAR, FAR)
    assert np.array_equal(remaining, faces)
    assert np.array_equal(remaining_wedges, wedges)


def test_a_tetrahedron_is_not_decimated():
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    vertices = np.vstack([np.zeros(3), np.eye(3)])
    assert len(decimated(vertices, faces, faces, 10.0, FAR, FAR)[0]) == 4


def test_irregular_meshes_lose_only_regular_vertices():
    vertices, faces = square(0.0, 11)
    third_face = np.array([[60, 61, len(vertices)]])  # on an edge of two other faces
    irregular = np.vstack([faces, faces[:7], third_face, [[5, 5, 6], [8, 8, 8]]])
    vertices = np.vstack([vertices, [[0.5, 0.5, 1.0]], [[7.0, 7.0, 7.0]]])
    remaining, _ = decimated(vertices, irregular, irregular, 1e-6, FAR, FAR)
    assert 20 < len(remaining) < len(irregular)
    assert {5, 8, 60, 61, 121} <= set(remaining.ravel())


def test_a_mesh_without_faces_is_returned():
    none = np.zeros((0, 3), np.int32)
    assert decimated(np.zeros((0, 3)), none, none, 1.0, 1.0, 1.0)[0].shape == (0, 3)


def test_a_vertex_that_does_not_exist_is_an_error():
    vertices, faces = square(0.0, 3)
    faces[4, 1] = 9
    with pytest.raises(InvalidInputError, match="number 4"):
        decimated(vertices, faces, faces, 1.0, 1.0, 1.0)
