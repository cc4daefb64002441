"""Resolutions, levels and stencils of vertices, compared with the plain reader."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from conformance.hierarchy import passes_of, resolutions_of
from meshreel.codec.reel.normative.mesh import FieldMesh
from samples.costs import draws
from samples.meshes import grid_faces, octahedron_faces

SIZE = 7


def several_components():
    """A grid, an octahedron, a triangle and three isolated vertices, in shuffled order."""
    faces = np.concatenate([grid_faces(13, 17), octahedron_faces() + 221, [[227, 228, 229]]])
    return np.random.default_rng(1).permutation(233)[faces], 233


def fan(n_rim=40):
    """A fan: one vertex is adjacent to all."""
    rim = np.arange(n_rim)
    return np.stack([np.full(n_rim, n_rim), rim, (rim + 1) % n_rim], axis=1), n_rim + 1


def book(n_pages=40):
    """Triangles on a common edge: nearly all vertices are independent of each other."""
    pages = np.arange(2, n_pages + 2)
    return np.stack([np.zeros_like(pages), np.ones_like(pages), pages], axis=1), n_pages + 2


def divided_edges():
    """A grid, most of its edges divided by a vertex, and a chain; edges as degenerate faces."""
    faces = grid_faces(8, 11)
    ends = np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)), axis=0)
    whole, (low, high) = ends[:20], ends[20:].T
    middles = 88 + np.arange(len(low))
    n_verts = 88 + len(low) + 12
    chain = np.arange(n_verts - 12, n_verts)
    edges = [whole, np.stack([low, middles], 1), np.stack([high, middles], 1)]
    edges.append(np.stack([chain[:-1], chain[1:]], 1))
    faces = np.concatenate(edges)[:, [0, 1, 1]]
    return np.random.default_rng(2).permutation(n_verts)[faces], n_verts


MESHES = {
    "components": several_components(),
    "fan": fan(),
    "book": book(),
    "large book": book(400),
    "grid": (grid_faces(20, 9), 180),
    "divided edges": divided_edges(),
    "isolated": (np.zeros((1, 3), np.int64), 5),
}


def assert_follows_the_format(faces, n_verts):
    """Order, levels, stencils and contexts equal those of the plain reader, which is returned."""
    mesh = FieldMesh(np.asarray(faces, np.int32), n_verts, SIZE)
    wanted = resolutions_of(np.asarray(faces).tolist(), n_verts, SIZE)
    vertices = [vertex for one in wanted for vertex in one]
    assert mesh.order.tolist() == [vertex.number for vertex in vertices]
    numbers = mesh.hierarchy.level_resolutions.tolist()
    sizes = np.diff(mesh.hierarchy.level_starts)
    assert np.bincount(numbers, sizes).tolist() == list(map(len, wanted))
    stencils = np.stack([mesh.hierarchy.stencil, mesh.hierarchy.hops], axis=2)
    for result, vertex in zip(stencils, vertices, strict=True):
        pairs = [(mesh.number[v], hops) for v, hops in vertex.stencil]
        np.testing.assert_array_equal(result, pairs + [(-1, 0)] * (SIZE - len(pairs)))
    assert contexts_of(mesh.coding_order) == passes_of(wanted)
    return wanted


def contexts_of(order):
    """Context neighbors of the columns of each pass."""
    rows = [row.tolist() for row in np.split(order.near, order.near_starts[1:-1])]
    pairs = list(zip(order.columns.tolist(), rows, strict=True))
    return [dict(pairs[start:stop]) for start, stop in pairwise(order.pass_starts.tolist())]


@pytest.mark.slow
@pytest.mark.every_case
@pytest.mark.parametrize("name", MESHES)
def test_hierarchy_equals_that_of_the_plain_reader(name):
    assert_follows_the_format(*MESHES[name])


@pytest.mark.slow
def test_sample_meshes_have_full_and_short_stencils():
    """The tests above are not vacuous."""
    resolutions = assert_follows_the_format(*MESHES["components"])
    assert {1, SIZE} < {
        len(vertex.stencil) for resolution in resolutions[1:] for vertex in resolution
    }
    assert len(resolutions) > 3


@st.composite
def tangled_meshes(draw):
    """Random faces among few vertices: hubs, components, degenerate and repeated faces."""
    n_verts = draw(st.integers(1, 120))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    n_faces, spread = draw(st.integers(1, 200)), draw(st.integers(1, 120))
    faces = rng.integers(0, n_verts, (n_faces, 1)) + rng.integers(0, spread, (n_faces, 3))
    if draw(st.booleans()):
        faces[:, 0] = 0
    return faces % n_verts, n_verts


@pytest.mark.slow
@given(tangled_meshes())
@settings(max_examples=draws(60))
def test_hierarchy_of_random_meshes_equals_that_of_the_plain_reader(mesh):
    assert_follows_the_format(*mesh)
