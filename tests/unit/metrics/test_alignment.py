"""Alignment of two sequences that differ in axes, scale and position."""

from itertools import permutations, product

import numpy as np
import pytest

from meshreel.metrics.alignment import Alignment, find_alignment
from samples.meshes import irregular_sequence

ORIGINAL = irregular_sequence()


def changed(order=(0, 1, 2), signs=(1, 1, 1), scale=1.0, shift=(0, 0, 0), noise=0.0):
    rng = np.random.default_rng(1)
    vertices = scale * np.array(signs) * ORIGINAL.vertices.astype(np.float64)[..., list(order)]
    size = np.ptp(vertices)
    vertices += np.array(shift) + noise * size * rng.standard_normal(vertices.shape)
    return ORIGINAL.replace(vertices=vertices)


@pytest.mark.parametrize("order", list(permutations(range(3))))
@pytest.mark.parametrize("signs", list(product((1, -1), repeat=3)))
def test_alignment_finds_permuted_axes(order, signs):
    alignment = find_alignment(ORIGINAL, changed(order, signs, noise=1e-4))
    if (order, signs) == ((0, 1, 2), (1, 1, 1)):
        assert alignment is None
        return
    expected = ["-" * (sign < 0) + "xyz"[axis] for axis, sign in zip(order, signs, strict=True)]
    assert list(alignment.axes) == expected
    assert alignment.scale == pytest.approx(1, rel=1e-3)
    matrix = np.zeros((3, 3))
    matrix[range(3), order] = signs
    assert alignment.is_mirrored == (np.linalg.det(matrix) < 0)


def test_alignment_finds_scale_and_shift():
    alignment = find_alignment(ORIGINAL, changed(scale=100.0, shift=(500, 0, -20)))
    assert alignment.axes == ("x", "y", "z")
    assert alignment.scale == pytest.approx(100, rel=1e-6)
    np.testing.assert_allclose(alignment.shift, (500, 0, -20), atol=1e-3)
    assert "it is 100 times as large; it is shifted by (500, " in str(alignment)


def test_message_names_the_conversion_from_y_up_to_z_up():
    message = str(find_alignment(ORIGINAL, changed((0, 2, 1), (1, -1, 1))))
    assert "its x, y, z are x, -z, y of the original (y-up to z-up)" in message


@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_alignment_of_similar_sequences_is_none(noise):
    assert find_alignment(ORIGINAL, changed(noise=noise)) is None


def disturbed(order, signs, share):
    """Permuted axes plus noise, whose RMS is a share of the RMS of the centered positions."""
    vertices = np.array(signs) * ORIGINAL.vertices.astype(np.float64)[..., list(order)]
    size = np.sqrt(np.mean((vertices - vertices.mean(axis=(0, 1))) ** 2))
    noise = np.random.default_rng(1).standard_normal(vertices.shape)
    return ORIGINAL.replace(vertices=vertices + share * size * noise)


@pytest.mark.parametrize("share", [0.01, 0.08])
def test_residual_is_in_percent_of_the_size(share):
    alignment = find_alignment(ORIGINAL, disturbed((0, 2, 1), (1, -1, 1), share))
    assert alignment.residual_percent == pytest.approx(100 * share, rel=0.05)


@pytest.mark.parametrize(
    ("order", "signs", "share"),
    [
        ((0, 2, 1), (1, -1, 1), 0.12),  # a tenth of the size
        ((1, 2, 0), (1, 1, 1), 0.08),  # a tenth of the difference, which is 0.7 of the size
    ],
)
def test_alignment_with_a_residual_above_a_tenth_is_none(order, signs, share):
    assert find_alignment(ORIGINAL, disturbed(order, signs, share)) is None


@pytest.mark.parametrize(("share", "is_found"), [(0.018, False), (0.022, True)])
def test_alignment_finds_shifts_above_the_threshold(share, is_found):
    vertices = ORIGINAL.vertices.astype(np.float64)
    size = np.sqrt(np.mean(np.sum((vertices - vertices.mean(axis=(0, 1))) ** 2, axis=2)))
    moved = ORIGINAL.replace(vertices=vertices + np.array([share * size, 0, 0]))
    alignment = find_alignment(ORIGINAL, moved)
    assert (alignment is not None) == is_found
    if alignment is not None:
        assert alignment.shift[0] == pytest.approx(share * size, rel=1e-3)


@pytest.mark.parametrize(
    ("axes", "scale", "shift", "phrase"),
    [
        (("x", "z", "-y"), 1.0, (0, 0, 0), "(z-up to y-up); after"),
        (("y", "x", "z"), 1.0, (0, 0, 0), "y, x, z of the original (mirrored); after"),
        (("y", "z", "x"), 1.0, (0, 0, 0), "y, z, x of the original (rotated); after"),
        (("x", "y", "z"), 1.0019, (0, 0.5, 0), "position: it is shifted by (0, 0.5, 0); after"),
        (("x", "y", "z"), 0.9979, (0, 0, 0), "position: it is 0.9979 times as large; after"),
        (("x", "y", "z"), 2.0, (0, 0, 0), "after alignment 0.12 % of the size (RMS) remain"),
    ],
)
def test_message_lists_only_significant_changes(axes, scale, shift, phrase):
    assert phrase in str(Alignment(axes, scale, shift, 0.123))


def test_axis_without_extent_keeps_its_sign():
    vertices = ORIGINAL.vertices.astype(np.float64)[..., [1, 0, 2]]
    rounding = 1e-12 * vertices[..., :1]
    flat = np.concatenate([vertices[..., :2], rounding], axis=2)
    larger = 2 * flat * [1, 1, -1]
    alignment = find_alignment(ORIGINAL.replace(vertices=flat), ORIGINAL.replace(vertices=larger))
    assert alignment.axes == ("x", "y", "z")


def test_alignment_of_unrelated_sequences_is_none():
    assert find_alignment(ORIGINAL, changed(noise=0.5)) is None
    point = ORIGINAL.replace(vertices=np.zeros_like(ORIGINAL.vertices))
    assert find_alignment(ORIGINAL, point) is None
    assert find_alignment(point, ORIGINAL) is None


def test_alignment_finds_the_axes_of_huge_coordinates():
    far = ORIGINAL.replace(vertices=ORIGINAL.vertices.astype(np.float64) * 1e200)
    turned = far.replace(vertices=far.vertices[..., [1, 2, 0]])
    assert find_alignment(far, turned).axes == ("y", "z", "x")
