"""A second decoder of times and passes of `reel`, slow, from the words of `docs/format.md`."""

import numpy as np
import pytest

from meshreel.reel.agreed.fields import FieldBlock, Layout
from meshreel.reel.agreed.mesh import FieldMesh
from samples.meshes import irregular_sequence, waving_grid
from samples.resolutions import graphs_of

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
    graphs = graphs_of(mesh)
    number = mesh.number
    wanted = []
    for resolution, graph in zip(mesh.resolutions, graphs, strict=True):
        place = {int(vertex): place for place, vertex in enumerate(resolution.members)}
        row = 0
        for level in resolution.levels:
            for vertex in level.tolist():
                lower = [one for one in level.tolist() if one < vertex]
                same = [one for one in lower if graph[place[vertex], place[one]]]
                stencil = [one for one in resolution.stencil[row].tolist() if one >= 0]
                wanted.append(number[(same + stencil)[:8]].tolist())
                row += 1
    order = mesh.coding_order
    found = [one.tolist() for one in np.split(order.near, order.near_starts[1:-1])]
    assert order.columns.tolist() == list(range(mesh.n_verts))
    assert np.diff(order.pass_starts).tolist() == [len(one.predicted) for one in mesh.resolutions]
    assert found == wanted
