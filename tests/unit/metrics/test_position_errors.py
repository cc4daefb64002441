import math
import tracemalloc

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.metrics.normals import normal_angles
from meshreel.metrics.position_errors import ErrorSums, PositionErrors, add_blocks, position_errors
from meshreel.metrics.reference import bounding_box_reference, reference_of_extent
from meshreel.model.extent import Extent
from meshreel.model.sequence import MeshSequence
from meshreel.operations.save import save
from samples.opening import open_source

FACES = np.array([[0, 1, 2]])

# Two frames of two vertices; the box of both frames together is 3 x 4 x 12, its diagonal 13.
ORIGINAL = np.array([[[0.0, 0, 0], [3, 0, 0]], [[0, 4, 0], [0, 0, 12]]])


def kg_error_percent(original, decoded):
    return position_errors(original, decoded).kg_error_percent


def errors_of_blocks(original, decoded, *cuts):
    """Return the errors of decoded frames that are added in blocks."""
    sums = ErrorSums(reference_of_extent(original.extent))
    add_blocks(sums, original, np.split(decoded, cuts))
    return sums.errors


def test_kg_is_the_ratio_of_error_and_spread():
    # Two vertices at x = -1 and 1: ||G - E(G)||^2 = 2. Both shifted by 0.1: error^2 = 0.02.
    # 100 sqrt(0.02 / 2) = 10.
    original = np.array([[[-1.0, 0, 0], [1, 0, 0]]])
    assert kg_error_percent(original, original + np.array([0, 0.1, 0])) == pytest.approx(
        10, rel=1e-12
    )


def test_kg_pools_all_frames():
    # Spread^2 = 2 + 8 = 10; the second frame's vertices are 0.3 and 0.1 off: error^2 = 0.1.
    # 100 sqrt(0.1 / 10) = 10.
    original = np.array([[[-1.0, 0, 0], [1, 0, 0]], [[3, 0, 0], [7, 0, 0]]])
    decoded = original.copy()
    decoded[1] += [[0, 0, 0.3], [0.1, 0, 0]]
    assert kg_error_percent(original, decoded) == pytest.approx(10, rel=1e-12)


def test_kg_centers_each_frame(soup):
    original, decoded, _ = soup
    path = np.arange(len(original))[:, None, None] * np.array([7.0, -3, 2])
    moved = kg_error_percent(original + path, decoded + path)
    assert moved == pytest.approx(kg_error_percent(original, decoded), rel=1e-12)


