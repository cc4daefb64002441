"""Dimensions of PCA textures."""

import pytest

from meshreel.errors import InvalidInputError
from meshreel.formats.vat.pca.texture import MAX_AREA_RATIO, N_HEADER, SIDES, choose_size


def dimensions(n_verts, n_before, n_slices, slice_rows):
    """Return width, height and number of texels with slices of `slice_rows` rows."""
    width = max(-(-n_verts // slice_rows), N_HEADER)
    height = -(-n_before // width) + n_slices * slice_rows
    return width, height, width * height


@pytest.mark.parametrize(
    ("n_verts", "n_before", "n_slices"), [(1000, 100, 4), (5000, 2000, 9), (20, 3, 2), (90, 5, 40)]
)
def test_texture_is_nearly_square_and_nearly_the_smallest(n_verts, n_before, n_slices):
    width, slice_rows = choose_size(n_verts, n_before, n_slices)
    found = dimensions(n_verts, n_before, n_slices, slice_rows)
    candidates = [dimensions(n_verts, n_before, n_slices, rows) for rows in range(1, n_verts + 1)]
    candidates = [one for one in candidates if max(one[:2]) <= SIDES[0]]
    assert found[0] == width
    assert found[2] <= MAX_AREA_RATIO * min(one[2] for one in candidates)
    assert max(found[:2]) <= 2 * min(max(one[:2]) for one in candidates)


def test_texture_beyond_the_size_limit_is_rejected():
    with pytest.raises(InvalidInputError, match=f"more than {SIDES[-1]} texels per side"):
        choose_size(SIDES[-1] ** 2, 0, 2)
