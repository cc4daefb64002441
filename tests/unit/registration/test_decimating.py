"""Keys lose the vertices that the tolerance does not need."""

import numpy as np
import pytest

import meshreel
from meshreel import Attribute, Domain, Kind, MeshSequence, Surface
from meshreel.model.surface import FaceGroups
from meshreel.registration.decimating import decimated_key, detail_weights
from meshreel.registration.refining import KeyMesh
from meshreel.registration.register import register
from meshreel.registration.triangle_mesh import TriangleMesh
from meshreel.registration.verification import Tolerance
from samples.captures import as_frames, bent, capsule, revolved
from samples.dense_distances import promised
from samples.shapes import square


@pytest.mark.parametrize(("length", "share"), [(0.012, 0.9), (0.028, 0.6)])
def test_a_key_has_fewer_vertices_within_the_tolerance(length, share):
    vertices, faces = capsule(60, 54)
    vertices /= 2
    whole = KeyMesh.of_mesh(TriangleMesh(vertices, faces))
    key = decimated_key(whole, faces, Tolerance(length)).mesh
    assert len(key.vertices) < share * len(vertices)
    p99, side = promised((key.vertices, key.faces), (vertices, faces), length)
    assert p99 < 0.5
    assert side == 0


@pytest.mark.slow
def test_a_key_has_more_vertices_for_a_higher_quality():
    vertices, faces = capsule(100, 90)
    whole = KeyMesh.of_mesh(TriangleMesh(vertices / 2, faces))
    keys = [decimated_key(whole, faces, Tolerance(0.004, quality)) for quality in (1, 60, 80, 100)]
    counts = [len(key.mesh.vertices) for key in keys]
    assert counts[0] == counts[1] < 0.9 * counts[2] < 0.8 * counts[3] < len(vertices)


def test_distances_weigh_more_where_the_raw_mesh_is_dense_or_curved():
    heights = np.cos(np.linspace(0, np.pi, 90)) + 0.3 * np.sin(np.linspace(0, np.pi, 90)) ** 2
    dense = TriangleMesh(*revolved(np.full(88, 0.3), heights, 40))
    weights = detail_weights(dense)
    rings = np.diff(-heights)[:-1].repeat(40)  # from one ring to the next
    middle = np.abs(dense.vertices[:-2, 2]) < 0.7
    sparse = rings > np.median(rings[middle])
    assert weights[:-2][middle & ~sparse].mean() > 1.14 * weights[:-2][middle & sparse].mean()
    flat = TriangleMesh(*square(0.0, 11))
    np.testing.assert_allclose(detail_weights(flat), 1.0)
    sphere, faces = capsule(60, 54)
    weights = detail_weights(TriangleMesh(sphere, faces))
    is_cap = np.abs(sphere[:, 2]) > 0.95
    assert weights[is_cap].mean() > 2 * weights[~is_cap].mean()
    np.testing.assert_allclose(detail_weights(TriangleMesh(100 * sphere, faces)), weights)


def test_corners_are_at_vertices_of_the_raw_mesh():
    vertices, faces = capsule(40, 36)
    key = decimated_key(KeyMesh.of_mesh(TriangleMesh(vertices, faces)), faces, Tolerance(0.01))
    places = np.einsum("mkc,mkcd->mkd", key.weights, vertices[faces[key.parents]])
    moved = np.linalg.norm(places - key.mesh.vertices[key.mesh.faces], axis=-1)
    assert moved.max() < 0.01
    assert set(np.unique(key.weights)) == {0.0, 1.0}


def colored(vertices, faces, attributes=(), groups=()):
    surface = Surface(attributes=attributes, groups=groups)
    return MeshSequence(vertices[None].astype(np.float32), faces, 25.0, surface=surface)


def two_frames(of):
    """A capsule that bends, with what `of` returns for the vertices and faces before."""
    frames = []
    for n_around, angle in ((50, 0.0), (52, 0.05)):
        vertices, faces = capsule(60, n_around)
        frames.append(colored(bent(vertices, angle), faces, **of(vertices, faces)))
    return register(meshreel.concatenate(frames), tolerance=0.5, quality=68)


@pytest.mark.slow
def test_charts_and_groups_keep_their_borders():
    def halves(vertices, faces):
        is_upper = vertices[faces].mean(axis=1)[:, 2] > 0
        uv = vertices[faces][..., :2] / 4 + np.where(is_upper, 0.75, 0.25)[:, None, None]
        return {
            "attributes": (Attribute("uv", Kind.UV, Domain.CORNER, uv.reshape(-1, 2)),),
            "groups": (FaceGroups("part", ("lower", "upper"), is_upper.astype(np.int32)),),
        }

    found = two_frames(halves)
    (segment,), key = found.sequence.segments, found.segments[0].key
    assert segment.n_verts < 0.8 * found.raw.segments[key].n_verts
    heights = segment.vertices[key][segment.faces][..., 2]
    uv = segment.surface.attributes[0].per_item().reshape(-1, 3, 2)
    is_upper = uv.min(axis=(1, 2)) > 0.5
    assert np.array_equal(is_upper, uv.max(axis=(1, 2)) > 0.5)
    assert np.array_equal(segment.surface.groups[0].numbers, is_upper)
    raw_heights = found.raw.segments[key].vertices[0][..., 2]
    ring = 2 * np.abs(raw_heights).min() + 0.01
    assert heights[is_upper].min() > -ring
    assert heights[~is_upper].max() < ring


def test_vertices_with_colors_all_remain():
    def colors(vertices, faces):
        values = np.clip(127.5 * (vertices + 1), 0, 255).astype(np.uint8)
        return {"attributes": (Attribute("color", Kind.COLOR, Domain.VERTEX, values),)}

    found = two_frames(colors)
    key = found.segments[0].key
    assert found.sequence.segments[0].n_verts == found.raw.segments[key].n_verts
    assert not any(note.startswith("kept ") for note in found.notes())


def test_a_frame_that_cannot_be_followed_is_decimated_too():
    vertices, faces = capsule(60, 50)
    raw = as_frames([(vertices, faces), (4 * vertices, faces)])
    found = register(raw, tolerance=0.2)
    assert [segment.n_frames for segment in found.sequence.segments] == [1, 1]
    n_verts = [segment.n_verts for segment in found.sequence.segments]
    assert max(n_verts) < 0.92 * len(vertices)
    note = f"kept {sum(n_verts)} of {2 * len(vertices)} vertices of keys, as the quality allows"
    assert note in found.notes()
