import numpy as np
import pytest

from meshreel.formats.frames.stored_frames import FrameSurvey
from meshreel.model.extent import extent_of


def survey_of(*blocks, is_decimal=True):
    survey = FrameSurvey(is_decimal=is_decimal)
    for block in blocks:
        survey.add(block)
    return survey


def moving(dtype=np.float64):
    return np.random.default_rng(0).standard_normal((3, 50, 3)).astype(dtype)


def test_decimal_text_near_the_origin_is_float32():
    assert survey_of(moving()).dtype == np.float32


def test_decimal_text_with_one_distant_frame_is_float64():
    vertices = moving()
    vertices[2] += 1e4
    assert survey_of(vertices).dtype == np.float64


def test_decimal_text_with_one_collapsed_frame_is_float32():
    vertices = moving()
    vertices[1] = 0.1
    assert survey_of(vertices).dtype == np.float32


@pytest.mark.parametrize("largest", [1e39, 1.7e308])
def test_decimal_text_beyond_float32_is_float64(largest):
    assert survey_of(np.array([[[-largest, 0, 0], [largest, 0, 0]]])).dtype == np.float64


@pytest.mark.parametrize("order", [(np.float32, np.float64), (np.float64, np.float32)])
def test_mixed_declared_types_are_float64(order):
    assert survey_of(*map(moving, order), is_decimal=False).dtype == np.float64


def test_declared_float32_stays_float32():
    assert survey_of(moving(np.float32), is_decimal=False).dtype == np.float32


@pytest.mark.parametrize("is_decimal", [False, True])
def test_survey_extent_covers_all_blocks(is_decimal):
    vertices = moving()
    survey = survey_of(vertices[:1], vertices[1:], is_decimal=is_decimal)
    expected = extent_of(vertices.astype(survey.dtype))
    assert survey.extent.low.tobytes() == expected.low.tobytes()
    assert survey.extent.high.tobytes() == expected.high.tobytes()
    assert survey.extent.mean_diagonal == expected.mean_diagonal
