"""Tracks of live frames."""

from io import BytesIO

import numpy as np
import pytest

import meshreel
from meshreel.errors import InvalidInputError
from meshreel.model.tracks import TrackKind
from samples.meshes import waving_grid

GRID = waving_grid(11)
HEAT = (300 + 20 * np.sin(np.arange(11)[:, None] / 3 + np.arange(GRID.n_verts) / 20)).astype("f4")


def recorded(frames, bounds=None, **options):
    """Encode frames with tracks in chunks."""
    file = BytesIO()
    with meshreel.Encoder(GRID.faces, file, fps=25, tracks=bounds, **options) as encoder:
        for frame, tracks in frames:
            encoder.push(frame, tracks)
    return file.getvalue()


def test_tracks_of_pushed_frames_are_within_their_bounds():
    frames = [
        (frame, {"heat": meshreel.Track(HEAT[number][None], unit="K"), "again": HEAT[number]})
        for number, frame in enumerate(GRID.vertices)
    ]
    data = recorded(frames, {"heat": "0.5K"}, block_frames=4)
    result = meshreel.decode(data).tracks
    assert (result["heat"].unit, result["again"].kind) == ("K", TrackKind.SCALAR)
    assert 0.1 < np.abs(result["heat"].values[..., 0] - HEAT).max() <= 0.5
    first_range = np.ptp(HEAT[:4])
    assert np.abs(result["again"].values[..., 0] - HEAT).max() <= 0.001 * first_range
    alone = meshreel.decode(recorded([(frame, None) for frame in GRID.vertices], block_frames=4))
    np.testing.assert_array_equal(meshreel.decode(data).vertices, alone.vertices)


def test_frame_with_other_tracks_than_the_first_is_refused():
    with meshreel.Encoder(GRID.faces, BytesIO()) as encoder:
        encoder.push(GRID[0].vertices, {"heat": HEAT[0]})
        with pytest.raises(InvalidInputError, match="frame 1 has the tracks none; frame 0 has"):
            encoder.push(GRID[1].vertices)
        with pytest.raises(InvalidInputError, match="float64"):
            encoder.push(GRID[1].vertices, {"heat": HEAT[1].astype(float)})
        with pytest.raises(InvalidInputError, match="track 'heat': values of shape"):
            encoder.push(GRID[1].vertices, {"heat": HEAT[1][:-1]})
        encoder.push(GRID[1].vertices, {"heat": HEAT[1]})
        assert encoder.n_frames == 2


def test_bounds_of_unknown_tracks_are_refused_at_the_first_frame():
    encoder = meshreel.Encoder(GRID.faces, BytesIO(), tracks={"heap": 1})
    with pytest.raises(InvalidInputError, match="did you mean 'heat'"):
        encoder.push(GRID[0].vertices, {"heat": HEAT[0]})
    with meshreel.Encoder(GRID.faces, BytesIO(), method="pca-qp") as encoder:
        with pytest.raises(InvalidInputError, match="codes positions only"):
            encoder.push(GRID[0].vertices, {"heat": HEAT[0]})
        encoder.push(GRID[0].vertices)
