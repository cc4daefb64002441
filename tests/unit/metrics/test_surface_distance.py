"""Distances between surfaces, on shapes whose distances are known and against brute force."""

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.metrics import surface_distance
from meshreel.metrics.surface_distance import compare_surfaces
from meshreel.metrics.surface_samples import sample_uniformly, triangle_set
from samples.shapes import closest_by_brute_force, cube, split_at_centroids, square, torus

pytestmark = pytest.mark.usefixtures("few_grid_lines")


class Frames(list):
    """Frames (vertices, faces) of varying connectivity, as segments yield them."""

    @property
    def n_frames(self):
        return len(self)


def compare(original, decoded, **options):
    """The result for one frame, or for lists of frames."""
    several = [one if isinstance(one, list) else [one] for one in (original, decoded)]
    return compare_surfaces(*map(Frames, several), **{"n_samples": 2000, **options})


def rotated(shape, degrees):
    """Rotate a shape about the x axis through the center of the unit cube."""
    angle = np.radians(degrees)
    x, y, z = shape[0].T
    y, z = y - 0.5, z - 0.5
    back = y * np.cos(angle) - z * np.sin(angle), y * np.sin(angle) + z * np.cos(angle)
    return np.stack([x, back[0] + 0.5, back[1] + 0.5], axis=1), shape[1]


def figures(quality):
    return np.array([*vars(quality.to_decoded).values(), *vars(quality.to_original).values(),
                     quality.psnr_db, quality.d1_psnr_db, quality.d2_psnr_db])  # fmt: skip


def test_every_distance_of_a_translated_plane_is_its_shift():
    quality = compare(square(n=3), square(0.01, n=4))
    for way in (quality.to_decoded, quality.to_original):
        for distance in (way.mean_percent, way.rms_percent, way.p95_percent, way.max_percent):
            assert distance == pytest.approx(100 * 0.01 / np.sqrt(2), rel=1e-6)
        assert way.normal_angle_p95_deg == 0
    expected = 10 * np.log10(3 / 0.01**2)
    for psnr_db in (quality.psnr_db, quality.d1_psnr_db, quality.d2_psnr_db):
        assert psnr_db == pytest.approx(expected, rel=1e-9)
    assert (quality.diagonal, quality.longest_side) == (pytest.approx(np.sqrt(2)), 1)


def test_d2_ignores_shifts_along_the_surface_that_d1_counts():
    vertices, faces = square(n=2)
    quality = compare((vertices, faces), (vertices + np.array([0.25 / 63, 0, 0]), faces))
    assert quality.d2_psnr_db == np.inf
    assert 40 < quality.d1_psnr_db < 60


@pytest.mark.parametrize("degrees", [1e-4, 10, 80])
def test_normal_angle_of_a_tilted_plane_is_its_tilt(degrees):
    plane = square(0.5)
    way = compare(plane, rotated(plane, degrees)).worse
    assert way.normal_angle_mean_deg == pytest.approx(degrees, rel=1e-6)
    assert way.normal_angle_p95_deg == pytest.approx(degrees, rel=1e-6)


def test_rotated_cube_changes_the_normals_of_four_of_its_six_sides():
    way = compare(cube(), rotated(cube(), 1.0)).worse
    # Samples within 0.5 sin(1 degree) of the rotated edges meet the neighboring side.
    assert way.normal_angle_mean_deg == pytest.approx(4 / 6, abs=2 * np.sin(np.radians(1)) * 90)
    assert way.normal_angle_p95_deg == pytest.approx(1.0, rel=1e-6)


def test_reversed_faces_have_normal_angles_of_180_degrees():
    vertices, faces = cube()
    way = compare((vertices, faces), (vertices, faces[:, ::-1])).worse
    assert way.normal_angle_mean_deg == pytest.approx(180)
    assert way.max_percent == 0


def test_other_triangulations_of_a_surface_have_distance_zero():
    quality = compare(cube(), split_at_centroids(*cube()))
    assert quality.worse.max_percent == 0
    assert quality.worse.normal_angle_p95_deg == pytest.approx(0, abs=1e-6)
    assert {quality.psnr_db, quality.d1_psnr_db, quality.d2_psnr_db} == {np.inf}


