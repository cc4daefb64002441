"""Smooth weights, checked against a second way from the words of docs/format.md."""

import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial.chebyshev import chebval
from scipy.special import ive

from meshreel.reel.agreed.mesh import FieldMesh
from samples.meshes import grid_faces, octahedron_faces
from samples.resolutions import graphs_of, scattered

N_FIELDS, TIME, DEGREE = 16, 12.0, 18
RELATIVE_RIDGE, ABSOLUTE_RIDGE = 0.01, 1e-6

SMALL = np.concatenate([grid_faces(4, 5), octahedron_faces() + 20, [[26, 27, 28], [30, 31, 30]]])
MESHES = {"grid": (grid_faces(9, 7), 63), "small": (SMALL, 33)}


def field_mesh(name, size):
    faces, n_verts = MESHES[name]
    return FieldMesh(np.asarray(faces, np.int32), n_verts, size)


def smooth_fields(graph):
    """The series of `docs/format.md`, with dense matrices; and what it is a series of."""
    mean = graph / np.maximum(graph.sum(axis=1, keepdims=True), 1)
    hashes = np.array([scattered(number) for number in range(len(graph) * N_FIELDS)], object)
    signs = np.where(hashes >= 2**63, 1.0, -1.0).reshape(len(graph), -1)
    coefficients = [ive(k, TIME) * (2 if k else 1) for k in range(DEGREE + 1)]
    values, vectors = np.linalg.eig(mean)
    back = np.linalg.solve(vectors, signs)
    return [
        (vectors @ (factors[:, None] * back)).real
        for factors in (chebval(values.real, coefficients), np.exp(-TIME * (1 - values.real)))
    ]


def weights_of(resolution, fields):
    """Each row by itself, by its normal equations with a multiplier for the sum."""
    result = np.zeros(resolution.stencil.shape)
    for row, stencil in enumerate(resolution.stencil):
        members = np.searchsorted(resolution.members, stencil[stencil >= 0])
        own = np.searchsorted(resolution.members, resolution.predicted[row])
        size, offsets = len(members), fields[members] - fields[own]
        ridge = RELATIVE_RIDGE * (offsets**2).sum() / size + ABSOLUTE_RIDGE
        system = np.ones((size + 1, size + 1))
        system[:size, :size] = offsets @ offsets.T
        system[:size, :size] += np.diag(ridge * resolution.hops[row, :size] ** 2.0)
        system[size, size] = 0
        result[row, :size] = np.linalg.solve(system, np.eye(size + 1)[size])[:size]
    return result


def weights_by_resolution(mesh):
    ends = np.cumsum([len(resolution.predicted) for resolution in mesh.resolutions])
    return [mesh.hierarchy.weights[start:end] for start, end in pairwise([0, *ends])]


@pytest.mark.parametrize("size", [1, 2, 5, 10, 16])
@pytest.mark.parametrize("name", MESHES)
def test_smooth_weights_are_those_of_the_format_when_found_a_second_way(name, size):
    mesh = field_mesh(name, size)
    weights_of_all, graphs = weights_by_resolution(mesh), graphs_of(mesh)
    assert not weights_of_all[0].any()
    finer = list(zip(mesh.resolutions, weights_of_all, graphs, strict=True))[1:]
    for resolution, weights, graph in finer:
        fields, diffused = smooth_fields(graph)
        np.testing.assert_allclose(fields, diffused, atol=1e-2)
        np.testing.assert_allclose(weights, weights_of(resolution, fields), atol=1e-9)


def test_smooth_weights_hardly_change_when_smooth_fields_do():
    """Also of components of a few vertices, where smooth fields are constant but for rounding."""
    mesh, rng = field_mesh("small", 10), np.random.default_rng(1)
    for resolution, graph in list(zip(mesh.resolutions, graphs_of(mesh), strict=True))[1:]:
        fields, _ = smooth_fields(graph)
        moved = fields + 1e-12 * rng.normal(size=fields.shape)
        assert np.abs(weights_of(resolution, moved) - weights_of(resolution, fields)).max() < 1e-8


@pytest.mark.parametrize("size", [1, 7, 16])
@pytest.mark.parametrize("name", MESHES)
def test_smooth_weights_sum_to_one_when_a_stencil_names_any_vertex(name, size):
    found = field_mesh(name, size).hierarchy
    is_there = found.stencil >= 0
    sums = found.weights.sum(axis=1)
    np.testing.assert_allclose(sums, is_there.any(axis=1), rtol=0, atol=1e-14)
    assert not found.weights[~is_there].any()


ROWS, COLUMNS = 24, 30
Y, X = (axis.ravel() / 10.0 for axis in np.mgrid[0:ROWS, 0:COLUMNS])
BENDS = np.stack([np.sin(2 * X + Y), np.cos(X - 2 * Y), X * Y, np.sin(X) * Y**2], axis=1)
"""Four smooth fields that no weights of a few vertices reproduce together."""


