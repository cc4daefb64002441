import pytest

from meshreel.evaluation.plots.palette import (
    CODEC_COLORS,
    CODEC_MARKERS,
    METHOD_COLORS,
    line_style,
    point_marker,
)


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