@pytest.mark.slow
def test_figures_of_samples_equal_those_of_brute_force():
    shapes, n_samples = [torus(9, 15), torus(8, 17, bend=0.05)], 700
    sets = [triangle_set(vertices, faces, 1e-14) for vertices, faces in shapes]
    quality = compare(*shapes, n_samples=n_samples)
    diagonal = np.linalg.norm(np.ptp(shapes[0][0], axis=0))
    mean_squares = []
    for way, source, target in (
        (quality.to_decoded, sets[0], sets[1]), (quality.to_original, sets[1], sets[0])
    ):  # fmt: skip
        samples = sample_uniformly(source, n_samples)
        distances = closest_by_brute_force(samples.points, target.corners)
        least = distances.min(axis=1).astype(float)
        mean_squares.append(np.mean(least**2))
        at_vertices = closest_by_brute_force(source.vertices, target.corners).min(axis=1)
        cosines = np.sum(samples.normals * target.normals[distances.argmin(axis=1)], axis=1)
        angles = np.degrees(np.arccos(np.clip(cosines, -1, 1)))
        expected = [least.mean(), np.sqrt(np.mean(least**2)), np.percentile(least, 95),
                    max(least.max(), float(at_vertices.max()))]  # fmt: skip
        result = np.array(list(vars(way).values()))
        np.testing.assert_allclose(result[:4], 100 * np.array(expected) / diagonal, rtol=1e-5)
        assert way.normal_angle_mean_deg == pytest.approx(angles.mean(), rel=0.01)
    p = np.ptp(shapes[0][0], axis=0).max()
    assert quality.psnr_db == pytest.approx(10 * np.log10(3 * p**2 / max(mean_squares)), abs=1e-6)


@pytest.mark.parametrize(
    ("decoded", "n_lines", "d1", "d2"),
    [(torus(19, 37), 256, 61.9986, 63.6256), (torus(30, 40, bend=0.01), 256, 58.8898, 60.2460)],
)
def test_d1_and_d2_equal_those_of_the_mpeg_software(monkeypatch, decoded, n_lines, d1, d2):
    """Points by mpeg-pcc-mmetric 1.1.7 (grid, `useNormal`), PSNR by mpeg-pcc-dmetric 0.14.2.

    The latter with the normals of each cloud (`normalCalcModificationEnable`), as in V-DMC.
    """
    monkeypatch.setattr(surface_distance, "GRID_LINES", n_lines)
    shapes = [(vertices.astype(np.float32), faces) for vertices, faces in (torus(), decoded)]
    quality = compare(*shapes, n_samples=1)
    assert quality.n_grid_lines == n_lines
    assert (quality.d1_psnr_db, quality.d2_psnr_db) == pytest.approx((d1, d2), abs=0.005)


@pytest.mark.slow
@pytest.mark.parametrize(("scale", "shift"), [(1, 1e6), (1e-30, 0), (1e200, 0), (1e5, 1e9)])
def test_figures_are_invariant_to_scale_and_translation(scale, shift):
    shapes = torus(9, 15), torus(9, 16, bend=0.02)
    moved = [(scale * vertices + shift, faces) for vertices, faces in shapes]
    # Normals vary more: where a closest point lies on an edge, rounding chooses the face.
    tolerances = np.full(15, 1e-3)
    tolerances[[4, 5, 10, 11]] = 0.02
    expected = figures(compare(*shapes))
    assert (np.abs(figures(compare(*moved)) - expected) <= tolerances * expected).all()


def test_isolated_vertices_and_faces_without_area_are_ignored():
    vertices, faces = torus(9, 15)
    more = np.concatenate([vertices, [[1e6, 0, 0]]])
    degenerate = np.concatenate([faces, [[0, 0, 7], [3, 4, 4]]]).astype(np.int32)
    other = torus(9, 16)
    quality = compare((more, degenerate), other)
    np.testing.assert_array_equal(figures(quality), figures(compare((vertices, faces), other)))
    assert quality.n_degenerate_face_frames == 2


def test_single_triangles_can_be_compared():
    triangle = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]], np.int32)
    quality = compare(triangle, (triangle[0] + np.array([0, 0, 0.1]), triangle[1]), n_samples=1)
    assert quality.worse.max_percent == pytest.approx(10 / np.sqrt(2))


