"""Resolutions and levels of vertices, checked against distances that SciPy finds."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components, shortest_path

from meshreel.geometry.connectivity import adjacency_matrix, component_labels
from meshreel.reel.agreed.hierarchy import (
    LARGEST_PASSAGE,
    MAX_RESOLUTIONS,
    N_COLOURS,
    REACH,
    build_hierarchy,
    nearest_earlier,
    scattered,
)
from samples.meshes import grid_faces, octahedron_faces

SIZE = 7


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


MESHES = {
    "components": several_components(),
    "fan": fan(),
    "book": book(),
    "grid": (grid_faces(20, 9), 180),
    "isolated": (np.zeros((1, 3), np.int64), 5),
}
SCALES = {
    name: build_hierarchy(adjacency_matrix(faces, n_verts), SIZE)
    for name, (faces, n_verts) in MESHES.items()
}
every_mesh = pytest.mark.parametrize("name", MESHES)


def place_of(resolution, vertices):
    places = np.searchsorted(resolution.members, vertices)
    np.testing.assert_array_equal(resolution.members[places], vertices)
    return places


def coarser_and_finer(name):
    return list(pairwise(SCALES[name]))


@every_mesh
def test_levels_hold_every_vertex_once_when_all_scales_are_taken_together(name):
    levels = [level for resolution in SCALES[name] for level in resolution.levels]
    assert sorted(np.concatenate(levels)) == list(range(MESHES[name][1]))
    assert all(np.all(np.diff(level) > 0) for level in levels)


@every_mesh
def test_members_are_those_of_the_coarser_scale_and_the_targets_when_a_scale_follows(name):
    for coarser, resolution in coarser_and_finer(name):
        together = np.concatenate([coarser.members, resolution.predicted])
        assert sorted(together) == resolution.members.tolist()
        assert len(resolution.predicted) > 0


@every_mesh
def test_finest_scale_is_the_mesh_when_the_coarsest_comes_first(name):
    finest = SCALES[name][-1]
    assert finest.members.tolist() == list(range(MESHES[name][1]))
    assert abs(finest.adjacency - adjacency_matrix(*MESHES[name])).nnz == 0


@every_mesh
def test_members_of_the_coarser_scale_are_independent_and_no_more_fit(name):
    for coarser, resolution in coarser_and_finer(name):
        kept, added = (
            place_of(resolution, coarser.members),
            place_of(resolution, resolution.predicted),
        )
        assert resolution.adjacency[kept][:, kept].nnz == 0
        assert (resolution.adjacency[added][:, kept].sum(axis=1) > 0).all()


@every_mesh
def test_coarser_neighbours_are_at_most_three_edges_apart_when_cells_touch(name):
    """Cells have a radius of one edge; all who are two edges apart need not touch."""
    for coarser, resolution in coarser_and_finer(name):
        kept = place_of(resolution, coarser.members)
        dense = resolution.adjacency.toarray()  # older SciPy takes no sparse one with wide indices
        distance = shortest_path(dense, unweighted=True)[np.ix_(kept, kept)]
        near = coarser.adjacency.toarray() > 0
        assert set(distance[near]) <= {2, 3}
        np.testing.assert_array_equal(near, near.T)
        assert not near.diagonal().any()


@every_mesh
def test_components_stay_what_they_were_when_scales_grow_coarser(name):
    _, labels = component_labels(*MESHES[name])
    for resolution in SCALES[name]:
        n_here, here = connected_components(resolution.adjacency, directed=False)
        pairs = set(zip(here.tolist(), labels[resolution.members].tolist(), strict=True))
        assert len(pairs) == n_here == labels.max() + 1


@pytest.mark.parametrize("name", ["components", "fan", "grid", "isolated"])
def test_coarsest_scale_has_one_vertex_of_each_component_when_no_edge_is_left(name):
    _, labels = component_labels(*MESHES[name])
    coarsest = SCALES[name][0]
    assert sorted(labels[coarsest.predicted]) == list(range(labels.max() + 1))
    assert coarsest.stencil.shape == (len(coarsest.predicted), 0)
    assert len(coarsest.levels) == 1


def test_scales_have_an_end_when_they_hardly_grow_coarser():
    """A hub that is never kept: each resolution loses a vertex or two."""
    faces, n_verts = book(400)
    resolutions = build_hierarchy(adjacency_matrix(faces, n_verts), SIZE)
    assert len(resolutions) <= MAX_RESOLUTIONS + 1
    assert sorted(np.concatenate([resolution.predicted for resolution in resolutions])) == list(
        range(n_verts)
    )


@every_mesh
def test_no_two_neighbours_share_a_level_when_it_is_not_the_last_colour(name):
    for resolution in SCALES[name]:
        assert 1 <= len(resolution.levels) <= N_COLOURS
        for level in resolution.levels[: N_COLOURS - 1]:
            places = place_of(resolution, level)
            assert resolution.adjacency[places][:, places].nnz == 0


@every_mesh
def test_each_level_takes_as_many_as_fit_when_others_come_later(name):
    for resolution in SCALES[name]:
        for number, level in enumerate(resolution.levels[:-1]):
            later = place_of(resolution, np.concatenate(resolution.levels[number + 1 :]))
            assert (
                resolution.adjacency[later][:, place_of(resolution, level)].sum(axis=1) > 0
            ).all()


def passable_distance(adjacency):
    """Edges from each vertex to each on paths that pass through no hub."""
    dense = adjacency.toarray().astype(float)
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
    for coarser, resolution in coarser_and_finer(name):
        distance = passable_distance(resolution.adjacency)
        known, row = coarser.members, 0
        for level in resolution.levels:
            for vertex in level:
                far = distance[
                    place_of(resolution, [vertex])[0], place_of(resolution, np.sort(known))
                ]
                order = np.argsort(far, kind="stable")[: (far <= REACH).sum()][:SIZE]
                filling = SIZE - len(order)
                wanted = [*np.sort(known)[order], *[-1] * filling]
                assert resolution.stencil[row].tolist() == wanted
                assert resolution.hops[row].tolist() == [*far[order], *[0] * filling]
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
    turned = np.roll(faces[::-1], 1, axis=1)
    again = build_hierarchy(adjacency_matrix(turned, n_verts), SIZE)
    for one, other in zip(SCALES["components"], again, strict=True):
        for name in ("members", "predicted", "stencil", "hops"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_stencils_begin_alike_when_they_may_be_longer():
    adjacency = adjacency_matrix(*MESHES["components"])
    for short, long in zip(SCALES["components"], build_hierarchy(adjacency, SIZE + 4), strict=True):
        np.testing.assert_array_equal(long.stencil[:, :SIZE], short.stencil)


@pytest.mark.parametrize("key_bits", [1, 12, 19])
def test_nearest_are_the_same_when_predicted_are_looked_at_in_pieces(key_bits, monkeypatch):
    graph = adjacency_matrix(*MESHES["components"])
    rng = np.random.default_rng(2)
    level_of, predicted = rng.integers(0, 4, 233), rng.permutation(233)[:90]
    whole = nearest_earlier(graph, level_of, predicted, 4)
    monkeypatch.setattr("meshreel.reel.agreed.hierarchy.KEY_BITS", key_bits)
    for one, other in zip(nearest_earlier(graph, level_of, predicted, 4), whole, strict=True):
        np.testing.assert_array_equal(one, other)


def test_nothing_is_near_when_no_level_is_lower():
    graph = adjacency_matrix(*MESHES["grid"])
    stencil, hops = nearest_earlier(graph, np.zeros(180, np.int64), np.array([3, 8]), 2)
    assert (stencil.tolist(), hops.tolist()) == ([[-1, -1]] * 2, [[0, 0]] * 2)


def test_hash_is_that_of_the_format_when_computed_with_python_integers():
    numbers = [0, 1, 2, 1000, 2**40, 2**62 + 3]
    wanted = []
    for number in numbers:
        mixed = number * 0x9E3779B97F4A7C15 % 2**64
        wanted.append((mixed ^ (mixed >> 31)) * 0xBF58476D1CE4E5B9 % 2**64)
    assert scattered(np.array(numbers)).tolist() == wanted


def test_the_vertex_of_the_highest_hash_is_kept_to_the_end_when_the_mesh_is_connected():
    """No vertex outranks it in any resolution."""
    (last,) = SCALES["grid"][0].members
    assert last == np.argmax(scattered(np.arange(180)))


def taken_in_turn(near, among):
    """Vertices by falling hash, but none next to one that is taken."""
    hashes = scattered(np.arange(max(near) + 1)).tolist()
    taken = set()
    for vertex in sorted(among, key=lambda vertex: -hashes[vertex]):
        if not near[vertex] & taken:
            taken.add(vertex)
    return taken


def levels_from_the_format(near):
    """A second way to the levels, slow and written from the words of `docs/format.md`."""
    resolutions = []
    while any(near.values()) and len(resolutions) < MAX_RESOLUTIONS:
        kept = taken_in_turn(near, near)
        left, levels = set(near) - kept, []
        for colour in range(N_COLOURS):
            levels.append(left if colour == N_COLOURS - 1 else taken_in_turn(near, left))
            left = left - levels[-1]
        resolutions.append([sorted(level) for level in levels if level])
        cell = {v: v if v in kept else max(near[v] & kept) for v in near}
        coarser = {v: set() for v in kept}
        for v, around in near.items():
            coarser[cell[v]] |= {cell[other] for other in around} - {cell[v]}
        near = coarser
    return [[sorted(near)], *resolutions[::-1]]


@every_mesh
def test_levels_are_those_of_the_format_when_found_a_second_way(name):
    adjacency = adjacency_matrix(*MESHES[name])
    near = {v: set(adjacency[[v]].indices.tolist()) for v in range(MESHES[name][1])}
    found = [[level.tolist() for level in resolution.levels] for resolution in SCALES[name]]
    assert found == levels_from_the_format(near)
