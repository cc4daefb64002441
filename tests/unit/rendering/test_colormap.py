import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.rendering.color_bars import _ticks_with_ends, draw_color_bar
from meshreel.rendering.colormap import (
    DIVERGING,
    HEAT,
    NOT_A_NUMBER,
    colorize,
    round_up,
    short_number,
)


def cie_lightness(colors):
    """CIE 1976 L* of sRGB colors, 0..100."""
    share = colors / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    luminance = linear @ [0.2126, 0.7152, 0.0722]
    return 116 * np.cbrt(luminance) - 16


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("values", "ends", "colors"),
    [
        ([2.0, 6.0], (2, 6), HEAT[[0, -1]]),
        ([-np.inf, 9.0], (0, 1), HEAT[[0, -1]]),
        ([0.0, 0.0], (0, 0), HEAT[[0, 0]]),
        ([-1.0, 3.0], (-1, 3, "sequential"), HEAT[[0, -1]]),
        ([2.0, 6.0], (2, 6, "diverging"), DIVERGING[[0, -1]]),
        ([-2.0, 0.0, 2.0, 4.0], (-2, 4), DIVERGING[[4, 8, 12, 16]]),
        ([np.nan], (0, 1), [NOT_A_NUMBER]),
    ],
    ids=["ends", "outside", "empty range", "sequential", "diverging", "around 0", "not a number"],
)
def test_colorize_maps_and_clamps_the_range(values, ends, colors):
    np.testing.assert_array_equal(colorize(values, *ends), colors)


def test_lightness_grows_evenly_with_the_values():
    """Within a third of the mean step everywhere, so that no step looks larger than another."""
    steps = np.diff(cie_lightness(colorize(np.linspace(0, 1, 17), 0, 1)))
    assert (np.abs(steps / steps.mean() - 1) < 1 / 3).all()


@pytest.mark.parametrize(
    ("values", "low", "high"), [([[1.0]], 0, 1), ([1.0], 1, 0), ([1.0], 0, np.inf)]
)
def test_colorize_rejects_invalid_shapes_and_ranges(values, low, high):
    with pytest.raises(InvalidInputError):
        colorize(values, low, high)


@pytest.mark.parametrize(
    ("value", "rounded"),
    [(0, 1), (1, 1), (1.01, 1.5), (0.0234, 0.03), (7.1, 8), (81, 100), (0.3, 0.3), (6e-9, 6e-9)],
)
def test_round_up_returns_a_round_number(value, rounded):
    assert round_up(value) == pytest.approx(rounded)


def test_diverging_colors_have_symmetric_lightness():
    lightness = cie_lightness(DIVERGING)
    np.testing.assert_allclose(lightness, lightness[::-1], atol=2.5)
    assert (np.diff(lightness[:9]) > 4).all()


@pytest.mark.parametrize(
    ("value", "span", "text"),
    [
        (289.8312, 177, "289.8"),
        (2.389e-6, 6.6, "0"),
        (-1e-9, 6.6, "0"),
        (293.02134, 0.4, "293.0213"),
        (1234567.0, 3e6, "1.235e+06"),
        (0.70001, 1e-5, "0.70001"),
        (500.0, 0.0, "500"),
    ],
)
def test_short_number_has_enough_digits_for_the_span(value, span, text):
    assert short_number(value, span) == text


def test_colorize_rejects_an_unknown_map():
    with pytest.raises(InvalidInputError, match="sequential or diverging; got 'jet'"):
        colorize([0.0], 0, 1, "jet")


def test_draw_color_bar_has_the_high_end_at_the_top():
    bar = draw_color_bar(0, 1, unit="mm", height=300)
    rows = [np.flatnonzero((bar == color).all(axis=2).any(axis=1)) for color in HEAT[[0, -1]]]
    assert rows[1].max() < rows[0].min()


@pytest.mark.parametrize(
    ("low", "high", "max_ticks", "numbers"),
    [
        (0, 1, 6, [0, 0.2, 0.4, 0.6, 0.8, 1]),
        (0, 3, 3, [0, 2, 3]),
        (-1, 1, 3, [-1, 0, 1]),
        (0, 2.1, 6, [0, 0.5, 1, 1.5, 2.1]),
        (-3e7, 8e7, 6, [-3e7, 0, 5e7, 8e7]),
        (0.7, 0.70001, 3, [0.7, 0.700005, 0.70001]),
        (2, 2, 6, [2]),
    ],
)
def test_numbers_of_a_color_bar_are_its_ends_and_round_ones(low, high, max_ticks, numbers):
    assert _ticks_with_ends(low, high, max_ticks) == pytest.approx(numbers, rel=1e-9, abs=1e-9)


def test_draw_color_bar_writes_the_unit():
    assert draw_color_bar(0, 1, unit="mm").shape[1] > draw_color_bar(0, 1).shape[1]


@pytest.mark.parametrize("high", [1.0, 1.5, 3.0, 6.0, 0.008])
@pytest.mark.parametrize("height", [120, 500])
def test_draw_color_bar_has_a_number_at_both_ends(high, height):
    bar = draw_color_bar(0, high, unit="%", height=height)
    colored = np.flatnonzero((np.ptp(bar.astype(int), axis=2) > 60).any(axis=1))
    letters = (bar[:, -bar.shape[1] // 2 :].max(axis=2) < 120).any(axis=1)
    for end in (colored[0], colored[-1]):
        assert letters[end - 6 : end + 7].sum() >= 5


@pytest.mark.parametrize(("low", "high"), [(0, 0), (0, 1e-9), (-3e7, 8e7), (0.7, 0.70001)])
def test_draw_color_bar_keeps_its_height_for_unusual_ranges(low, high):
    assert draw_color_bar(low, high, unit="m", height=200).shape[0] == 200


def test_draw_color_bar_has_its_number_at_the_lower_end_when_the_range_is_a_point():
    is_ink = draw_color_bar(2, 2, height=200)[:, 30:].max(axis=2) < 120
    assert is_ink[100:].any()
    assert not is_ink[:100].any()


def test_draw_color_bar_rejects_a_height_that_is_too_small_for_labels():
    with pytest.raises(InvalidInputError, match="80"):
        draw_color_bar(0, 1, height=20)


def test_color_bar_uses_the_named_map():
    bar = draw_color_bar(0, 1, colormap="diverging", height=300).reshape(-1, 3)
    for color in DIVERGING[[0, -1]]:
        assert (bar == color).all(axis=1).any()
    assert not (bar == HEAT[-1]).all(axis=1).any()
