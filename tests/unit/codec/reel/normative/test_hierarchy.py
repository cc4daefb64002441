"""Resolutions and levels of vertices, checked against distances that SciPy finds."""

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
from meshreel.model.geometry.connectivity import component_labels
from samples.costs import draws
from samples.meshes import grid_faces, octahedron_faces
from samples.resolutions import core_resolutions

SIZE = 7
N_COLOURS, REACH, LARGEST_PASSAGE = 3, 3, 24


def several_components():
    """A grid, an octahedron, a triangle and three isolated vertices, in shuffled order."""
    faces = np.concatenate([grid_faces(13, 17), octahedron_faces() + 221, [[227, 228, 229]]])
    return np.random.default_rng(1).permutation(233)[faces], 233


def fan(n_rim=40):
    """One vertex is the neighbour of all."""
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
SCALES = {name: core_resolutions(mesh.hierarchy) for name, mesh in FIELD_MESHES.items()}
GRAPHS = {name: graphs_of(mesh) for name, mesh in FIELD_MESHES.items()}
every_mesh = pytest.mark.parametrize("name", MESHES)


def place_of(resolution, vertices):
    places = np.searchsorted(resolution.members, vertices)
    np.testing.assert_array_equal(resolution.members[places], vertices)
    return places


def coarser_and_finer(name):
    """Pairs of resolutions, with the graph of the finer one and that of the coarser."""
    scales = zip(pairwise(SCALES[name]), pairwise(GRAPHS[name]), strict=True)
    return [(*resolutions, *graphs[::-1]) for resolutions, graphs in scales]


@every_mesh
def test_levels_hold_every_vertex_once_when_all_scales_are_taken_together(name):
    levels = [level for resolution in SCALES[name] for level in resolution.levels]
    assert sorted(np.concatenate(levels)) == list(range(MESHES[name][1]))
    assert all(np.all(np.diff(level) > 0) for level in levels)


@every_mesh
def test_members_are_those_of_the_coarser_scale_and_the_targets_when_a_scale_follows(name):
    for coarser, resolution in pairwise(SCALES[name]):
        together = np.concatenate([coarser.members, resolution.predicted])
        assert sorted(together) == resolution.members.tolist()
        assert len(resolution.predicted) > 0


@every_mesh
def test_finest_scale_is_the_mesh_when_the_coarsest_comes_first(name):
    finest = SCALES[name][-1]
    assert finest.members.tolist() == list(range(MESHES[name][1]))
    neighbors = FIELD_MESHES[name].neighbors
    found = np.zeros(GRAPHS[name][-1].shape, bool)
    found[np.repeat(finest.members, np.diff(neighbors.starts)), neighbors.near] = True
    np.testing.assert_array_equal(found, GRAPHS[name][-1])


@every_mesh
def test_members_of_the_coarser_scale_are_independent_and_no_more_fit(name):
    for coarser, resolution, graph, _ in coarser_and_finer(name):
        kept, added = (
            place_of(resolution, coarser.members),
            place_of(resolution, resolution.predicted),
        )
        assert not graph[np.ix_(kept, kept)].any()
        assert graph[np.ix_(added, kept)].any(axis=1).all()


@every_mesh
def test_coarser_neighbours_are_at_most_three_edges_apart_when_cells_touch(name):
    """Cells have a radius of one edge; all who are two edges apart need not touch."""
    for coarser, resolution, graph, near in coarser_and_finer(name):
        kept = place_of(resolution, coarser.members)
        distance = shortest_path(graph, unweighted=True)[np.ix_(kept, kept)]
        assert set(distance[near]) <= {2, 3}


@every_mesh
def test_components_stay_what_they_were_when_scales_grow_coarser(name):
    _, labels = component_labels(*MESHES[name])
    for resolution, graph in zip(SCALES[name], GRAPHS[name], strict=True):
        n_here, here = connected_components(graph, directed=False)
        pairs = set(zip(here.tolist(), labels[resolution.members].tolist(), strict=True))
        assert len(pairs) == n_here == labels.max() + 1


@pytest.mark.parametrize("name", ["components", "fan", "grid", "isolated"])
def test_coarsest_scale_has_one_vertex_of_each_component_when_no_edge_is_left(name):
    _, labels = component_labels(*MESHES[name])
    coarsest = SCALES[name][0]
    assert sorted(labels[coarsest.predicted]) == list(range(labels.max() + 1))
    assert (coarsest.stencil == -1).all()
    assert not coarsest.hops.any()
    assert len(coarsest.levels) == 1


