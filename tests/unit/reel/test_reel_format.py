"""A second decoder of times and passes of `reel`, slow, from the words of `docs/format.md`."""

import numpy as np
import pytest

from meshreel.reel.agreed.fields import FieldBlock, Layout, synthesise_fields
from meshreel.reel.agreed.mesh import N_CONTEXT_NEIGHBOURS, FieldMesh
from meshreel.reel.agreed.timeline import COARSEST
from samples.meshes import irregular_sequence, waving_grid

N_FRAMES, N_MODES, STEP = 21, 10, 0.125


def sample_block(sequence, stencil_size=7):
    rng = np.random.default_rng(9)
    layout = Layout(np.float32(STEP), stencil_size, N_MODES)
    block = FieldBlock(
        layout,
        rng.integers(-20, 21, (N_FRAMES, 3 * N_MODES)),
        np.rint(rng.laplace(scale=2, size=(N_MODES, sequence.n_verts))).astype(np.int32),
    )
    return block, FieldMesh(sequence.faces, sequence.n_verts, stencil_size)


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


def test_times_are_alike_when_a_second_decoder_follows_the_format():
    block, mesh = sample_block(waving_grid(1, 9, 13))
    basis, *_ = synthesise_fields(block, mesh)
    np.testing.assert_allclose(basis, decode_times_slowly(block.basis), atol=1e-10)


@pytest.mark.parametrize("sequence", [waving_grid(1, 20, 13), irregular_sequence(1)])
def test_passes_are_those_of_the_format_when_found_a_second_way(sequence):
    _, mesh = sample_block(sequence)
    assert len(mesh.passes) == len(mesh.resolutions)
    for step, resolution in zip(mesh.passes, mesh.resolutions, strict=True):
        edges = resolution.adjacency.tocoo()
        next_to = set(
            zip(
                resolution.members[edges.row].tolist(),
                resolution.members[edges.col].tolist(),
                strict=True,
            )
        )
        wanted = []
        for level in resolution.levels:
            for vertex in level.tolist():
                same = [one for one in level.tolist() if one < vertex and (vertex, one) in next_to]
                stencil = [one for one in resolution.stencil[len(wanted)].tolist() if one >= 0]
                wanted.append((vertex, (same + stencil)[:N_CONTEXT_NEIGHBOURS]))
        near = np.split(step.indices, step.indptr[1:-1])
        found = zip(step.columns.tolist(), (one.tolist() for one in near), strict=True)
        assert list(found) == wanted
