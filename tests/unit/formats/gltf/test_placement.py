import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.formats.gltf.morphs import check_range, place_frames, place_static

RNG = np.random.default_rng(11)


def test_base_and_displacements_of_placed_frames_add_up_to_the_positions():
    frames = 5e3 + RNG.standard_normal((7, 40, 3)) * [1, 20, 3]
    placement, base, displacements = place_frames(frames, frames.mean(axis=0, dtype=np.float64))
    placed = base / 32767 + displacements.reshape(7, 3, 40).transpose(0, 2, 1)
    world = placed * placement.scale + placement.offset
    np.testing.assert_allclose(world, frames, atol=3e-7 * placement.scale)
    assert np.abs(base).max() <= 32767


def test_placement_is_exact_in_float32():
    frames = 0.1 + RNG.standard_normal((3, 9, 3))
    placement, _, _ = place_frames(frames, frames.mean(axis=0, dtype=np.float64))
    for number in (*placement.offset, placement.scale):
        assert np.float32(number) == number


def test_place_static_keeps_float32_positions_exact():
    base = RNG.standard_normal((9, 3)).astype(np.float32)
    placement, rest = place_static(base)
    assert (placement.scale, placement.offset.any()) == (1.0, False)
    np.testing.assert_array_equal(rest, base)


def test_place_static_keeps_float64_detail_far_from_the_origin():
    base = 1e7 + RNG.standard_normal((9, 3))
    placement, rest = place_static(base)
    np.testing.assert_allclose(rest + placement.offset, base, rtol=0, atol=1e-6)


def test_check_range_names_the_largest_coordinate():
    with pytest.raises(InvalidInputError, match=r"stores float32.*got 1e\+39; scale"):
        check_range(np.array([-1e39, 0, 0]), np.zeros(3))
