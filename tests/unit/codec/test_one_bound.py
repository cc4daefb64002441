"""One error bound for positions and all tracks."""

from io import BytesIO

import numpy as np
import pytest

import meshreel
from meshreel.errors import InvalidInputError
from meshreel.model.tracks import Track
from samples.meshes import waving_grid

GRID = waving_grid(9)
HEAT = 40.0 * GRID.vertices[..., 2]
NORMALS = np.random.default_rng(4).normal(size=GRID.vertices.shape)
NORMALS /= np.linalg.norm(NORMALS, axis=2, keepdims=True)
TRACKS = {
    "heat": Track(HEAT, unit="K"),
    "up": Track(NORMALS, kind="normal"),
    "state": Track((HEAT > 0).astype(np.uint8)),
}
SEQUENCE = GRID.replace(tracks=TRACKS)
PERCENT = 0.5
HEAT_BOUND = PERCENT / 100 * np.ptp(HEAT)
ANGLE_DEG = np.degrees(2 * np.arcsin(PERCENT / 100))


def assert_bounded(sequence, data, heat=HEAT_BOUND):
    errors = meshreel.compare(sequence, data)
    bounds = {track.name: track.bound for track in meshreel.info(data).tracks}
    assert 0 < errors.max_error_percent <= PERCENT
    assert meshreel.info(data).error_bound_percent == pytest.approx(PERCENT)
    assert bounds == {"heat": pytest.approx(heat), "up": pytest.approx(ANGLE_DEG), "state": 0}
    for name, bound in bounds.items():
        assert errors.tracks[name].largest <= bound
    assert errors.tracks["heat"].largest > 0.5 * heat


def test_positions_and_all_tracks_are_within_the_bound():
    data = meshreel.encode(SEQUENCE, bound=f"{PERCENT}%")
    assert_bounded(SEQUENCE, data)
    assert data == meshreel.encode(SEQUENCE, bound=PERCENT)


def test_tracks_may_have_other_bounds():
    data = meshreel.encode(SEQUENCE, bound=PERCENT, tracks={"heat": "400mK"})
    assert_bounded(SEQUENCE, data, heat=0.4)


def test_it_applies_to_live_frames():
    file = BytesIO()
    with meshreel.Encoder(GRID.faces, file, bound=PERCENT) as encoder:
        for number, frame in enumerate(GRID.vertices):
            single = slice(number, number + 1)
            encoder.push(
                frame,
                tracks={
                    name: Track(track.values[single], kind=track.kind, unit=track.unit)
                    for name, track in TRACKS.items()
                },
            )
    assert_bounded(SEQUENCE, file.getvalue())


def test_it_is_relative_to_the_range_in_all_segments():
    other = waving_grid(9, 4, 4).replace(tracks={"heat": Track(np.zeros((9, 16)), unit="K")})
    several = meshreel.MeshSequence.of_segments([SEQUENCE, other])
    data = meshreel.encode(several, bound=PERCENT)
    heat = next(track for track in meshreel.info(data).tracks if track.name == "heat")
    assert heat.bound == pytest.approx(HEAT_BOUND)


def test_one_frame_on_a_grid_is_within_the_bound():
    rounded = np.round(GRID.vertices[:1] * 64) / 64
    frame = meshreel.MeshSequence(rounded, GRID.faces, tracks={"heat": Track(HEAT[:1], unit="K")})
    data = meshreel.encode(frame, bound=PERCENT)
    errors = meshreel.compare(frame, data)
    assert errors.max_error_percent <= PERCENT
    assert errors.tracks["heat"].largest <= PERCENT / 100 * np.ptp(HEAT[0])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"bound": "1mm"}, "^bound is a percentage such as 0.1%.*got '1mm'.*with max_error"),
        ({"bound": 0}, "^bound must be above 0, in percent; got 0"),
        ({"bound": "0.1%", "max_error": 1}, "^bound and max_error exclude each other"),
        ({"bound": "0.1%", "size": 100}, "^bound and size exclude each other"),
        ({"bound": "0.1%", "lossless": True}, "^bound has no effect with lossless"),
        ({"bound": "0.1%", "method": "pca-qp"}, "^method pca-qp does not take bound"),
    ],
)
def test_bound_that_has_no_meaning_is_refused(options, message):
    with pytest.raises(InvalidInputError, match=message):
        meshreel.encode(SEQUENCE, **options)