def test_largest_distance_includes_vertices_between_the_samples():
    vertices, faces = square(n=20)
    spiked = vertices.copy()
    spiked[190, 2] = 0.5
    for pair, diagonal in (((vertices, spiked), 2**0.5), ((spiked, vertices), 1.5)):
        quality = compare(*((some, faces) for some in pair), n_samples=3)
        assert quality.worse.max_percent == pytest.approx(100 * 0.5 / diagonal)


@pytest.mark.slow
def test_sampling_error_of_the_default_is_below_half_a_percent():
    shapes = torus(), torus(30, 40, bend=0.01)
    few, many = (compare(*shapes, n_samples=n).worse for n in (surface_distance.N_SAMPLES, 200_000))
    assert few.mean_percent == pytest.approx(many.mean_percent, rel=1e-3)
    assert few.p95_percent == pytest.approx(many.p95_percent, rel=5e-3)
    assert few.normal_angle_mean_deg == pytest.approx(many.normal_angle_mean_deg, rel=5e-3)


def test_connectivity_may_change_from_frame_to_frame():
    original = [square(n=2), cube(), square(n=4)]
    decoded = [square(0.1, n=5), split_at_centroids(*cube()), square(0.3, n=3)]
    quality = compare(original, decoded)
    assert quality.n_frames == 3
    expected = 100 * np.array([0.1, 0, 0.3]) / np.sqrt(3)
    np.testing.assert_allclose(quality.mean_percent_of_frames, expected, atol=1e-9)
    np.testing.assert_allclose(quality.max_percent_of_frames, expected, atol=1e-9)
    assert quality.to_decoded.mean_percent == pytest.approx(expected.mean())
    # The frame without a difference has no PSNR and does not enter the mean.
    levels = [10 * np.log10(3 / height**2) for height in (0.1, 0.3)]
    assert quality.psnr_db == pytest.approx(np.mean(levels))


@pytest.mark.slow
def test_figures_do_not_depend_on_the_number_of_threads(monkeypatch):
    original = [torus(6, n) for n in (8, 9, 10, 11, 12)]
    decoded = [torus(7, n, bend=0.01) for n in (9, 8, 12, 10, 11)]
    results = []
    for n_cores in (1, 4):
        monkeypatch.setattr(surface_distance, "n_cores", lambda n_cores=n_cores: n_cores)
        results.append(figures(compare(original, decoded, n_samples=300)))
    np.testing.assert_array_equal(*results)


@pytest.mark.slow
def test_quantiles_hardly_change_when_samples_of_many_frames_are_thinned(monkeypatch):
    shapes = [torus(9, 15)] * 4, [torus(9, 15, bend=0.02)] * 4
    whole = compare(*shapes).to_decoded
    monkeypatch.setattr(surface_distance, "MAX_POOLED", 2000)
    thinned = compare(*shapes).to_decoded
    assert thinned.p95_percent == pytest.approx(whole.p95_percent, rel=0.02)
    assert thinned.mean_percent == whole.mean_percent


def test_grid_is_coarser_for_very_large_surfaces(monkeypatch):
    monkeypatch.setattr(surface_distance, "MAX_GRID_POINTS", 6_000)
    quality = compare(cube(), rotated(cube(), 1))
    assert quality.n_grid_lines == 32  # 64 lines would meet it in more than 6 * 63**2 points
    assert quality.d1_psnr_db < np.inf


def test_error_names_a_frame_without_area():
    flat = square()[0], np.array([[0, 1, 1]], np.int32)
    with pytest.raises(InvalidInputError, match="frame 1 of the decoded has no face with an area"):
        compare([square(), square()], [square(), flat])
    with pytest.raises(InvalidInputError, match="frame 0 of the original has no face with an area"):
        compare(flat, square())
    point = np.ones((3, 3)), np.array([[0, 1, 2]], np.int32)
    with pytest.raises(InvalidInputError, match="frame 0 of the original has no face"):
        compare(point, square())


def test_surface_too_far_from_the_origin_is_rejected():
    far = square()[0] + 1e200, square()[1]
    with pytest.raises(InvalidInputError, match="frame 0 of the decoded is farther"):
        compare(square(), far)


def test_different_frame_counts_are_rejected():
    with pytest.raises(InvalidInputError, match="1 frame and the decoded 2"):
        compare(square(), [square(), square()])


def test_sample_count_must_be_positive():
    with pytest.raises(InvalidInputError, match="at least 1; got 0"):
        compare(square(), square(), n_samples=0)
