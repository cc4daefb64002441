"""Tracks as colors: components, ranges and captions."""

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.model.surface import Attribute, Domain, Kind, Surface
from meshreel.model.tracks import Track
from meshreel.rendering.colormap import DIVERGING, HEAT, NOT_A_NUMBER
from meshreel.rendering.looks import TrackLook, parse_range
from meshreel.rendering.scenes import surface_colors
from meshreel.rendering.track_colors import FrameNumbers, TrackColors
from samples.meshes import quad_sheet


def track_of(values, kind=None, unit="Pa"):
    return Track(np.asarray(values, np.float32), kind=kind, unit=unit)


def scale_of(colors, track):
    numbers = FrameNumbers()
    for frame in track:
        numbers.add(colors.numbers(frame))
    return colors.scale(numbers)


VECTORS = track_of([[[3, 4, 0], [-1, 0, 0], [0, 0, 2]]])


@pytest.mark.parametrize(
    ("component", "numbers"),
    [(None, [5, 1, 2]), ("magnitude", [5, 1, 2]), ("x", [3, -1, 0]), ("2", [0, 0, 2])],
)
def test_numbers_are_those_of_the_component_when_it_is_named(component, numbers):
    colors = TrackColors(TrackLook("v", component), VECTORS)
    assert colors.numbers(VECTORS[0]).tolist() == numbers


def test_magnitude_of_a_scalar_is_its_absolute_value():
    sizes = TrackColors(TrackLook("s", "magnitude"), SCALAR)
    assert sizes.numbers(np.array([[1.0], [-2.0]])).tolist() == [1, 2]


SCALAR = Track(np.zeros((2, 5), np.float32))
VECTOR = Track(np.zeros((2, 5, 3), np.float32), kind="vector")
PAIR = Track(np.zeros((2, 5, 2), np.float32))
TENSOR = Track(np.zeros((2, 5, 9), np.float32))
COLOR = Track(np.zeros((2, 5, 3), np.uint8), kind="color")
NORMAL = Track(np.tile(np.float32([0, 0, 1]), (2, 5, 1)), kind="normal")


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("track", "options", "title"),
    [
        (SCALAR, {}, "u"),
        (SCALAR, {"component": "0", "range": "0:500"}, "u"),
        (SCALAR, {"component": "magnitude", "range": "-1.5e3:2%"}, "u, magnitude"),
        (VECTOR, {}, "u, magnitude"),
        (VECTOR, {"component": "z", "range": "2%:98%", "colormap": "diverging"}, "u, z"),
        (VECTOR, {"component": "magnitude", "range": "90%:7"}, "u, magnitude"),
        (NORMAL, {}, "u, x"),
        (TENSOR, {"component": "8"}, "u, column 8"),
        (COLOR, {}, "u"),
        (COLOR, {"component": "1", "range": "0:255"}, "u, y"),
    ],
)
def test_title_names_the_component(track, options, title):
    assert TrackColors(TrackLook("u", **options), track).title == title


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("track", "options", "message"),
    [
        (SCALAR, {"component": "y"}, "1 number per .* is 0, magnitude; got 'y'"),
        (PAIR, {"component": "z"}, "0 to 1, x, y, magnitude; got 'z'"),
        (VECTOR, {"component": "w"}, "has 3 numbers .* 0 to 2, x, y, z, magnitude; got 'w'"),
        (VECTOR, {"component": "3"}, "component is 0 to 2, x, y, z, magnitude; got '3'"),
        (TENSOR, {}, "9 numbers per vertex: component is 0 to 8; select one"),
        (TENSOR, {"component": "magnitude"}, "0 to 8; got 'magnitude'"),
        (TENSOR, {"component": "x"}, "0 to 8; got 'x'"),
        (COLOR, {"range": "0:1"}, "shown directly; omit range"),
        (COLOR, {"colormap": "diverging"}, "omit colormap"),
        (SCALAR, {"colormap": "jet"}, "colormap is sequential or diverging; got 'jet'"),
        (SCALAR, {"range": "2%:101%"}, "a range is LOW:HIGH, low first.* 0% to 100%"),
    ],
)
def test_error_lists_what_is_allowed_when_a_look_is_invalid(track, options, message):
    with pytest.raises(InvalidInputError, match=message):
        TrackColors(TrackLook("u", **options), track)