def errors(resolution, weights):
    predicted = np.einsum("ns,nsk->nk", weights, BENDS[resolution.stencil])
    return np.abs(predicted - BENDS[resolution.predicted])


def grid_resolutions():
    mesh = FieldMesh(grid_faces(ROWS, COLUMNS).astype(np.int32), ROWS * COLUMNS, 10)
    return list(zip(mesh.resolutions, weights_by_resolution(mesh), strict=True))


def test_smooth_weights_predict_far_better_when_compared_with_those_by_distance():
    """Of a sheet, in the finest resolution: its bends count, not only what is near."""
    resolution, weights = grid_resolutions()[-1]
    inside = (resolution.stencil >= 0).all(axis=1)
    by_distance = 1.0 / np.maximum(resolution.hops, 1) ** 2
    by_distance /= by_distance.sum(axis=1, keepdims=True)
    smooth = errors(resolution, weights)[inside].mean()
    assert smooth < 0.5 * errors(resolution, by_distance)[inside].mean()


def test_smooth_weights_predict_better_than_the_nearest_when_resolutions_are_coarse():
    for resolution, weights in grid_resolutions()[-3:-1]:
        assert len(resolution.predicted) > 20
        nearest = np.eye(1, 10)[[0] * len(resolution.predicted)]
        assert errors(resolution, weights).mean() < 0.8 * errors(resolution, nearest).mean()


def format_constants():
    text = (Path(__file__).parents[4] / "docs" / "format.md").read_text(encoding="utf-8")
    return [float.fromhex(word) for word in re.findall(r"0x1\.[0-9a-f]{13}p-\d+", text)]


def exact_fields(graph):
    """Step 2 of `docs/format.md`, in its order of operations: lists of shape (N, 16)."""
    near = [np.flatnonzero(row).tolist() for row in graph]
    signs = [
        [1.0 if scattered(N_FIELDS * i + f) >> 63 else -1.0 for f in range(N_FIELDS)]
        for i in range(len(near))
    ]
    later = before = [[0.0] * N_FIELDS for _ in near]  # b_{k+1} and b_{k+2}
    for k in range(DEGREE, -1, -1):
        now = []
        for i, around in enumerate(near):
            share = (2.0 if k else 1.0) / len(around) if around else 0.0
            now.append([
                (in_turn(0.0, [later[j][f] for j in around]) * share - before[i][f])
                + CONSTANTS[k] * signs[i][f]
                for f in range(N_FIELDS)
            ])  # fmt: skip
        later, before = now, later
    return later


def exact_weights(offsets, hops):
    """Steps 3 to 5 of `docs/format.md` for the stencil of one vertex."""
    n = range(len(offsets))
    a = [[in_turn(0.0, np.multiply(u, v).tolist()) for v in offsets] for u in offsets]
    ridge = 0.01 * (in_turn(0.0, [a[j][j] for j in n]) / len(n)) + 1e-6
    for j in n:
        a[j][j] += ridge * hops[j] ** 2
    x, q, w = [1.0 for _ in n], [], [0.0 for _ in n]
    for i in n:
        g = [a[k][i] * q[k] for k in range(i)]
        x[i] = in_turn(x[i], [-g[k] * x[k] for k in range(i)])
        for j in n[i:]:
            a[i][j] = in_turn(a[i][j], [-g[k] * a[k][j] for k in range(i)])
        q.append(1.0 / a[i][i])
    for i in reversed(n):
        w[i] = q[i] * (x[i] - in_turn(0.0, [a[i][j] * w[j] for j in n[i + 1 :]]))
    total = in_turn(0.0, w)
    return [one / total for one in w]


def in_turn(start, terms):
    """A sum in the order of its terms; what `sum` does from Python 3.12 on is more exact."""
    for term in terms:
        start += term
    return start


CONSTANTS = format_constants()


@pytest.mark.parametrize("size", [3, 10, 16])
@pytest.mark.parametrize("name", MESHES)
def test_smooth_weights_have_the_bits_of_the_format_when_found_in_its_order(name, size):
    mesh = field_mesh(name, size)
    found = zip(mesh.resolutions, weights_by_resolution(mesh), graphs_of(mesh), strict=True)
    for resolution, weights, graph in list(found)[1:]:
        fields = np.array(exact_fields(graph))
        for row, vertex in enumerate(resolution.predicted):
            stencil = resolution.stencil[row][resolution.stencil[row] >= 0]
            near = fields[np.searchsorted(resolution.members, stencil)]
            own = fields[np.searchsorted(resolution.members, vertex)]
            wanted = exact_weights(near - own, resolution.hops[row].tolist())
            assert weights[row, : len(wanted)].tolist() == wanted
