"""A second decoder of times and passes of `reel`, slow, from the words of `docs/format.md`."""

import numpy as np
import pytest

from meshreel.reel.agreed.fields import FieldBlock, Layout
from meshreel.reel.agreed.mesh import N_CONTEXT_NEIGHBOURS, SMALL_RESOLUTION, FieldMesh
from samples.meshes import irregular_sequence, waving_grid

N_FRAMES, N_MODES, STEP = 21, 10, 0.125


def sample_block(sequence, stencil_size=7):
    rng = np.random.default_rng(9)
    layout = Layout(np.float32(STEP), stencil_size, N_MODES)
    block = FieldBlock(
        layout,
        rng.integers(-20, 21, (N_MODES, 3, N_FRAMES), np.int32),
        np.rint(rng.laplace(scale=2, size=(N_MODES, sequence.n_verts))).astype(np.int32),
    )
    return block, FieldMesh(sequence.faces, sequence.n_verts, stencil_size)


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
