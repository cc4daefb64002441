"""Single frames that a quantizer left on a grid, and text wrote with few digits."""

import numpy as np
import pytest

import meshreel
from meshreel.codec.bitstream.container import write_varints
from meshreel.codec.bitstream.layout import Section
from meshreel.errors import CorruptStreamError
from meshreel.kernel.integers import encode_integers
from samples.meshes import waving_grid
from samples.streams import Stream, parts_of, raw_stream


def rough_sheet():
    """One frame without any pattern in its coordinates."""
    sheet, rng = waving_grid(1, rows=60, columns=60), np.random.default_rng(3)
    noise = rng.normal(scale=0.03, size=sheet.vertices.shape)
    return sheet.replace(vertices=(sheet.vertices + noise).astype(np.float32))


SHEET = rough_sheet()


def quantized(digits=None, dtype=np.float32):
    """Return the sheet on a grid of 9 bits, without -0, optionally read from text of few digits."""
    step = np.ptp(SHEET.vertices) / 511
    values = (np.rint(SHEET.vertices / step) * step).astype(np.float32) + np.float32(0)
    if digits is not None:
        values = np.array([float(f"{value:.{digits}g}") for value in values.ravel()], dtype)
    return SHEET.replace(vertices=values.reshape(SHEET.vertices.shape))


def sections_of(data):
    return {section for section, _ in parts_of(Stream(data))}


def assert_exact(sequence, data):
    decoded = meshreel.decode(data).vertices
    assert decoded.dtype == sequence.vertices.dtype
    assert decoded.tobytes() == sequence.vertices.tobytes()


@pytest.mark.parametrize(
    ("options", "digits"),
    [
        ({}, None),
        ({}, 7),
        ({"lossless": True}, 6),
        ({"lossless": True}, 7),
        ({"max_error": 0.1}, 7),
    ],
)
def test_grid_is_exact_and_takes_a_third_of_lossless(options, digits):
    sequence = quantized(digits)
    data = meshreel.encode(sequence, order="keep", **options)
    assert Section.ROUNDING in sections_of(data)
    assert_exact(sequence, data)
    assert 3 * len(data) < len(meshreel.encode(SHEET, lossless=True, order="keep"))


def test_negative_zeros_are_kept():
    values = quantized(7).vertices.copy()
    on_axis = values[0, :, 2] == values[0, 0, 2]
    values[0, :, 2] -= values[0, 0, 2]
    values[0, on_axis, 2] = -0.0
    sequence = SHEET.replace(vertices=values)
    assert np.signbit(values[values == 0]).any()
    assert_exact(sequence, meshreel.encode(sequence, lossless=True, order="keep"))


def test_values_that_share_a_coordinate_are_stored_without_the_grid():
    values = quantized().vertices.copy()
    values[0, 5] = np.nextafter(values[0, 5], np.float32(9))
    sequence = SHEET.replace(vertices=values)
    data = meshreel.encode(sequence, lossless=True, order="keep")
    assert Section.ROUNDING not in sections_of(data)
    assert_exact(sequence, data)


def test_doubles_that_text_rounded_are_exact_when_lossless():
    sequence = quantized(7, np.float64)
    assert_exact(sequence, meshreel.encode(sequence, lossless=True, order="keep"))


NONE, ZERO = np.zeros(0, np.int64), [np.zeros(1, np.int64)] * 3
TO_INFINITY = np.full(9, 2**30)
"""For values from 1."""


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("payload", "message"),
    [
        (
            write_varints(3601, 0, 0) + encode_integers([*ZERO, NONE, NONE, NONE]),
            "more rounded coordinates than positions",
        ),
        (write_varints(9, 0, 0) + encode_integers([*ZERO, TO_INFINITY, NONE, NONE]), "not finite"),
    ],
)
def test_invalid_rounding_is_refused(payload, message):
    stream = Stream(meshreel.encode(quantized(7), lossless=True, order="keep"))
    parts = [
        (section, payload if section is Section.ROUNDING else own)
        for section, own in parts_of(stream)
    ]
    with pytest.raises(CorruptStreamError, match=message):
        meshreel.decode(raw_stream(stream.header, parts))
