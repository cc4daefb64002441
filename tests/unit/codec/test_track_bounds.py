"""Parsing of error bounds of tracks."""

import numpy as np
import pytest

from meshreel.codec.track_bounds import (
    DROP,
    EXACT,
    Measure,
    TrackBound,
    bound_of_track,
    default_bound,
    track_bounds,
    without_units,
)
from meshreel.errors import InvalidInputError
from meshreel.model.tracks import Track

PRESSURE = Track(np.zeros((1, 2)), unit="Pa")
PLAIN = Track(np.zeros((1, 2)))
FLOW = Track(np.zeros((1, 2, 3)), kind="velocity", unit="m/s")
NORMAL = Track(np.zeros((1, 2, 3)), kind="normal")
COLOR = Track(np.zeros((1, 2, 3)), kind="color")
UV = Track(np.zeros((1, 2, 2)), kind="uv")
COUNTS = Track(np.zeros((1, 2), np.int32))


@pytest.mark.parametrize(
    ("track", "given", "measure", "amount"),
    [
        (PRESSURE, 500, Measure.UNITS, 500),
        (PRESSURE, "=5e2", Measure.UNITS, 500),
        (PRESSURE, " .5 Pa ", Measure.UNITS, 0.5),
        (PRESSURE, "0.1%", Measure.SHARE, 0.1),
        (PRESSURE, "2MPa", Measure.UNITS, 2e6),
        (PRESSURE, "3 N/mm^2", Measure.UNITS, 3e6),
        (FLOW, "4mm/s", Measure.UNITS, 0.004),
        (UV, "0.001", Measure.UNITS, 0.001),
        (NORMAL, "0.5deg", Measure.ANGLE, 0.5),
        (NORMAL, "30 deg", Measure.ANGLE, 30),
        (COLOR, "8bit", Measure.NUMBER, 0.5 / 255),
        (COLOR, "1bit", Measure.NUMBER, 0.5),
        (COLOR, "10 bit", Measure.NUMBER, 0.5 / 1023),
        (COLOR, "52bit", Measure.NUMBER, 0.5 / (2**52 - 1)),
        (COLOR, "2%", Measure.SHARE, 2),
    ],
)
def test_bounds_are_parsed(track, given, measure, amount):
    result = bound_of_track(given, "x", track)
    assert result == TrackBound(measure, pytest.approx(amount, rel=1e-15))


@pytest.mark.parametrize("track", [PRESSURE, NORMAL, COUNTS])
@pytest.mark.parametrize(("given", "bound"), [("exact", EXACT), ("Drop ", DROP)])
def test_any_track_can_be_exact_or_dropped(track, given, bound):
    assert bound_of_track(given, "x", track) == bound


@pytest.mark.parametrize(
    ("track", "given", "message"),
    [
        (
            PRESSURE,
            "500K",
            "500Pa in its unit or one that converts to it, exact or drop; got '500K'",
        ),
        (PLAIN, "500Pa", r"a number such as 500 \(the track has no unit\), exact or drop"),
        (PRESSURE, "0", "must be above 0"),
        (PRESSURE, "1e999", "must be above 0"),
        (
            PRESSURE,
            "0.5deg",
            "0.1% of its range, 500Pa in its unit or one that converts to it, exact or drop",
        ),
        (
            PRESSURE,
            "8bit",
            "0.1% of its range, 500Pa in its unit or one that converts to it, exact or drop",
        ),
        (
            PRESSURE,
            "much",
            "500Pa in its unit or one that converts to it, exact or drop; got 'much'",
        ),
        (PRESSURE, "-1", "500Pa in its unit or one that converts to it, exact or drop; got '-1'"),
        (COLOR, "0.9bit", "take 1bit to 52bit, or exact; got '0.9bit'"),
        (COLOR, "53bit", "take 1bit to 52bit, or exact; got '53bit'"),
        (COLOR, "2000bit", "take 1bit to 52bit, or exact; got '2000bit'"),
        (COLOR, "1e-30bit", "take 1bit to 52bit, or exact; got '1e-30bit'"),
        (COLOR, "0.5deg", r"\(the track has no unit\), 8bit, exact or drop"),
        (NORMAL, "0.1%", "a bound is an angle such as 0.5deg, exact or drop"),
        (NORMAL, "0.1", "a bound is an angle such as 0.5deg, exact or drop"),
        (NORMAL, "30.1deg", "at most 30deg; got '30.1deg'"),
        (COUNTS, "1%", "has integers, which are lossless"),
    ],
)
def test_bound_that_does_not_suit_the_track_is_refused(track, given, message):
    with pytest.raises(InvalidInputError, match=f"track 'x'.*{message}"):
        bound_of_track(given, "x", track)


@pytest.mark.parametrize(
    ("track", "bound"),
    [
        (PRESSURE, TrackBound(Measure.SHARE, 0.1)),
        (NORMAL, TrackBound(Measure.ANGLE, 0.5)),
        (COLOR, TrackBound(Measure.NUMBER, 0.5 / 255)),
        (UV, TrackBound(Measure.UNITS, 0.5 / 4096)),
        (COUNTS, EXACT),
        (Track(np.zeros((1, 2, 3), np.uint8), kind="color"), EXACT),
    ],
)
def test_default_bound_depends_on_the_kind(track, bound):
    assert default_bound(track) == bound


@pytest.mark.parametrize(
    ("track", "bound"),
    [
        (PRESSURE, TrackBound(Measure.SHARE, 0.2)),
        (COLOR, TrackBound(Measure.SHARE, 0.2)),
        (NORMAL, TrackBound(Measure.ANGLE, pytest.approx(0.22918, abs=1e-5))),
        (COUNTS, EXACT),
    ],
)
def test_one_bound_applies_to_all_tracks_of_floats(track, bound):
    assert default_bound(track, 0.2) == bound


def test_angle_of_normals_has_a_limit():
    assert default_bound(NORMAL, 400.0) == TrackBound(Measure.ANGLE, 30.0)


def test_bounds_are_the_requested_ones_or_the_default():
    tracks = {"a": PRESSURE, "b": NORMAL, "c": COUNTS}
    result = track_bounds(tracks, {"a": "2Pa"}, default_bound)
    assert result == {"a": TrackBound(Measure.UNITS, 2.0), "b": default_bound(NORMAL), "c": EXACT}
    assert track_bounds(tracks, {"b": "drop"}, lambda _: EXACT) == {
        "a": EXACT,
        "b": DROP,
        "c": EXACT,
    }
    with pytest.raises(InvalidInputError, match="there is no track 'd'"):
        track_bounds(tracks, {"d": "exact"}, default_bound)


@pytest.mark.parametrize(
    ("track", "given", "expected"),
    [
        (PLAIN, "500Pa", "500"),
        (PLAIN, "=.5 m/s", ".5"),
        (PRESSURE, "500K", "500K"),
        (PLAIN, "0.1%", "0.1%"),
        (PLAIN, "8bit", "8bit"),
        (PLAIN, "0.5deg", "0.5deg"),
        (COLOR, "500Pa", "500Pa"),
        (PLAIN, "drop", "drop"),
        (NORMAL, "0.5rad", "0.5rad"),
        (PLAIN, 500, 500),
    ],
)
def test_unit_of_a_bound_is_omitted_with_a_note_for_tracks_without_units(track, given, expected):
    notes = []
    assert without_units({"x": track}, {"x": given, "y": "1Pa"}, notes)["x"] == expected
    note = f"track 'x' has no unit in the file; its bound {given} is read as {expected}"
    assert notes == ([note] if given != expected else [])
