"""A second decoder of the fields of `reel`, slow and written from the words of `docs/format.md`.

Levels and stencils are taken from the library; `test_hierarchy.py` finds them a second way, and
`test_smooth_weights.py` the smooth weights.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from meshreel.geometry.laplacian import RELATIVE_RIDGE
from meshreel.reel.agreed.fields import (
    NOISE_OF_FILTERS,
    NOISE_OF_WEIGHTS,
    TAP_STEP,
    FieldBlock,
    Layout,
    key_fields,
    synthesise_fields,
)
from meshreel.reel.agreed.mesh import N_CONTEXT_NEIGHBOURS, SMALL_RESOLUTION, FieldMesh
from meshreel.reel.agreed.timeline import COARSEST
from meshreel.reel.agreed.weights import KNOWN_RIDGE
from samples.meshes import irregular_sequence, waving_grid

N_FRAMES, N_MODES, STEP = 21, 10, 0.125


def sample_block(sequence, group_ends=(1, 3, N_MODES), stencil_size=7):
    rng = np.random.default_rng(9)
    layout = Layout(np.float32(STEP), group_ends, stencil_size)
    block = FieldBlock(
        layout,
        rng.integers(-20, 21, (N_FRAMES, 3 * N_MODES)),
        np.rint(rng.laplace(scale=2, size=(N_MODES, sequence.n_verts))).astype(np.int64),
        rng.integers(-8, 9, (N_MODES, 2)),
    )
    return block, FieldMesh(sequence.faces, sequence.n_verts, stencil_size)


def constrained(offsets, ridges, suggested):
    """Weights of sum 1 by their normal equations, with a multiplier for the sum."""
    size = len(offsets)
    system = np.ones((size + 1, size + 1))
    system[:size, :size] = offsets @ offsets.T + np.diag(ridges)
    system[size, size] = 0
    return np.linalg.solve(system, [*(ridges * suggested), 1.0])[:size]


def values_of_a_group(known, integers, mesh):
    """Before the filters: of shape (V, k)."""
    values = np.zeros((len(known), len(integers)))
    first = 0
    for resolution in mesh.resolutions:
        smooth_weights = mesh.stencils.weights[first : first + len(resolution.predicted)]
        first += len(resolution.predicted)
        for row, vertex in enumerate(resolution.predicted):
            size = int((resolution.stencil[row] >= 0).sum())
            near = resolution.stencil[row, :size]
            weights = smooth_weights[row, :size]
            if known.shape[1] and size:
                offsets = known[near] - known[vertex]
                penalty = (resolution.hops[row, :size] / resolution.hops[row, 0]) ** 2
                ridge = (
                    KNOWN_RIDGE * (offsets**2).sum() / size
                    + NOISE_OF_WEIGHTS * STEP**2 * known.shape[1]
                )
                weights = constrained(offsets, ridge * penalty, weights)
            values[vertex] = weights @ values[near] + STEP * integers[:, vertex]
    return values


def laplacian_of(fields, mesh):
    """That of the filters, of shape (V, V), for fields of shape (V, k)."""
    laplacian = np.zeros((len(fields), len(fields)))
    for vertex in range(len(fields)):
        near = mesh.adjacency[[vertex]].indices
        if len(near):
            offsets = fields[near] - fields[vertex]
            ridge = RELATIVE_RIDGE * (offsets**2).sum() / len(near)
            ridge += NOISE_OF_FILTERS * STEP**2 * fields.shape[1]
            laplacian[vertex, near] = -constrained(
                offsets, np.full(len(near), ridge), np.zeros(len(near))
            )
            laplacian[vertex, vertex] = 1
    return laplacian


def decode_fields_slowly(block, mesh, key_steps=None):
    """The fields of the block referred to are given in its steps, of shape (V, k)."""
    known = np.zeros((mesh.n_verts, 0))
    key = known if key_steps is None else STEP * key_steps
    for start, end in pairwise([0, *block.layout.group_ends]):
        telling = np.hstack([key, known])
        values = values_of_a_group(telling, block.fields[start:end], mesh)
        if start < 6:
            laplacian = laplacian_of(np.hstack([known, values])[:, :6], mesh)
        once = laplacian @ values
        taps = TAP_STEP * block.taps[start:end]
        filtered = values + taps[:, 0] * once + taps[:, 1] * (laplacian @ once)
        known = np.hstack([known, filtered if block.taps.any() else values])
    return known.T


def decode_times_slowly(integers):
    """Time vectors of shape (3, T, K): polynomials through known times, by their coefficients."""
    values = np.zeros(integers.shape)
    values[::COARSEST] = integers[::COARSEST]
    distance = COARSEST // 2
    while distance:
        for time in range(distance, N_FRAMES, 2 * distance):
            around = [time + far * distance for far in (-3, -1, 1, 3)]
            if around[2] >= N_FRAMES:
                around = around[1:2]
            around = [one for one in around if 0 <= one < N_FRAMES]
            centred = np.array(around) - time
            powers = np.vander(centred, increasing=True)
            values[time] = np.linalg.solve(powers, values[around])[0] + integers[time]
        distance //= 2
    vectors = values.reshape(N_FRAMES, N_MODES, 3)
    return np.moveaxis(vectors / np.sqrt((vectors**2).sum(axis=(0, 2)))[:, None], 2, 0)


@pytest.mark.parametrize("group_ends", [(1, 3, 5, 8, 9, 10), (6, 7, 10), (7, 10), (10,)])
@pytest.mark.parametrize("sequence", [waving_grid(1, 9, 13), irregular_sequence(1)])
def test_fields_are_alike_when_a_second_decoder_follows_the_format(sequence, group_ends):
    """Groups that end, begin and go on at the sixth mode, behind which filters learn no more."""
    block, mesh = sample_block(sequence, group_ends)
    _, fields = synthesise_fields(block, mesh)
    np.testing.assert_allclose(fields[0], decode_fields_slowly(block, mesh), atol=1e-7)


@pytest.mark.parametrize("group_ends", [(1, 4, N_MODES), (N_MODES,)])
@pytest.mark.parametrize("sequence", [waving_grid(1, 9, 13), irregular_sequence(1)])
def test_fields_are_alike_when_a_block_refers_to_one_of_another_step(sequence, group_ends):
    first, mesh = sample_block(sequence)
    block, _ = sample_block(sequence, group_ends)
    key_layout = replace(first.layout, step=np.float32(4 * STEP))
    _, first_fields = synthesise_fields(replace(first, layout=key_layout), mesh)
    key = key_fields(key_layout, mesh, first_fields)
    _, fields = synthesise_fields(block, mesh, key)
    expected = decode_fields_slowly(block, mesh, first_fields[0].T / (4 * STEP))
    np.testing.assert_allclose(fields[0], expected, atol=1e-7)
    _, alone = synthesise_fields(block, mesh)
    assert np.abs(fields - alone).max() > STEP


def test_fields_are_alike_when_no_tap_of_the_block_is_set():
    block, mesh = sample_block(irregular_sequence(1))
    unfiltered = replace(block, taps=np.zeros_like(block.taps))
    _, fields = synthesise_fields(unfiltered, mesh)
    np.testing.assert_allclose(fields[0], decode_fields_slowly(unfiltered, mesh), atol=1e-7)


def test_times_are_alike_when_a_second_decoder_follows_the_format():
    block, mesh = sample_block(waving_grid(1, 9, 13))
    basis, _ = synthesise_fields(block, mesh)
    np.testing.assert_allclose(basis, decode_times_slowly(block.basis), atol=1e-10)


@pytest.mark.parametrize("sequence", [waving_grid(1, 20, 13), irregular_sequence(1)])
def test_passes_are_those_of_the_format_when_found_a_second_way(sequence):
    _, mesh = sample_block(sequence)
    *coarse, finest = mesh.resolutions
    small = [
        resolution
        for resolution in coarse
        if len(resolution.members) < sequence.n_verts / SMALL_RESOLUTION
    ]
    wanted = [{int(vertex): set() for resolution in small for vertex in resolution.predicted}]
    known = set(wanted[0])
    for resolution in coarse[len(small) :]:
        near = zip(resolution.predicted.tolist(), resolution.stencil.tolist(), strict=True)
        wanted.append({vertex: first_of(one, known) for vertex, one in near})
        known |= set(wanted[-1])
    row = 0
    for level in finest.levels:
        near = zip(level.tolist(), finest.stencil[row : row + len(level)].tolist(), strict=True)
        wanted.append({vertex: first_of(one, known) for vertex, one in near})
        known |= set(wanted[-1])
        row += len(level)
    found = [
        {
            int(column): set(step.indices[start:end].tolist())
            for column, start, end in zip(
                step.columns, step.indptr[:-1], step.indptr[1:], strict=True
            )
        }
        for step in mesh.passes
    ]
    assert [list(one) for one in found if one] == [sorted(one) for one in wanted if one]
    assert [one for one in found if one] == [one for one in wanted if one]


def first_of(stencil, known):
    return set([one for one in stencil if one in known][:N_CONTEXT_NEIGHBOURS])
