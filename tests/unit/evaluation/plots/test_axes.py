import pytest

from meshreel.evaluation.plots.axes import draw_envelopes

pytest.importorskip("matplotlib")
from matplotlib.figure import Figure

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