def test_range_is_between_percentiles_when_none_is_given():
    values = np.r_[-1e6, np.linspace(0, 100, 9999), 1e6]
    track = track_of(values[None])
    scale = scale_of(TrackColors(TrackLook("s"), track), track)
    assert (scale.low, scale.high) == pytest.approx((2, 98), abs=0.2)
    assert (scale.smallest, scale.largest) == (-1e6, 1e6)
    colors = TrackColors(TrackLook("s"), track)
    assert tuple(colors.colors(track[0], scale)[0]) == tuple(HEAT[0])
    assert tuple(colors.colors(track[0], scale)[-1]) == tuple(HEAT[-1])


def test_range_is_symmetric_about_0_when_percentiles_lie_on_both_sides():
    track = track_of(np.linspace(-1, 3, 1001)[None])
    colors = TrackColors(TrackLook("s"), track)
    scale = scale_of(colors, track)
    assert scale.low == -scale.high == pytest.approx(-2.92, abs=0.01)
    assert colors.colors(np.zeros((1, 1)), scale)[0].tolist() == DIVERGING[8].tolist()
    assert "symmetric about 0" in colors.caption(scale)


@pytest.mark.parametrize(
    ("values", "text", "ends"),
    [
        ([-0.04, 2, 5], "0%:100%", (0, 5)),
        ([-5, -2, 0.04], "0%:100%", (-5, 0)),
        ([-0.04, 0, 0.05], "0%:100%", (0, 0.1)),
        ([-0.2, 2, 5], "0%:100%", (-5, 5)),
        ([-0.04, 2, 5], "-1:100%", (-1, 5)),
    ],
)
def test_percentile_within_the_coding_error_of_0_becomes_0(values, text, ends):
    track = Track(np.float32([values]), error_bound=0.1)
    scale = scale_of(TrackColors(TrackLook("s", range=text), track), track)
    assert (scale.low, scale.high) == pytest.approx(ends, abs=1e-6)


def test_range_of_numbers_is_used_unchanged():
    track = track_of(np.linspace(-1, 3, 1001)[None])
    colors = TrackColors(TrackLook("s", range="-0.5:2e0"), track)
    scale = scale_of(colors, track)
    assert (scale.low, scale.high) == (-0.5, 2)
    assert colors.colors(np.zeros((1, 1)), scale)[0].tolist() == DIVERGING[8].tolist()
    assert colors.colors(np.full((1, 1), 9.0), scale)[0].tolist() == DIVERGING[-1].tolist()
    light, dark = colors.colors(np.array([[-0.5], [0.5]]), scale).astype(int)
    assert abs(int(light.sum()) - int(dark.sum())) < 60  # as far from 0, as dark
    assert colors.caption(scale) == (
        "Colors: s (Pa), from -0.5 to 2e0; the values shown are -1 to 3."
    )


def test_range_is_that_of_all_values_when_percentiles_are_0_and_100():
    rng = np.random.default_rng(0)
    track = track_of(1 + np.abs(rng.normal(size=(7, 12345))))
    scale = scale_of(TrackColors(TrackLook("s", range="0%:100%"), track), track)
    assert (scale.low, scale.high) == (scale.smallest, scale.largest)


def test_range_is_rejected_when_a_percentile_exceeds_the_other_end():
    track = track_of(np.linspace(5, 9, 100)[None])
    with pytest.raises(InvalidInputError, match="range 2%:3 of track 's' would be"):
        scale_of(TrackColors(TrackLook("s", range="2%:3"), track), track)


def test_range_of_normals_is_from_minus_1_to_1_when_none_is_given():
    normals = track_of(np.tile([0.6, 0, 0.8], (1, 3, 1)), "normal", unit="")
    scale = scale_of(TrackColors(TrackLook("n"), normals), normals)
    assert (scale.low, scale.high) == (-1, 1)


@pytest.mark.parametrize("value", [0.0, 7.0, -7.0])
def test_range_has_a_width_when_all_values_are_the_same(value):
    track = track_of(np.full((2, 5), value))
    scale = scale_of(TrackColors(TrackLook("s"), track), track)
    assert scale.low < value < scale.high


