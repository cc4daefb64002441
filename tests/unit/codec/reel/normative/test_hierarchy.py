"""Resolutions, levels and stencils of vertices, checked with SciPy and the plain reader."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse.csgraph import connected_components, shortest_path

from conformance.hierarchy import (
    coarser_graph,
    edges_of,
    passes_of,
    resolutions_of,
    scattered,
)
from meshreel.codec.reel.normative.mesh import FieldMesh
from meshreel.kernel.mesh import MAX_RESOLUTIONS
from meshreel.paper.laplacian import component_labels
from samples.costs import draws
from samples.meshes import grid_faces, octahedron_faces
from samples.resolutions import core_resolutions

SIZE = 7
N_COLORS, REACH, LARGEST_PASSAGE = 3, 3, 24


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


def graphs_of(mesh):
    """Dense adjacency of shape (N, N) of each resolution of a field mesh, from the coarsest."""
    near, graphs, finer = edges_of(mesh.faces.tolist(), mesh.n_verts), [], None
    for resolution in core_resolutions(mesh.hierarchy)[::-1]:
        if finer is not None:
            near = coarser_graph(near, set(near) - set(finer.predicted.tolist()))
        finer = resolution
        members = sorted(near)
        graph = np.zeros((len(members), len(members)), bool)
        for place, v in enumerate(members):
            graph[place, np.searchsorted(members, sorted(near[v]))] = True
        graphs.append(graph)
    return graphs[::-1]


MESHES = {
    "components": several_components(),
    "fan": fan(),
    "book": book(),
    "grid": (grid_faces(20, 9), 180),
    "isolated": (np.zeros((1, 3), np.int64), 5),
}
FIELD_MESHES = {
    name: FieldMesh(np.asarray(faces, np.int32), n_verts, SIZE)
    for name, (faces, n_verts) in MESHES.items()
}
RESOLUTIONS = {name: core_resolutions(mesh.hierarchy) for name, mesh in FIELD_MESHES.items()}
GRAPHS = {name: graphs_of(mesh) for name, mesh in FIELD_MESHES.items()}
every_mesh = pytest.mark.parametrize("name", MESHES)


def place_of(resolution, vertices):
    places = np.searchsorted(resolution.members, vertices)
    np.testing.assert_array_equal(resolution.members[places], vertices)
    return places


def coarser_and_finer(name):
    """Consecutive resolutions, with the graphs of the finer and the coarser one."""
    pairs = zip(pairwise(RESOLUTIONS[name]), pairwise(GRAPHS[name]), strict=True)
    return [(*resolutions, *graphs[::-1]) for resolutions, graphs in pairs]


@every_mesh
def test_levels_of_all_resolutions_contain_every_vertex_once(name):
    levels = [level for resolution in RESOLUTIONS[name] for level in resolution.levels]
    assert sorted(np.concatenate(levels)) == list(range(MESHES[name][1]))
    assert all(np.all(np.diff(level) > 0) for level in levels)


@every_mesh
def test_members_are_those_of_the_coarser_resolution_and_the_added_vertices(name):
    for coarser, resolution in pairwise(RESOLUTIONS[name]):
        together = np.concatenate([coarser.members, resolution.predicted])
        assert sorted(together) == resolution.members.tolist()
        assert len(resolution.predicted) > 0


@every_mesh
def test_finest_resolution_is_the_mesh(name):
    finest = RESOLUTIONS[name][-1]
    assert finest.members.tolist() == list(range(MESHES[name][1]))
    neighbors = FIELD_MESHES[name].neighbors
    found = np.zeros(GRAPHS[name][-1].shape, bool)
    found[np.repeat(finest.members, np.diff(neighbors.starts)), neighbors.near] = True
    np.testing.assert_array_equal(found, GRAPHS[name][-1])


@every_mesh
def test_coarser_members_are_a_maximal_independent_set(name):
    for coarser, resolution, graph, _ in coarser_and_finer(name):
        kept, added = (
            place_of(resolution, coarser.members),
            place_of(resolution, resolution.predicted),
        )
        assert not graph[np.ix_(kept, kept)].any()
        assert graph[np.ix_(added, kept)].any(axis=1).all()


@every_mesh
def test_coarser_neighbors_are_at_most_three_edges_apart(name):
    """Cells have a radius of one edge; vertices two edges apart need not have adjacent cells."""
    for coarser, resolution, graph, near in coarser_and_finer(name):
        kept = place_of(resolution, coarser.members)
        distance = shortest_path(graph, unweighted=True)[np.ix_(kept, kept)]
        assert set(distance[near]) <= {2, 3}


@every_mesh
def test_components_are_the_same_at_every_resolution(name):
    _, labels = component_labels(*MESHES[name])
    for resolution, graph in zip(RESOLUTIONS[name], GRAPHS[name], strict=True):
        n_here, here = connected_components(graph, directed=False)
        pairs = set(zip(here.tolist(), labels[resolution.members].tolist(), strict=True))
        assert len(pairs) == n_here == labels.max() + 1


@pytest.mark.parametrize("name", ["components", "fan", "grid", "isolated"])
def test_coarsest_resolution_has_one_vertex_per_component(name):
    _, labels = component_labels(*MESHES[name])
    coarsest = RESOLUTIONS[name][0]
    assert sorted(labels[coarsest.predicted]) == list(range(labels.max() + 1))
    assert (coarsest.stencil == -1).all()
    assert not coarsest.hops.any()
    assert len(coarsest.levels) == 1


def test_number_of_resolutions_is_limited():
    """A hub that is never kept: each resolution removes only a vertex or two."""
    faces, n_verts = book(400)
    mesh = FieldMesh(faces.astype(np.int32), n_verts, SIZE)
    resolutions = core_resolutions(mesh.hierarchy)
    assert len(resolutions) <= MAX_RESOLUTIONS + 1
    assert sorted(np.concatenate([resolution.predicted for resolution in resolutions])) == list(
        range(n_verts)
    )


@every_mesh
def test_neighbors_never_share_a_level_before_the_last(name):
    for resolution, graph in zip(RESOLUTIONS[name], GRAPHS[name], strict=True):
        assert 1 <= len(resolution.levels) <= N_COLORS
        for level in resolution.levels[: N_COLORS - 1]:
            places = place_of(resolution, level)
            assert not graph[np.ix_(places, places)].any()


@every_mesh
def test_each_level_is_a_maximal_independent_set(name):
    for resolution, graph in zip(RESOLUTIONS[name], GRAPHS[name], strict=True):
        for number, level in enumerate(resolution.levels[:-1]):
            later = place_of(resolution, np.concatenate(resolution.levels[number + 1 :]))
            assert graph[np.ix_(later, place_of(resolution, level))].any(axis=1).all()


def passable_distance(graph):
    """Distances of all pairs of vertices, on paths that avoid hubs."""
    dense = graph.astype(float)
    is_hub = dense.sum(axis=1) > LARGEST_PASSAGE
    onward = dense.copy()
    onward[is_hub] = 0
    distance = shortest_path(onward, unweighted=True)
    for hub in np.flatnonzero(is_hub):
        distance[hub] = 1 + distance[dense[hub] > 0].min(axis=0)
        distance[hub, hub] = 0
    return distance


@every_mesh
def test_stencils_are_the_nearest_vertices_of_earlier_levels(name):
    for coarser, resolution, graph, _ in coarser_and_finer(name):
        distance = passable_distance(graph)
        known, row = coarser.members, 0
        for level in resolution.levels:
            for vertex in level:
                far = distance[
                    place_of(resolution, [vertex])[0], place_of(resolution, np.sort(known))
                ]
                wanted = np.sort(far[far <= REACH])[:SIZE]
                found = resolution.stencil[row, : len(wanted)]
                assert far[np.searchsorted(np.sort(known), found)].tolist() == wanted.tolist()
                assert len(set(found.tolist())) == len(found)
                filling = [0] * (SIZE - len(wanted))
                assert resolution.hops[row].tolist() == [*wanted, *filling]
                row += 1
            known = np.concatenate([known, level])
        assert row == len(resolution.stencil)


@every_mesh
def test_stencils_contain_only_known_vertices(name):
    known: set[int] = set()
    for resolution in RESOLUTIONS[name]:
        row = 0
        for level in resolution.levels:
            used = set(resolution.stencil[row : row + len(level)].ravel().tolist()) - {-1}
            assert used <= known
            row += len(level)
            known |= set(level.tolist())


def test_every_added_vertex_has_a_known_neighbor():
    for resolutions in RESOLUTIONS.values():
        for resolution in resolutions[1:]:
            assert (resolution.hops[:, 0] == 1).all()


def test_sample_meshes_have_full_and_short_stencils():
    """The tests above are not vacuous."""
    counts = {
        int(count)
        for resolutions in RESOLUTIONS.values()
        for resolution in resolutions[1:]
        for count in (resolution.stencil >= 0).sum(axis=1)
    }
    assert {1, SIZE} < counts
    assert len(RESOLUTIONS["components"]) > 3


def test_resolutions_do_not_depend_on_the_order_of_faces():
    faces, n_verts = MESHES["components"]
    turned = np.roll(faces[::-1], 1, axis=1).astype(np.int32)
    again = core_resolutions(FieldMesh(turned, n_verts, SIZE).hierarchy)
    for one, other in zip(RESOLUTIONS["components"], again, strict=True):
        for name in ("members", "predicted", "stencil", "hops"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_longer_stencils_start_with_the_shorter_ones():
    faces, n_verts = MESHES["components"]
    mesh = FieldMesh(faces.astype(np.int32), n_verts, SIZE + 4)
    longer = core_resolutions(mesh.hierarchy)
    for short, long in zip(RESOLUTIONS["components"], longer, strict=True):
        np.testing.assert_array_equal(long.stencil[:, :SIZE], short.stencil)


def test_the_vertex_with_the_highest_hash_is_the_coarsest():
    """It has the highest priority at every resolution."""
    (last,) = RESOLUTIONS["grid"][0].members
    assert last == max(range(180), key=scattered)


def assert_follows_the_format(faces, n_verts):
    mesh = FieldMesh(np.asarray(faces, np.int32), n_verts, SIZE)
    wanted = resolutions_of(np.asarray(faces).tolist(), n_verts, SIZE)
    vertices = [vertex for one in wanted for vertex in one]
    assert mesh.order.tolist() == [vertex.number for vertex in vertices]
    stencils = np.stack([mesh.hierarchy.stencil, mesh.hierarchy.hops], axis=2)
    for found, vertex in zip(stencils, vertices, strict=True):
        pairs = [(mesh.number[v], hops) for v, hops in vertex.stencil]
        np.testing.assert_array_equal(found, pairs + [(-1, 0)] * (SIZE - len(pairs)))
    assert contexts_of(mesh.coding_order) == passes_of(wanted)


def contexts_of(order):
    """Context neighbors of the columns of each pass."""
    rows = [row.tolist() for row in np.split(order.near, order.near_starts[1:-1])]
    pairs = list(zip(order.columns.tolist(), rows, strict=True))
    return [dict(pairs[start:stop]) for start, stop in pairwise(order.pass_starts.tolist())]


@every_mesh
def test_hierarchy_equals_that_of_the_plain_reader(name):
    assert_follows_the_format(*MESHES[name])


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


@given(tangled_meshes())
@settings(max_examples=draws(60))
def test_hierarchy_of_random_meshes_equals_that_of_the_plain_reader(mesh):
    assert_follows_the_format(*mesh)
