"""Numbering and coding of rows of corners that share values."""

from dataclasses import replace

import numpy as np
import pytest

import meshreel
from conformance.surface import CornerRows
from meshreel.codec.bitstream.container import read_varint, write_varint
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.corner_rows import number_rows, write_corner_rows
from meshreel.codec.tracks import write_track
from meshreel.errors import MeshReelError
from meshreel.kernel.integers import decode_integers, encode_integers
from meshreel.model.tracks import Track
from samples.meshes import waving_grid
from samples.streams import Stream, parts_of, raw_stream, track_header

VERTICES = np.array([2, 0, 2, 0, 2, 3, 2])
GROUPS = np.array([0, 1, 2, 1, 0, 3, 2])
ROWS = [2, 0, 4, 0, 2, 3, 4]
"""Corners of vertices 0, 2 and 3 of four; those of vertex 2 form two groups."""


def test_first_corners_have_the_rows_of_their_vertices_and_others_follow():
    rows = number_rows(GROUPS, VERTICES, 4)
    assert (rows.of_corners.tolist(), rows.n_rows) == (ROWS, 5)


@pytest.mark.parametrize("seed", range(20))
def test_rows_round_trip(seed):
    rng = np.random.default_rng(seed)
    n_verts = int(rng.integers(1, 40))
    vertices = rng.integers(0, n_verts, rng.integers(1, 300))
    _, groups = np.unique(
        vertices * 9 + rng.integers(0, 1 + seed % 9, len(vertices)), return_inverse=True
    )
    rows = number_rows(groups, vertices, n_verts)
    result = CornerRows(write_corner_rows(rows, vertices, n_verts), vertices.tolist(), n_verts)
    assert (result.of_corners, result.n) == (rows.of_corners.tolist(), rows.n_rows)
    pairs = np.unique(np.stack([groups, np.array(result.of_corners, np.int64)]), axis=1)
    assert pairs.shape[1] == groups.max() + 1 == len(set(result.of_corners))


def coded(flags, codes, n_stored=None):
    n_stored = len(codes) if n_stored is None else n_stored
    return write_varint(n_stored) + encode_integers([np.array(flags), np.array(codes, int)])


def test_codes_refer_to_the_previous_corner_of_the_row():
    assert write_corner_rows(number_rows(GROUPS, VERTICES, 4), VERTICES, 4) == coded(
        [0, 0, 1, 0], [1, 2, 2]
    )


@pytest.mark.slow
def test_rows_of_a_vertex_with_many_corners_take_few_bytes():
    vertices = np.zeros(40_000, np.int64)
    rows = number_rows(np.arange(40_000) % 2, vertices, 1)
    payload = write_corner_rows(rows, vertices, 1)
    assert len(payload) < 100
    assert CornerRows(payload, vertices.tolist(), 1).of_corners == rows.of_corners.tolist()


@pytest.fixture(scope="module")
def seam():
    """Parts of a stream with a track of corners with a seam, and the track's header."""
    grid = waving_grid(2, 3, 3)
    is_right = grid.faces.max(axis=1) == grid.faces.max()
    values = (grid.faces + 100.0 * is_right[:, None]).reshape(1, -1, 1).repeat(2, axis=0)
    track = Track(values.astype(np.float32), "corner")
    data = meshreel.encode(grid.replace(tracks={"x": track}), tracks={"x": "exact"})
    np.testing.assert_array_equal(meshreel.decode(data).tracks["x"].values, track.values)
    stream = Stream(data)
    (payload,) = (payload for section, payload in parts_of(stream) if section is Section.TRACK)
    return stream, track_header(payload)


def other(numbers, place, number):
    """Replace a number."""
    return [*numbers[:place], number, *numbers[place + 1 :]]


@pytest.mark.parametrize(
    "damaged",
    [
        lambda flags, codes: coded(flags, other(codes, 0, 2)),
        lambda flags, codes: coded(flags, other(codes, 0, -1)),
        lambda flags, codes: coded(flags, other(codes, 0, 9)),
        lambda flags, codes: coded(other(flags, flags.index(1), 2), codes),
        lambda flags, codes: coded(other(flags, flags.index(0), -1), codes),
        lambda flags, codes: coded(flags, codes[:-1]),
        lambda flags, codes: coded([1] * len(flags), codes),
        lambda flags, codes: coded(flags, codes, 1000),
        lambda flags, codes: coded(flags, codes) + 20 * b"\1",
        lambda flags, codes: coded(flags, codes) + b"\0",
        lambda flags, codes: b"",
    ],
    ids=[
        *("before the first", "negative", "beyond", "flag 2", "flag -1", "fewer codes"),
        *("all flags", "too many", "longer", "a zero behind", "empty"),
    ],
)
def test_rows_that_contradict_the_corners_are_refused(seam, damaged):
    stream, header = seam
    n_stored, position = read_varint(header.rows, 0)
    numbers = decode_integers(header.rows[position:], [9, n_stored])
    flags, codes = (number.tolist() for number in numbers)
    assert coded(flags, codes) == header.rows
    payload = write_track(replace(header, rows=damaged(flags, codes)))
    parts = [
        (section, payload if section is Section.TRACK else own) for section, own in parts_of(stream)
    ]
    with pytest.raises(MeshReelError):
        meshreel.decode(raw_stream(stream.header, parts))
