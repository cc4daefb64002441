import numpy as np
import pytest

from meshreel.formats.scenes.timing import neighbours


@pytest.mark.parametrize(
    ("time_s", "expected"),
    [
        (0.0, (0, 0, 0.0)),
        (1.0, (0, 0, 0.0)),
        (1.0005, (0, 0, 0.0)),
        (1.9995, (1, 1, 0.0)),
        (3.0, (1, 2, 0.5)),
        (9.0, (2, 2, 0.0)),
    ],
)
def test_neighbours_snaps_to_a_frame_when_the_time_is_close(time_s, expected):
    assert neighbours(np.array([1.0, 2.0, 4.0]), time_s) == expected
