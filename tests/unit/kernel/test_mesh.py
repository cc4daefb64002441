import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import ive

from conformance.hierarchy import edges_of, scattered
from meshreel.errors import InvalidInputError
from meshreel.kernel.mesh import MAX_LEVELS, MAX_RESOLUTIONS, hierarchy, neighbors
from samples.meshes import grid_faces


@given(st.lists(st.tuples(*[st.integers(0, 19)] * 3), max_size=60))
def test_neighbors_ignore_degenerate_faces(faces):
    faces = np.array(faces, np.int32).reshape(-1, 3)
    graph = neighbors(faces, 20)
    rows = np.split(graph.near, graph.starts[1:-1])
    expected = edges_of(faces.tolist(), 20)
    assert [row.tolist() for row in rows] == [sorted(expected[v]) for v in range(20)]


@pytest.mark.parametrize("vertex", [-1, 4, 2**31 - 1])
def test_face_is_rejected_when_a_vertex_does_not_exist(vertex):
    with pytest.raises(InvalidInputError, match="number 1 exceeds"):
        neighbors(np.array([[0, 1, 2], [1, vertex, 3]]), 4)


@pytest.mark.parametrize("size", [-1, 0, 17])
def test_stencil_of_invalid_size_is_rejected(size):
    with pytest.raises(InvalidInputError):
        hierarchy(neighbors(grid_faces(3, 3), 9), size)


def test_hierarchy_has_one_level_without_edges():
    levels = hierarchy(neighbors(np.zeros((0, 3), np.int32), 3), 4)
    assert (levels.order.tolist(), levels.level_starts.tolist()) == ([0, 1, 2], [0, 3])
    assert (levels.stencil == -1).all()


def smooth_fields_of_the_format(graph, time):
    """Return exp(-t (1 - w)) of random signs as a float32 Chebyshev series, of shape (V, 16)."""
    degrees = np.diff(graph.starts)
    n_verts, one = len(degrees), np.float32
    columns = graph.starts[:-1, None] + np.arange(degrees.max())
    is_near = np.arange(degrees.max()) < degrees[:, None]
    near = np.where(is_near, graph.near[np.where(is_near, columns, 0)], n_verts)
    signs = [[1 if scattered(16 * v + f) >> 63 else -1 for f in range(16)] for v in range(n_verts)]
    n_terms = {12: 19, 40: 27}[time]
    terms = [one((2 if k else 1) * ive(k, time)) for k in range(n_terms)]
    after, before = np.zeros((2, n_verts + 1, 16), np.float32)  # the last row stays 0
    for k in reversed(range(n_terms)):
        sums = np.zeros((n_verts, 16), np.float32)
        for column in near.T:
            sums += after[column]
        factors = one(2 if k else 1) / np.maximum(degrees, 1).astype(np.float32)
        now = (factors[:, None] * sums - before[:-1]) + terms[k] * np.array(signs, np.float32)
        after, before = np.concatenate([now, np.zeros((1, 16), np.float32)]), after
    return after[:-1]


@pytest.mark.slow
@pytest.mark.every_case
@pytest.mark.parametrize(("n_columns", "time"), [(64, 12), (65, 40)])
def test_smooth_fields_follow_the_format(n_columns, time):
    graph = neighbors(grid_faces(64, n_columns), 64 * n_columns)
    levels = hierarchy(graph, 3)
    finest = levels.smooth[levels.smooth_starts[-1] :]
    np.testing.assert_array_equal(finest, smooth_fields_of_the_format(graph, time)[levels.order])


def test_number_of_levels_is_within_the_limit_of_the_core():
    text = (Path(__file__).parents[3] / "core/reel.h").read_text("utf-8")
    assert f"#define REEL_MAX_RESOLUTIONS {MAX_RESOLUTIONS} " in text
    assert re.search(r"#define REEL_MAX_LEVELS \(1 \+ 3 \* REEL_MAX_RESOLUTIONS\)", text)
    assert MAX_LEVELS == 1 + 3 * MAX_RESOLUTIONS
