import pytest
from matplotlib.figure import Figure

from meshreel.studies.plots import CODECS, METHOD_COLORS, codec_of, draw_envelopes, line_style

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
    assert codec_of(recorded) == measured
    assert line_style(recorded)["color"] == line_style(measured)["color"] == CODECS[measured][0]


def test_every_codec_has_a_unique_color_and_marker():
    markers = [marker for _, marker in CODECS.values()]
    colors = [*METHOD_COLORS.values(), *(color for color, _ in CODECS.values())]
    assert "o" not in markers
    assert len({*markers, *colors}) == len(markers) + len(colors)
