"""The texture of PCA textures, texel by texel."""

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.formats.vat.pca.digits import Fields, largest_integer, rows_of
from meshreel.formats.vat.pca.texture import (
    SIDES,
    bytes_to_weights,
    make_texture,
    read_header,
    section_offsets,
    texel_places,
    weights_to_bytes,
)


def rows_of_random(seed, n_verts, n_frames, n_digits):
    rng = np.random.default_rng(seed)
    n_digits = np.array(n_digits)
    largest = largest_integer(n_digits)[:, None]
    integers = rng.integers(-largest, largest + 1, (len(n_digits), 3 * n_verts)).astype(np.int32)
    weights = rng.normal(size=(n_frames, len(n_digits))) / largest[:, 0]
    fields = Fields(integers, weights.astype(np.float32), n_digits)
    return rows_of(fields), (fields.weights.astype(np.float64) @ integers).reshape(n_frames, -1, 3)


@pytest.mark.parametrize("n_verts", [1, 7, 8, 9, 2049])
def test_offsets_are_those_of_the_fields_at_every_count_of_vertices(n_verts):
    positions, moved = rows_of_random(1, n_verts, 5, [3, 2, 2, 2, 2, 1, 1])
    normals, turned = rows_of_random(2, n_verts, 5, [1, 1, 2])
    texels = make_texture(positions, normals, n_verts)
    header = read_header(texels)
    for section, expected in ((header.positions, moved), (header.normals, turned)):
        offsets = section_offsets(texels, header, section, n_verts)
        found = np.stack([offsets.frame(number) for number in range(5)])
        np.testing.assert_allclose(found, expected, atol=2e-6)


def test_no_alpha_is_zero_for_programs_change_colours_of_transparent_pixels():
    positions, _ = rows_of_random(3, 40, 6, [4, 3, 2, 1])
    still = positions.weights.copy()
    still[:] = 0
    texels = make_texture(type(positions)(positions.pairs, positions.singles, still), None, 40)
    assert texels[..., 3].min() > 0


def test_a_texture_without_fields_says_so_and_moves_nothing():
    none = rows_of(
        Fields(np.zeros((0, 30), np.int32), np.zeros((4, 0), np.float32), np.zeros(0, int))
    )
    texels = make_texture(none, None, 10)
    header = read_header(texels)
    assert (header.n_frames, header.positions.n_slices, header.normals.n_slices) == (4, 0, 0)
    assert not section_offsets(texels, header, header.positions, 10).frame(3).any()


def test_places_lead_to_the_texel_of_a_vertex():
    positions, _ = rows_of_random(4, 100, 3, [2, 2, 2, 2])
    texels = make_texture(positions, None, 100)
    header = read_header(texels)
    column, row = texel_places(texels, 100).T
    [first] = texels[header.positions.first_row + row, column, 0][None]
    upper, lower = positions.pairs[0][:, 0::3].astype(int)
    assert (first == 16 * (upper + 8) + lower + 8).all()
    assert row.max() < header.slice_rows


@pytest.mark.parametrize("value", [0.0, 1.0, -1.5, 3.3e-30, -7.7e20])
def test_weights_come_back_but_for_the_lowest_bit(value):
    weights = np.array([value], np.float32)
    found = bytes_to_weights(weights_to_bytes(weights))
    assert np.abs(found - weights) <= np.abs(weights) * 2.0**-23 + 1e-44


def test_a_texture_larger_than_gpus_hold_is_refused():
    none = rows_of(Fields(np.zeros((1, 3), np.int32), np.ones((2, 1), np.float32), np.array([1])))
    with pytest.raises(InvalidInputError, match=f"more than {SIDES[-1]} texels a side"):
        make_texture(none, None, SIDES[-1] ** 2)
