"""Choices of frames."""

import pytest

from meshreel.model.frame_choice import evenly_spaced


@pytest.mark.parametrize("n_frames", [1, 2, 3, 4, 5, 300])
def test_evenly_spaced_numbers_are_within_the_range(n_frames):
    numbers = evenly_spaced(n_frames, 4)
    assert set(numbers) <= set(range(n_frames))
    assert len(numbers) == min(n_frames, 4)


def test_evenly_spaced_numbers_are_the_middles_of_equal_parts():
    assert evenly_spaced(80, 4) == [10, 30, 50, 70]
