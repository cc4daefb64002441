from io import BytesIO

import numpy as np
import pytest

import meshreel
from meshreel.codec.achieved import measure_uvs
from meshreel.errors import InvalidInputError
from meshreel.model.surface import Attribute, Domain, Kind, Surface
from samples.meshes import two_sheets, waving_grid
from samples.streams import recorded


def grid_with_uvs(values):
    """A grid of 99 vertices with texture coordinates."""
    given = np.asarray(values)
    return waving_grid().replace(
        surface=Surface(None, (Attribute("uv", Kind.UV, Domain.VERTEX, given),))
    )


def random_uvs(dtype=np.float32, tiles=1):
    return (tiles * np.random.default_rng(3).random((99, 2))).astype(dtype)


def decoded_uvs(sequence, **options):
    decoded = meshreel.decode(meshreel.encode(sequence, **options))
    return decoded.surface.of_kind(Kind.UV)[0]


@pytest.mark.parametrize("bits", [4, 11, 12, 24])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("tiles", [1, -7.5])
def test_quantized_coordinates_are_within_half_a_step(bits, dtype, tiles):
    given = random_uvs(dtype, tiles)
    result = decoded_uvs(grid_with_uvs(given), uv_bits=bits)
    assert result.values.dtype == dtype
    assert np.abs(result.values.astype(float) - given).max() <= 2.0 ** -(bits + 1)


def test_borders_of_tiles_are_preserved_by_quantization():
    given = np.tile(np.array([[0, 1], [1, 3], [-2, 10.25]], np.float32), (33, 1))
    np.testing.assert_array_equal(decoded_uvs(grid_with_uvs(given), uv_bits=4).values, given)


def test_quantization_is_idempotent():
    first = meshreel.encode(grid_with_uvs(random_uvs()), uv_bits=9)
    second = meshreel.encode(meshreel.decode(first), uv_bits=9)
    result, again = (meshreel.decode(data).surface.attributes[0].values for data in (first, second))
    np.testing.assert_array_equal(result, again)


def test_seams_are_preserved_by_quantization():
    given = two_sheets().surface.of_kind(Kind.UV)[0]
    np.testing.assert_array_equal(decoded_uvs(two_sheets(), uv_bits=8).indices, given.indices)


def test_other_attributes_are_lossless():
    decoded = meshreel.decode(meshreel.encode(two_sheets(), uv_bits=4))
    result, given = (one.surface.of_kind(Kind.COLOR)[0].values for one in (decoded, two_sheets()))
    np.testing.assert_array_equal(result, given)


@pytest.mark.parametrize("order", ["keep", "vertices", "drop"])
def test_measured_error_is_that_of_the_grid_for_every_order(order):
    sequence = grid_with_uvs(random_uvs())
    given = sequence.surface.attributes[0].values.astype(float)
    expected = np.abs(np.rint(given * 2**10) / 2**10 - given).max()
    measured = measure_uvs(sequence, meshreel.encode(sequence, uv_bits=10, order=order))
    assert measured == expected


@pytest.mark.parametrize("order", ["vertices", "drop"])
def test_error_is_measured_when_the_order_of_faces_is_lost(order):
    data = meshreel.encode(two_sheets(), order=order, uv_bits=9)
    assert 0 < measure_uvs(two_sheets(), data) <= 0.5 / 2**9


@pytest.mark.parametrize("bits", [3, 25, 8.5])
def test_encode_refuses_bits_out_of_range(bits):
    with pytest.raises(InvalidInputError, match=r"uv_bits must be 4\.\.24"):
        meshreel.encode(two_sheets(), uv_bits=bits)


@pytest.mark.parametrize("attributes", ["none", "color"])
def test_encode_refuses_bits_without_coordinates(attributes):
    with pytest.raises(InvalidInputError, match="no texture coordinates"):
        meshreel.encode(two_sheets(), uv_bits=12, attributes=attributes)


@pytest.mark.parametrize(
    ("bits", "value", "words"),
    [
        (24, 1000, "24 bits reach to 32; use fewer bits"),
        (12, np.nan, "in row 5, which cannot be quantized"),
    ],
)
def test_encode_refuses_bits_for_far_and_non_finite_coordinates(bits, value, words):
    given = random_uvs()
    given[5, 1] = value
    with pytest.raises(InvalidInputError, match=words):
        meshreel.encode(grid_with_uvs(given), uv_bits=bits)


def test_live_encoder_quantizes_coordinates():
    given = random_uvs()
    data = recorded(grid_with_uvs(given), uv_bits=10)
    (result,) = meshreel.decode(data).surface.attributes
    np.testing.assert_array_equal(result.values, np.rint(given * 1024) / 1024)


def test_live_encoder_refuses_bits_without_coordinates_or_for_later_ones_that_are_too_far():
    with pytest.raises(InvalidInputError, match="no texture coordinates"):
        recorded(waving_grid(), uv_bits=10)
    near, far = (grid_with_uvs(1000.0**power * random_uvs()) for power in range(2))
    with meshreel.Encoder(near.faces, BytesIO(), surface=near.surface, uv_bits=24) as encoder:
        encoder.push(near.vertices[0])
        with pytest.raises(InvalidInputError, match="24 bits reach to 32"):
            encoder.push(far.vertices[0], faces=far.faces[::-1], surface=far.surface)


def test_encode_keeps_only_selected_attributes():
    decoded = meshreel.decode(meshreel.encode(two_sheets(), attributes="color"))
    assert [attribute.name for attribute in decoded.surface.attributes] == ["color"]
    assert decoded.surface.groups == ()
