import numpy as np
import pytest

from meshreel.rendering.painting import shade


def brightness(*direction):
    normal = np.array([direction], np.float32)
    normal /= np.linalg.norm(normal)
    return float(shade(normal, np.full((1, 3), 128, np.float32)).mean())


def test_light_comes_from_above_the_left_shoulder():
    turns = np.radians(np.arange(0, 360, 5))
    around = [brightness(np.cos(turn), np.sin(turn), -0.8) for turn in turns]
    assert np.degrees(turns[np.argmax(around)]) == pytest.approx(245, abs=6)
    assert brightness(-0.5, -0.7, -0.75) > 1.7 * brightness(0.5, 0.7, -0.75)


@pytest.mark.parametrize(
    ("direction", "level"), [((0, 0, -1), 122), ((0, -1, 0), 119), ((0, 1, 0), 48)]
)
def test_brightness_is_that_of_key_fill_and_sky(direction, level):
    assert brightness(*direction) == pytest.approx(level, abs=4)