def test_missing_values_are_gray_when_there_are_some():
    track = track_of([[1, np.nan, 3], [np.inf, 2, 3]])
    colors = TrackColors(TrackLook("s"), track)
    scale = scale_of(colors, track)
    assert (scale.smallest, scale.largest, scale.has_missing) == (1, 3, True)
    assert tuple(colors.colors(track[0], scale)[1]) == NOT_A_NUMBER
    assert colors.caption(scale).endswith("are 1 to 3. Gray: no value.")
    nothing = track_of(np.full((1, 3), np.nan))
    scale = scale_of(colors, nothing)
    assert (colors.colors(nothing[0], scale) == NOT_A_NUMBER).all()
    assert colors.caption(scale).endswith("98%. Gray: no value.")


def test_a_color_track_is_shown_directly():
    floats = track_of([[[1, 0.5, 0, 1], [2, -1, np.nan, 0], [np.nan] * 4]], "color")
    colors = TrackColors(TrackLook("c"), floats)
    assert scale_of(colors, floats) is None
    assert colors.colors(floats[0], None).tolist() == [[255, 128, 0], [255, 0, 0], [150] * 3]
    numbers = Track(np.array([[[9, 8, 7]]], np.uint8), kind="color")
    assert TrackColors(TrackLook("c"), numbers).colors(numbers[0], None).tolist() == [[9, 8, 7]]
    assert TrackColors(TrackLook("c", "1"), floats).numbers(floats[0])[:2].tolist() == [0.5, -1]


@pytest.mark.parametrize(
    "text", ["", "5", "5:3", "a:b", "1:2:3", "-1%:5", "0:101%", "nan:1", "1e999:2", "3%:3%"]
)
def test_parse_range_explains_the_syntax_when_the_text_is_invalid(text):
    with pytest.raises(InvalidInputError, match="a range is LOW:HIGH, low first"):
        parse_range(text)


def test_parse_range_accepts_numbers_mixed_with_percentiles():
    assert parse_range("0: 99.5%") == ((0.0, False), (99.5, True))
    assert parse_range("2%:-1e3") == ((2.0, True), (-1000.0, False))


RED, GREEN = [255, 0, 0], [0, 255, 0]
FACES = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4]], np.int32)  # a quad and a triangle
SIZES = np.array([4, 3], np.int32)


def colored(domain, values):
    return Surface(SIZES, (Attribute("color", Kind.COLOR, domain, values),)).validated(5, FACES)


def test_mesh_without_color_attributes_has_no_colors():
    assert surface_colors(Surface(), FACES) is None


def test_colors_of_vertices_are_returned_without_opacity():
    values = np.arange(20, dtype=np.uint8).reshape(5, 4)
    actual = surface_colors(colored(Domain.VERTEX, values), FACES)
    np.testing.assert_array_equal(actual, values[:, :3])


def test_colors_of_faces_are_repeated_at_all_corners():
    values = np.array([RED, GREEN], np.float32) / 255
    actual = surface_colors(colored(Domain.FACE, values), FACES)
    np.testing.assert_allclose(actual, [[RED] * 3, [RED] * 3, [GREEN] * 3])


def test_colors_of_polygon_corners_follow_the_triangle_fan():
    values = np.repeat(np.arange(7, dtype=np.uint8)[:, None], 3, axis=1)
    actual = surface_colors(colored(Domain.CORNER, values), FACES)
    np.testing.assert_array_equal(actual[..., 0], [[0, 1, 2], [0, 2, 3], [4, 5, 6]])


@pytest.mark.parametrize("value", [-1.0, 2.0, float("nan")])
def test_float_colors_are_clamped(value):
    values = np.full((5, 3), value, np.float32)
    actual = surface_colors(colored(Domain.VERTEX, values), FACES)
    assert 0 <= actual.min() <= actual.max() <= 255


def test_colors_of_a_whole_sheet_fit_its_vertices():
    sheet = quad_sheet()
    assert surface_colors(sheet.surface, sheet.faces).shape == (sheet.n_verts, 3)
