"""Refinement of a key adds vertices where it bends and keeps its surface."""

import numpy as np
import pytest

from meshreel import Attribute, Domain, Kind, Surface
from meshreel.kernel.order import opposite_sides
from meshreel.registration import growing
from meshreel.registration.refining import KeyMesh
from meshreel.registration.register import register
from meshreel.registration.triangle_mesh import TriangleMesh
from samples.captures import capsule, capture
from samples.shapes import square


@pytest.fixture(scope="module")
def key():
    vertices, faces = capsule(12, 10)
    return KeyMesh.of_mesh(TriangleMesh(vertices, faces))


@pytest.fixture(scope="module")
def refined(key):
    return key.refined(0.003)


def test_refinement_keeps_the_surface(key, refined):
    assert refined.is_refined
    assert len(refined.mesh.vertices) > 2 * len(key.mesh.vertices)
    centers = refined.mesh.vertices[refined.mesh.faces].mean(axis=1)
    assert key.mesh.closest(centers).distances.max() < 1e-12
    areas = np.bincount(refined.parents[:, 0], refined.mesh.areas)
    assert areas == pytest.approx(key.mesh.areas)


def test_refinement_keeps_the_mesh_closed(refined):
    opposite = opposite_sides(refined.mesh.faces, len(refined.mesh.vertices))
    assert not np.any(opposite == np.arange(refined.mesh.faces.size))


def test_weights_locate_each_corner_in_its_parent(key, refined):
    corners = key.mesh.vertices[key.mesh.faces[refined.parents]]
    points = np.einsum("mkc,mkcd->mkd", refined.weights, corners)
    assert points == pytest.approx(refined.mesh.vertices[refined.mesh.faces])


def test_a_finer_limit_adds_vertices_only_where_the_surface_bends():
    vertices, faces = square(0.0, 11)
    vertices[:, 2] = np.maximum(vertices[:, 0] - 0.5, 0.0)
    refined = KeyMesh.of_mesh(TriangleMesh(vertices, faces)).refined(0.005)
    added = refined.mesh.vertices[len(vertices) :]
    assert len(added) > 0
    assert added[:, 0] == pytest.approx(0.5, abs=0.051)
    assert {0.0, 1.0} <= set(added[:, 1])  # boundaries bend too


def test_a_mesh_that_is_fine_enough_stays(key):
    same = key.refined(1.0)
    assert same is key
    assert not same.is_refined


@pytest.mark.slow
def test_texture_coordinates_are_interpolated_on_a_refined_key(monkeypatch):
    monkeypatch.setattr(growing, "decimated_key", lambda whole, *_: whole.refined(0.002))
    raw = capture(2, 0.1)
    textured = []
    for one in raw.segments:
        uv = Attribute("uv", Kind.UV, Domain.VERTEX, one.read(0, 1)[0, :, ::2])
        textured.append(one.replace(surface=Surface(attributes=(uv,))))
    registered = register(raw.of_segments(textured), tolerance=2.0)
    (segment,), key = registered.sequence.segments, registered.segments[0].key
    (uv,) = segment.surface.attributes
    at_corners = segment.read(key, key + 1)[0][segment.faces.ravel()]
    assert uv.per_item() == pytest.approx(at_corners[:, ::2], abs=1e-5)
