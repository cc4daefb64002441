import numpy as np
import pytest
from matplotlib.figure import Figure

from meshreel.evaluation.plots import (
    CODEC_COLORS,
    CODEC_MARKERS,
    METHOD_COLORS,
    draw_envelopes,
    line_style,
    point_marker,
    spread,
)

pytest.importorskip("matplotlib")

CURVES = {"a": [(0.5, 20.0), (4.0, 2e-5), (3.0, 1.0)], "b": [(0.7, 9.0)]}


def test_ticks_are_plain_numbers_when_envelopes_are_drawn():
    axes = Figure().add_subplot()
    draw_envelopes(axes, CURVES, "error")
    for axis in (axes.xaxis, axes.yaxis):
        assert axis.get_scale() == "log"
        assert [axis.get_major_formatter()(number) for number in (0.5, 20.0)] == ["0.5", "20"]
        assert axis.get_minor_formatter()(3.0) == ""
        assert {1.0, 2.0, 5.0} <= set(axis.get_major_locator().tick_values(0.5, 9))
    assert not axes.spines["top"].get_visible()


def test_lines_follow_the_lower_envelope_and_points_are_all_shown():
    axes = Figure().add_subplot()
    draw_envelopes(axes, CURVES, "error", "rate")
    drawn = [sorted(zip(*line.get_data(), strict=True)) for line in axes.lines[:2]]
    assert drawn[0] == sorted(CURVES["a"])
    assert drawn[1] == [(0.5, 20.0), (3.0, 1.0), (4.0, 2e-5)]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("rate", "error")


def test_legend_lists_envelopes_by_ascending_rate():
    axes = Figure().add_subplot()
    draw_envelopes(axes, {"slow": [(4.0, 1.0)], **CURVES, "lossless": [(9.0, 0.0)]}, "error")
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["b", "a", "slow"]


@pytest.mark.parametrize(
    ("recorded", "measured"),
    [("sz3_lorenzo_2d (recorded)", "sz3"), ("zfp_2d (recorded)", "zfp"),
     ("draco (recorded)", "draco")],
)  # fmt: skip
def test_recorded_codec_has_the_style_of_the_measured_one(recorded, measured):
    assert line_style(recorded)["color"] == line_style(measured)["color"] == CODEC_COLORS[measured]
    assert point_marker(recorded) == point_marker(measured) != "o"


def test_every_codec_has_a_unique_color_and_marker():
    assert set(CODEC_COLORS) == set(CODEC_MARKERS)
    assert len(set(CODEC_MARKERS.values())) == len(CODEC_MARKERS)
    colors = [*METHOD_COLORS.values(), *CODEC_COLORS.values()]
    assert len(set(colors)) == len(colors)


def test_spread_keeps_heights_that_do_not_overlap():
    assert spread([0.8, 0.1, 0.5], [0.1, 0.1, 0.1]) == pytest.approx([0.8, 0.1, 0.5])


def test_equal_heights_are_spread_around_their_mean():
    assert sorted(spread([0.5, 0.5, 0.5], [0.1] * 3)) == pytest.approx([0.4, 0.5, 0.6])


def test_labels_near_an_end_stay_inside():
    assert sorted(spread([0.0, 0.02, 0.01], [0.1] * 3)) == pytest.approx([0.05, 0.15, 0.25])
    assert sorted(spread([1.0, 0.98], [0.1] * 2)) == pytest.approx([0.85, 0.95])


def test_labels_of_different_heights_do_not_overlap():
    rng = np.random.default_rng(3)
    heights, needed = rng.uniform(0, 1, 12), rng.uniform(0.02, 0.12, 12)
    placed = np.array(spread(list(heights), list(needed)))
    order = np.argsort(placed)
    gaps = np.diff(placed[order])
    assert (gaps >= (needed[order][1:] + needed[order][:-1]) / 2 - 1e-12).all()
    assert (order == np.argsort(heights)).all()


def test_spread_of_no_labels_is_empty():
    assert spread([], []) == []
