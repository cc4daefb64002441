"""Graphs of the resolutions of a mesh a second way, slow and from the words of docs/format.md."""

import numpy as np


def scattered(number):
    """The hash of a number by which vertices are ranked and signs are made."""
    mixed = number * 0x9E3779B97F4A7C15 % 2**64
    return (mixed ^ (mixed >> 31)) * 0xBF58476D1CE4E5B9 % 2**64


def edges_of(faces, n_verts):
    """The vertices next to each vertex, as sets."""
    near = {v: set() for v in range(n_verts)}
    for face in np.asarray(faces).tolist():
        for v in face:
            near[v] |= set(face) - {v}
    return near


def coarser_graph(near, kept):
    """The graph of what is kept: two are next to each other if an edge joins their cells."""
    cell = {v: v if v in kept else max(near[v] & kept) for v in near}
    coarser = {v: set() for v in kept}
    for v, around in near.items():
        coarser[cell[v]] |= {cell[other] for other in around} - {cell[v]}
    return coarser


def graphs_of(mesh):
    """Dense adjacency of shape (N, N) of each resolution of a field mesh, from the coarsest."""
    near, graphs, finer = edges_of(mesh.faces, mesh.n_verts), [], None
    for resolution in mesh.resolutions[::-1]:
        if finer is not None:
            near = coarser_graph(near, set(near) - set(finer.predicted.tolist()))
        finer = resolution
        members = sorted(near)
        graph = np.zeros((len(members), len(members)), bool)
        for place, v in enumerate(members):
            graph[place, np.searchsorted(members, sorted(near[v]))] = True
        graphs.append(graph)
    return graphs[::-1]
