"""Rows of corners that share values: numbered, written, read and refused."""

import numpy as np
import pytest

from meshreel.codec.corner_rows import (
    numbered_rows,
    read_corner_rows,
    write_corner_rows,
)
from meshreel.entropy.coder import encode_integers
from meshreel.entropy.varint import write_varint
from meshreel.errors import CorruptStreamError, MeshReelError

VERTICES = np.array([2, 0, 2, 0, 2, 3, 2])
GROUPS = np.array([0, 1, 2, 1, 0, 3, 2])
ROWS = [2, 0, 4, 0, 2, 3, 4]
"""Corners of vertices 0, 2 and 3 of four; those of vertex 2 are of two groups."""


def test_first_corners_have_the_rows_of_their_vertices_and_others_follow():
    rows = numbered_rows(GROUPS, VERTICES, 4)
    assert (rows.of_corners.tolist(), rows.n_rows) == (ROWS, 5)


@pytest.mark.parametrize("seed", range(20))
def test_rows_come_back_when_written(seed):
    rng = np.random.default_rng(seed)
    n_verts = int(rng.integers(1, 40))
    vertices = rng.integers(0, n_verts, rng.integers(1, 300))
    _, groups = np.unique(
        vertices * 9 + rng.integers(0, 1 + seed % 9, len(vertices)), return_inverse=True
    )
    rows = numbered_rows(groups, vertices, n_verts)
    found = read_corner_rows(write_corner_rows(rows, vertices, n_verts), vertices, n_verts)
    assert (found.of_corners.tolist(), found.n_rows) == (rows.of_corners.tolist(), rows.n_rows)
    pairs = np.unique(np.stack([groups, found.of_corners]), axis=1)
    assert pairs.shape[1] == groups.max() + 1 == len(set(found.of_corners.tolist()))


def coded(flags, codes, n_stored=None):
    n_stored = len(codes) if n_stored is None else n_stored
    return write_varint(n_stored) + encode_integers([np.array(flags), np.array(codes, int)])


def test_codes_name_the_corner_that_has_the_row_before():
    payload = coded([0, 0, 1, 0], [1, 2, 2])
    found = read_corner_rows(payload, VERTICES, 4)
    assert (found.of_corners.tolist(), found.n_rows) == (ROWS, 5)
    assert write_corner_rows(numbered_rows(GROUPS, VERTICES, 4), VERTICES, 4) == payload


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (coded([0, 0, 1, 0], [2, 1, 1]), "a corner that its vertex does not have"),
        (coded([0, 0, 1, 0], [1, 1, 4]), "a corner that its vertex does not have"),
        (coded([0, 0, 1, 0], [1, -1, 1]), "a corner that its vertex does not have"),
        (coded([0, 0, 2, 0], [1, 1, 1]), "neither has a seam nor has none"),
        (coded([0, 0, -1, 0], [1, 1, 1]), "neither has a seam nor has none"),
        (coded([0, 0, 1, 0], [1, 1]), "not as many corners at seams"),
        (coded([1, 0, 1, 1], [1, 1, 1]), "not as many corners at seams"),
        (coded([0, 0, 1, 0], [1, 1, 1], 8), "8 of 7 corners"),
        (coded([0, 0, 1, 0], [1, 1, 1]) + 20 * b"\1", "behind|left|before|taken|damaged"),
        (b"", "cut|ends|end"),
    ],
)
def test_rows_are_refused_when_they_are_not_those_of_the_corners(payload, reason):
    with pytest.raises(MeshReelError, match=reason):
        read_corner_rows(payload, VERTICES, 4)


def test_a_long_row_of_corners_is_read_when_a_vertex_has_all():
    vertices = np.zeros(40_000, np.int64)
    rows = numbered_rows(np.arange(40_000) % 2, vertices, 1)
    found = read_corner_rows(write_corner_rows(rows, vertices, 1), vertices, 1)
    assert found.of_corners.tolist() == rows.of_corners.tolist()


def test_rows_are_refused_when_a_zero_is_at_their_end():
    rows = numbered_rows(np.zeros(300, np.int64), np.zeros(300, np.int64), 1)
    payload = write_corner_rows(rows, np.zeros(300, np.int64), 1)
    with pytest.raises(CorruptStreamError, match="end before their section does"):
        read_corner_rows(payload + b"\0", np.zeros(300, np.int64), 1)
