import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.formats.gltf.placement import check_range, mean_frame, place_frames, place_still

RNG = np.random.default_rng(11)


def test_place_frames_gives_back_positions_when_moves_are_added_to_the_base():
    frames = 5e3 + RNG.standard_normal((7, 40, 3)) * [1, 20, 3]
    placed = place_frames(frames, mean_frame(frames))
    found = placed.base / 32767 + placed.moves.reshape(7, 40, 3)
    world = found * placed.placement.scale + placed.placement.offset
    np.testing.assert_allclose(world, frames, atol=3e-7 * placed.placement.scale)
    assert np.abs(placed.base).max() <= 32767


def test_place_frames_has_a_placement_of_float32_when_it_is_stored_as_such():
    frames = 0.1 + RNG.standard_normal((3, 9, 3))
    placement = place_frames(frames, mean_frame(frames)).placement
    for number in (*placement.offset, placement.scale):
        assert np.float32(number) == number


def test_place_still_keeps_positions_when_they_are_float32():
    base = RNG.standard_normal((9, 3)).astype(np.float32)
    placement, rest = place_still(base)
    assert (placement.scale, placement.offset.any()) == (1.0, False)
    np.testing.assert_array_equal(rest, base)


def test_place_still_keeps_detail_when_float64_is_far_from_zero():
    base = 1e7 + RNG.standard_normal((9, 3))
    placement, rest = place_still(base)
    np.testing.assert_allclose(rest + placement.offset, base, rtol=0, atol=1e-6)


def test_check_range_names_the_largest_when_it_is_no_float32():
    with pytest.raises(InvalidInputError, match=r"holds float32.*got 1e\+39; scale down"):
        check_range(np.array([-1e39, 0, 0]), np.zeros(3))
