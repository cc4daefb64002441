"""The shape of the texture that holds slices of numbers of vertices."""

import pytest

from meshreel.errors import InvalidInputError
from meshreel.formats.vat.pca.texture import N_HEADER, ROOMY, SIDES, _fit


def area(n_verts, n_before, n_slices, slice_rows):
    """Width, height and number of texels with slices of `slice_rows` rows."""
    width = max(-(-n_verts // slice_rows), N_HEADER)
    height = -(-n_before // width) + n_slices * slice_rows
    return width, height, width * height


@pytest.mark.parametrize(
    ("n_verts", "n_before", "n_slices"), [(1000, 100, 4), (5000, 2000, 9), (20, 3, 2), (90, 5, 40)]
)
def test_texture_is_nearly_square_and_nearly_the_smallest(n_verts, n_before, n_slices):
    width, slice_rows = _fit(n_verts, n_before, n_slices)
    found = area(n_verts, n_before, n_slices, slice_rows)
    every = [area(n_verts, n_before, n_slices, rows) for rows in range(1, n_verts + 1)]
    every = [one for one in every if max(one[:2]) <= SIDES[0]]
    assert found[0] == width
    assert found[2] <= ROOMY * min(one[2] for one in every)
    assert max(found[:2]) <= 2 * min(max(one[:2]) for one in every)


def test_texture_is_refused_when_it_has_more_texels_than_any_may_have():
    with pytest.raises(InvalidInputError, match=f"more than {SIDES[-1]} texels a side"):
        _fit(SIDES[-1] ** 2, 0, 2)