def test_kg_is_precise_for_errors_below_the_rounding_of_centered_positions():
    # Error 2^-60 at the vertex at the origin, which float64 holds; spread^2 = 2.
    original = np.array([[[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]])
    decoded = original.copy()
    decoded[0, 0, 1] = 2.0**-60
    expected = 100 * 2.0**-60 / np.sqrt(2)
    assert kg_error_percent(original, decoded) == pytest.approx(expected, rel=1e-12)


def test_kg_of_changed_coincident_vertices_is_infinite():
    original = np.full((3, 7, 3), 0.1) + np.arange(3)[:, None, None]
    decoded = original.copy()
    decoded[1, 2, 0] += 1
    assert kg_error_percent(original, decoded) == np.inf


@pytest.mark.parametrize("shape", [(0, 4, 3), (2, 0, 3)])
def test_empty_arrays_are_rejected(shape):
    with pytest.raises(InvalidInputError, match="at least one frame and one vertex"):
        kg_error_percent(np.zeros(shape), np.zeros(shape))


def test_displacement_is_in_percent_of_the_whole_diagonal():
    decoded = ORIGINAL.copy()
    decoded[1, 0] += [0.3, 0, 0.4]  # 0.5 long: 100 * 0.5 / 13; RMS sqrt(0.25 / 4) = 0.25
    errors = position_errors(ORIGINAL, decoded)
    assert errors.max_error_percent == pytest.approx(50 / 13, rel=1e-12)
    assert errors.rms_error_percent == pytest.approx(25 / 13, rel=1e-12)


@pytest.mark.parametrize("scale", [1e-300, 1e-6, 1.0, 1e100, 1e300])
def test_reference_diagonal_scales_with_the_box(scale):
    diagonal = bounding_box_reference(ORIGINAL * scale).diagonal
    assert diagonal == pytest.approx(13 * scale, rel=1e-14)


@pytest.mark.parametrize("cuts", [[], [1], [5, 5, 6, 13]])
@pytest.mark.parametrize(
    ("scale", "offset", "dtype"),
    [
        (1, 0, np.float64),
        (1, 0, np.float32),
        (1e-6, 1e3, np.float64),
        (1, 2.0**30, np.float64),
        (2.0**-900, 0, np.float64),
        (2.0**900, 0, np.float64),
        (1e-30, 0, np.float32),
    ],
)
def test_errors_of_blocks_equal_those_of_the_whole(soup, cuts, scale, offset, dtype):
    original, decoded = ((part * scale + offset).astype(dtype) for part in soup[:2])
    result = errors_of_blocks(MeshSequence(original, FACES), decoded, *cuts)
    assert result == position_errors(original, decoded)
    assert result.kg_error_percent > 0


def test_errors_of_blocks_of_equal_sequences_are_exactly_zero(soup):
    result = errors_of_blocks(MeshSequence(soup[0], FACES), soup[0].copy(), 4)
    assert result == PositionErrors(0, 0, 0)


@pytest.mark.parametrize(("moved_x", "expected"), [(0.0, 0.0), (1.0, np.inf)])
def test_errors_of_blocks_of_a_single_point_are_zero_or_infinite(moved_x, expected):
    decoded = np.full((3, 4, 3), 0.1)
    original = decoded.copy()
    decoded[2, 1, 0] += moved_x
    result = errors_of_blocks(MeshSequence(original, FACES), decoded, 1)
    assert result == PositionErrors(expected, expected, expected)


def test_errors_of_blocks_beyond_float64_are_infinite(soup):
    decoded = soup[1].copy()
    decoded[5, 0, 0] = 1e300
    result = errors_of_blocks(MeshSequence(soup[0], FACES), decoded, 5)
    assert result == PositionErrors(np.inf, np.inf, np.inf)


def test_errors_of_blocks_of_an_original_in_files_equal_those_of_the_whole(tmp_path, soup):
    original, decoded, faces = soup
    sequence = MeshSequence(original + 1e6, faces)
    save(sequence, tmp_path / "f_%d.ply")
    result = errors_of_blocks(open_source(tmp_path), decoded + 1e6, 4)
    assert result == position_errors(sequence.vertices, decoded + 1e6)


def test_error_sums_use_the_diagonal_of_the_whole(soup):
    original, decoded, _ = soup
    sums = ErrorSums(bounding_box_reference(original))
    sums.add(original[:1], decoded[:1])
    own = position_errors(original[:1], decoded[:1]).max_error_percent
    sides = [np.linalg.norm(np.ptp(part, axis=(0, 1))) for part in (original[:1], original)]
    assert sums.errors.max_error_percent == pytest.approx(own * sides[0] / sides[1], rel=1e-12)


def test_blocks_of_another_shape_are_rejected(soup):
    sums = ErrorSums(bounding_box_reference(soup[0]))
    with pytest.raises(InvalidInputError, match=r"\(14, 12, 3\) and \(14, 11, 3\)"):
        sums.add(soup[0], soup[1][:, :11])
    with pytest.raises(InvalidInputError, match=r"\(14, 12, 2\) and \(14, 12, 2\)"):
        sums.add(soup[0][..., :2], soup[1][..., :2])


def test_error_sums_without_frames_are_rejected(soup):
    with pytest.raises(InvalidInputError, match="needs at least one frame"):
        _ = ErrorSums(bounding_box_reference(soup[0])).errors


@pytest.mark.parametrize("n_decoded", [0, 5, 15])
def test_blocks_are_rejected_when_their_frames_are_not_as_many_as_the_original(soup, n_decoded):
    original, decoded, _ = soup
    decoded = np.concatenate([decoded, decoded])[:n_decoded]
    with pytest.raises(InvalidInputError, match=f"{n_decoded} frames|same shape"):
        errors_of_blocks(MeshSequence(original, FACES), decoded)


class Turning:
    """A source that generates its frames when they are read."""

    n_frames, n_verts, faces, fps, name = 300, 2000, FACES, 0.0, ""
    dtype = np.dtype(np.float32)
    extent = Extent(np.zeros(3), np.full(3, 299.0), 0.0)

    def read(self, start, stop):
        frames = np.arange(start, stop, dtype=np.float32)[:, None, None]
        return frames * np.linspace(0, 1, 6000, dtype=np.float32).reshape(1, 2000, 3)


def test_small_blocks_need_a_tenth_of_the_memory():
    source = Turning()
    tracemalloc.start()
    try:
        sums = ErrorSums(reference_of_extent(source.extent))
        add_blocks(sums, source, (source.read(start, start + 5) for start in range(0, 300, 5)))
        assert tracemalloc.get_traced_memory()[1] < 300 * 2000 * 12 / 10
    finally:
        tracemalloc.stop()


FLAT = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])  # normal +z
TRIANGLE = np.array([[0, 1, 2]], np.int32)


