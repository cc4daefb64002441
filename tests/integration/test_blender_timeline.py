"""Mapping of scene frames to frames of a reel; this module needs no Blender."""

import importlib.util

import numpy as np
import pytest

from integration.blender_session import ADD_ON_FOLDER


@pytest.fixture(scope="module")
def timeline():
    path = ADD_ON_FOLDER / "meshreel_blender" / "timeline.py"
    spec = importlib.util.spec_from_file_location("blender_timeline", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("rate", [1.0, 12.5, 24.0, 24000 / 1001, 29.97, 30000 / 1001, 59.94, 240.0])
def test_rates_round_trip_through_blenders_numbers(timeline, rate):
    fps, base = timeline.rate_numbers(rate)
    assert isinstance(fps, int)
    result = timeline.scene_rate(fps, float(np.float32(base)))
    assert abs(result / rate - 1) < 1.1e-6


@pytest.mark.parametrize(("fps", "base", "rate"), [(30, 1.001, 30000 / 1001), (25, 1.0, 25.0)])
def test_nominal_rates_are_recovered_from_blender(timeline, fps, base, rate):
    assert timeline.scene_rate(fps, float(np.float32(base))) == rate


@pytest.mark.parametrize(
    ("scene_frame", "start", "duration", "end", "position"),
    [
        (1, 1, 1, "HOLD", 0.0),
        (0, 1, 1, "HOLD", 0.0),
        (6, 1, 1, "HOLD", 4.0),
        (3, 1, 2, "HOLD", 1.0),
        (2, 1, 2, "HOLD", 0.5),
        (6, 1, 1, "LOOP", 0.0),
        (0, 1, 1, "LOOP", 4.0),
        (-4, 1, 1, "LOOP", 0.0),
        (10.5, 1, 2, "LOOP", 4.0),
        (1 + 3 * 24 / 30000 * 1001, 1, 24 / 30000 * 1001, "HOLD", 3.0),
    ],
)
def test_position_is_exact_at_frames_of_the_reel(
    timeline, scene_frame, start, duration, end, position
):
    assert timeline.reel_position(scene_frame, start, duration, 5, end) == position


@pytest.mark.parametrize("end", ["HOLD", "LOOP"])
def test_a_single_frame_has_a_constant_position(timeline, end):
    positions = [timeline.reel_position(frame, 1, 0.8, 1, end) for frame in range(-5, 9)]
    assert positions == [0.0] * 14


def test_an_unknown_rate_maps_scene_frames_to_frames(timeline):
    assert timeline.scene_frames_per_reel_frame(60.0, 0.0) == 1.0


@pytest.mark.parametrize(("duration", "last"), [(1.0, 14), (2.0, 18), (0.5, 12), (0.8, 13)])
def test_last_scene_frame_is_the_last_that_moves(timeline, duration, last):
    assert timeline.last_scene_frame(10.0, duration, 5) == last


TIMES = [0, 0.005, 0.01, 0.015, 0.0175]


@pytest.mark.parametrize(
    ("seconds", "end", "position"),
    [
        (-1, "HOLD", 0),
        (0, "HOLD", 0),
        (0.0025, "HOLD", 0.5),
        (0.015, "HOLD", 3),
        (0.01624999999, "HOLD", 3.5),
        (0.0174999999, "HOLD", 4),
        (1, "HOLD", 4),
        (0.0175, "LOOP", 4),
        (0.0175 * 1.25 + 0.0025, "LOOP", 0.5),
        (-0.001, "LOOP", 4),
    ],
)
def test_frames_at_times_of_their_own_are_shown_when_due(timeline, seconds, end, position):
    assert timeline.uneven_position(seconds, TIMES, end) == pytest.approx(position, abs=1e-4)
    assert timeline.uneven_position(seconds, [0.0], end) == 0