def test_scales_have_an_end_when_they_hardly_grow_coarser():
    """A hub that is never kept: each resolution loses a vertex or two."""
    faces, n_verts = book(400)
    mesh = FieldMesh(faces.astype(np.int32), n_verts, SIZE)
    resolutions = core_resolutions(mesh.hierarchy)
    assert len(resolutions) <= MAX_RESOLUTIONS + 1
    assert sorted(np.concatenate([resolution.predicted for resolution in resolutions])) == list(
        range(n_verts)
    )


@every_mesh
def test_no_two_neighbours_share_a_level_when_it_is_not_the_last_colour(name):
    for resolution, graph in zip(SCALES[name], GRAPHS[name], strict=True):
        assert 1 <= len(resolution.levels) <= N_COLOURS
        for level in resolution.levels[: N_COLOURS - 1]:
            places = place_of(resolution, level)
            assert not graph[np.ix_(places, places)].any()


@every_mesh
def test_each_level_takes_as_many_as_fit_when_others_come_later(name):
    for resolution, graph in zip(SCALES[name], GRAPHS[name], strict=True):
        for number, level in enumerate(resolution.levels[:-1]):
            later = place_of(resolution, np.concatenate(resolution.levels[number + 1 :]))
            assert graph[np.ix_(later, place_of(resolution, level))].any(axis=1).all()


def passable_distance(graph):
    """Edges from each vertex to each on paths that pass through no hub."""
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
def test_stencils_are_the_nearest_of_earlier_levels_when_checked_by_distance(name):
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
def test_stencils_of_all_scales_only_name_vertices_that_are_known_when_levels_follow(name):
    known: set[int] = set()
    for resolution in SCALES[name]:
        row = 0
        for level in resolution.levels:
            used = set(resolution.stencil[row : row + len(level)].ravel().tolist()) - {-1}
            assert used <= known
            row += len(level)
            known |= set(level.tolist())


def test_every_target_has_a_neighbour_that_is_known_when_scales_are_not_the_coarsest():
    for resolutions in SCALES.values():
        for resolution in resolutions[1:]:
            assert (resolution.hops[:, 0] == 1).all()


def test_some_stencils_are_full_and_some_are_not_when_the_meshes_here_are_taken():
    """That the claims above are about something."""
    counts = {
        int(count)
        for resolutions in SCALES.values()
        for resolution in resolutions[1:]
        for count in (resolution.stencil >= 0).sum(axis=1)
    }
    assert {1, SIZE} < counts
    assert len(SCALES["components"]) > 3


def test_scales_are_the_same_when_faces_come_in_another_order():
    faces, n_verts = MESHES["components"]
    turned = np.roll(faces[::-1], 1, axis=1).astype(np.int32)
    again = core_resolutions(FieldMesh(turned, n_verts, SIZE).hierarchy)
    for one, other in zip(SCALES["components"], again, strict=True):
        for name in ("members", "predicted", "stencil", "hops"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_stencils_begin_alike_when_they_may_be_longer():
    faces, n_verts = MESHES["components"]
    mesh = FieldMesh(faces.astype(np.int32), n_verts, SIZE + 4)
    longer = core_resolutions(mesh.hierarchy)
    for short, long in zip(SCALES["components"], longer, strict=True):
        np.testing.assert_array_equal(long.stencil[:, :SIZE], short.stencil)


def test_the_vertex_of_the_highest_hash_is_kept_to_the_end_when_the_mesh_is_connected():
    """No vertex outranks it in any resolution."""
    (last,) = SCALES["grid"][0].members
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
def test_hierarchy_is_that_of_the_format_when_found_a_second_way(name):
    assert_follows_the_format(*MESHES[name])


@st.composite
def tangled_meshes(draw):
    """Faces among few vertices, at random: hubs, components, degenerate and repeated faces."""
    n_verts = draw(st.integers(1, 120))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    n_faces, spread = draw(st.integers(1, 200)), draw(st.integers(1, 120))
    faces = rng.integers(0, n_verts, (n_faces, 1)) + rng.integers(0, spread, (n_faces, 3))
    if draw(st.booleans()):
        faces[:, 0] = 0
    return faces % n_verts, n_verts


@given(tangled_meshes())
@settings(max_examples=draws(60))
def test_hierarchy_is_that_of_the_format_when_a_mesh_is_tangled(mesh):
    assert_follows_the_format(*mesh)