def hinge(y, z):
    """FLAT with the third corner at (0, y, z); its normal is (0, -z, y)."""
    decoded = FLAT.copy()
    decoded[0, 2] = [0, y, z]
    return decoded


@pytest.mark.parametrize(
    ("y", "z", "angle_deg"), [(0, 1, 90), (1, 1, 45), (-1, 0, 180), (1, -1, 45), (-1, 1, 135)]
)
def test_normal_angle_of_a_tilted_face_is_that_of_the_hinge(y, z, angle_deg):
    assert normal_angles(FLAT, hinge(y, z), TRIANGLE).mean_deg == pytest.approx(angle_deg)


def test_tiny_normal_angles_are_precise():
    result = normal_angles(FLAT, hinge(1, 1e-12), TRIANGLE).mean_deg
    assert result == pytest.approx(math.degrees(1e-12), rel=1e-9)


def test_mean_and_percentile_weight_frames_equally():
    # Angles 0 and 90: mean 45; the 95th percentile lies 0.95 of the way from 0 to 90.
    original, decoded = np.repeat(FLAT, 2, axis=0), np.concatenate([FLAT, hinge(0, 1)])
    result = normal_angles(original, decoded, TRIANGLE)
    assert (result.mean_deg, result.p95_deg) == pytest.approx((45, 85.5))


def test_degenerate_faces_are_omitted_and_counted():
    # Frame 0 sound in both; frame 1 flat to a line in the original, frame 2 in the decoded.
    original = np.concatenate([FLAT, hinge(0, 0), FLAT])
    decoded = np.concatenate([hinge(1, 1), FLAT, hinge(0, 0)])
    result = normal_angles(original, decoded, TRIANGLE)
    assert result.n_degenerate_face_frames == 2
    assert result.mean_deg == pytest.approx(45)


def test_angles_of_only_degenerate_faces_are_zero():
    result = normal_angles(hinge(0, 0), hinge(0, 0), np.array([[0, 1, 2], [0, 0, 1]], np.int32))
    assert (result.mean_deg, result.p95_deg, result.n_degenerate_face_frames) == (0, 0, 2)


@pytest.mark.parametrize(("height", "n_degenerate"), [(1.9e-14, 1), (2.1e-14, 0)])
@pytest.mark.parametrize("scale", [1.0, 1.5])
def test_degeneracy_is_relative_to_the_diagonal(height, n_degenerate, scale):
    # Area height / 2 against 1e-14 of diag^2 = 1, and so at any scale.
    thin = scale * hinge(height, 0)
    assert normal_angles(thin, thin, TRIANGLE).n_degenerate_face_frames == n_degenerate


def test_degeneracy_is_relative_to_the_original():
    thin = np.concatenate([hinge(1e-10, 0), [[[1.0, 0, 0]]]], axis=1)
    larger = thin.copy()
    larger[0, 3] = 1e6
    assert normal_angles(thin, larger, TRIANGLE).n_degenerate_face_frames == 0
    assert normal_angles(larger, thin, TRIANGLE).n_degenerate_face_frames == 1


def test_faces_beyond_float64_are_counted_as_degenerate():
    assert normal_angles(FLAT, 1e300 * FLAT, TRIANGLE).n_degenerate_face_frames == 1
