"""Headers and values of tracks: reading, skipping, and refusal of invalid ones."""

from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.codec.reel_file import ReelFile
from meshreel.codec.tracks import Coding, Sharing, TrackHeader, write_track
from meshreel.errors import MemoryLimitError
from meshreel.model.surface import Domain
from meshreel.model.tracks import Track
from samples.meshes import waving_grid
from samples.streams import Stream, parts_of, raw_stream, track_header, track_headers, track_values

FOLDER = Path(__file__).parents[3] / "conformance" / "streams"
NAMES = (
    "tracks",
    "tracks_of_triangles",
    "tracks_of_polygons",
    "still_track",
    "corners_of_vertices",
    "corners_in_rows",
)
STRESS = TrackHeader(
    "stress", "Pa", "other", Domain.VERTEX, np.dtype(np.float32), 2.5, (1.0, -3.0, 0.0)
)


def stored(name):
    return (FOLDER / f"{name}.reel").read_bytes()


def test_header_of_a_track_round_trips():
    assert track_header(write_track(STRESS)) == STRESS


@pytest.mark.parametrize("sharing", list(Sharing))
@pytest.mark.parametrize("coding", [Coding.MODES, Coding.EXACT])
def test_sharing_of_corners_round_trips(sharing, coding):
    rows = b"some rows" if sharing is Sharing.ROWS else b""
    plain = TrackHeader("x", "", "other", Domain.CORNER, np.dtype("f4"), 1.0, (0.0,) * 2, coding)
    track = replace(plain, sharing=sharing, rows=rows)
    assert track_header(write_track(track)) == track


def predicted(coding, **changed):
    kind = "normal" if coding is Coding.ROTATIONS else "velocity"
    single, nowhere = np.dtype(np.float32), (0.0, 0.0, 0.0)
    numbers = (1.0, nowhere, coding, 0.0) if coding.is_exact else (2.5, nowhere, coding, 0.5)
    plain = TrackHeader("v", "", kind, Domain.VERTEX, single, *numbers)
    return replace(plain, **changed)


@pytest.mark.parametrize("coding", [one for one in Coding if one.is_predicted])
def test_header_of_a_predicted_track_round_trips(coding):
    track = predicted(coding, rate=29.97 if coding.has_rate else 0.0)
    assert track_header(write_track(track)) == track
    assert len(track.placement) == 1 + (2 if coding is Coding.ROTATIONS else 3)


def test_static_track_is_decoded_to_its_origin():
    (values,) = track_values(stored("still_track"))
    assert np.all(values == 0.5)


@pytest.mark.parametrize(
    "index",
    [
        np.s_[:, [1, 2]], np.s_[::-2, 3], np.s_[1, :, [0, 0]], np.s_[..., 0], np.s_[[1, 2], [3, 4]],
        np.s_[:, [1, 2], None, [0, 0]], np.s_[2:2, 1], np.s_[:, 0:5, 0], np.s_[-1, 2], np.s_[:,],
    ],
    ids=repr,
)  # fmt: skip
def test_values_are_selected_as_numpy_selects_them(index, monkeypatch):
    with meshreel.open(FOLDER / "still_track.reel") as reel:
        [track] = reel.tracks.values()
        expected = track[:][index]
        monkeypatch.setattr("meshreel.codec.reel_track.BLOCK_BYTES", 2 * track.frame_bytes)
        np.testing.assert_array_equal(track[index], expected)
        with pytest.raises(IndexError, match="out of bounds"):
            track[:, 10**6]


def without_index(data):
    stream = Stream(data)
    return raw_stream(stream.header, parts_of(stream))


@pytest.mark.parametrize("name", NAMES)
def test_only_bytes_of_the_track_are_read_with_an_index(name):
    groups = Stream(stored(name)).groups
    n_tracks = 1 + len(track_headers(stored(name)))
    assert all(len(block) == n_tracks for block in groups)
    assert groups == Stream(without_index(stored(name))).groups


def test_block_counts_only_with_all_its_tracks():
    data = stored("tracks")
    *ends, whole = [end for _, end in Stream(data).groups[1]]
    assert [len(Stream(data[:end]).groups) for end in ends] == [1, 1, 1]
    assert len(Stream(data[:whole]).groups) == 2


def test_block_of_a_track_beyond_the_memory_limit_is_refused():
    grid = waving_grid(40)
    wide = Track(np.ones((40, grid.n_verts, 256), np.float32))
    sequence = meshreel.MeshSequence(grid.vertices, grid.faces, tracks={"wide": wide})
    data = meshreel.encode(sequence, tracks={"wide": "exact"})
    with ReelFile(BytesIO(data), memory=3e6) as reel:
        reel.read(0, reel.n_frames)
        with pytest.raises(MemoryLimitError, match=r"would take .* MB .* may take 3 MB; "):
            reel.track("wide").read(0, 1)


def test_bounds_finer_than_the_integers_of_a_stream_are_kept():
    sheet = waving_grid(6)
    values = np.random.default_rng(1).random((6, sheet.n_verts))
    both = sheet.replace(tracks={"heat": Track(values)})
    data = meshreel.encode(both, tracks={"heat": "1e-10%"})
    decoded = meshreel.decode(data).tracks["heat"].values
    assert 0 < np.abs(np.squeeze(decoded) - values).max() <= 1e-12 * np.ptp(values)
