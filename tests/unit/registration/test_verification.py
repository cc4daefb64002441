"""Errors of registered frames, on surfaces whose distance is known."""

import numpy as np
import pytest

from meshreel.registration.triangle_mesh import TriangleMesh
from meshreel.registration.verification import Tolerance, largest_patch, measure
from samples.captures import capsule
from samples.shapes import square


def plane(height=0.0, n=21):
    return TriangleMesh(*square(height, n))


def test_distances_of_parallel_planes_are_their_offset():
    errors = measure(plane(0.01), plane(), Tolerance(0.02))
    figures = [errors.mean, errors.p95, errors.p99, errors.largest, errors.mean_square**0.5]
    assert figures == pytest.approx([0.01] * 5)
    assert errors.patch_area == 0
    assert not errors.exceeds(Tolerance(0.02))


def test_a_surface_beyond_the_tolerance_is_told_by_its_distance():
    errors = measure(plane(0.01), plane(), Tolerance(0.005))
    assert errors.patch_area == pytest.approx(1.0)
    assert "farther than 2 tolerances" in errors.exceeds(Tolerance(0.005))


def test_the_smallest_tolerance_is_that_of_the_quantile_or_of_the_largest_patch():
    assert measure(plane(0.01), plane(), Tolerance(0.005)).min_tolerance == np.inf
    assert measure(plane(0.01), plane(), Tolerance(0.02)).min_tolerance == pytest.approx(0.01)
    vertices, faces = square(0.0, 81)
    vertices[np.abs(vertices[:, :2] - 0.5).max(axis=1) < 0.03, 2] = 0.02
    mesh = TriangleMesh(vertices, faces)
    errors = measure(mesh, plane(n=81), Tolerance(0.01))
    least = Tolerance(errors.min_tolerance)
    assert errors.p99 < 0.002 < 0.5 * least.length
    assert errors.in_tolerances(Tolerance(0.01)) < 1
    assert measure(mesh, plane(n=81), least).patch_area == pytest.approx(least.patch_area, rel=0.05)
    assert not measure(mesh, plane(n=81), least).exceeds(least)
    # Above 0.004 are the flat top of side 0.05, and of the slopes around it 0.01 of 0.0125.
    errors, area = measure(mesh, plane(n=81), Tolerance(0.004)), 0.0025 + 0.002 * np.hypot(1, 1.6)
    assert errors.patch_area == pytest.approx(area, rel=0.15)
    assert errors.in_tolerances(Tolerance(0.004)) == pytest.approx(errors.patch_area**0.5 / 0.04)
    assert errors.exceeds(Tolerance(0.004)).startswith("a patch of 21 x 21 tolerances")


def test_a_missing_part_counts_in_the_other_direction():
    target = plane()
    kept = target.vertices[target.faces][:, :, 0].mean(axis=1) < 0.94
    mesh = TriangleMesh(target.vertices, target.faces[kept])
    errors = measure(mesh, target, Tolerance(0.004))
    assert errors.p99 > 0.02
    assert errors.patch_area == pytest.approx(0.05, rel=0.3)


@pytest.mark.parametrize(("end", "message"), [(0.8, ""), (0.7, "it lacks 30 % of the surface")])
def test_a_frame_may_lack_a_quarter_of_the_surface(end, message):
    mesh = plane()
    is_shown = mesh.centroids[:, 0] < end
    errors = measure(mesh, TriangleMesh(mesh.vertices, mesh.faces[is_shown]), Tolerance(0.01))
    assert errors.unsupported == pytest.approx(1 - end, abs=0.02)
    assert errors.exceeds(Tolerance(0.01)) == message
    assert np.isfinite(errors.in_tolerances(Tolerance(0.01))) == (not message)


@pytest.mark.parametrize(("size", "unsupported"), [(0.5, 0.2), (1.2, 0)])
def test_only_what_is_below_a_closed_surface_is_hidden(size, unsupported):
    vertices, faces = capsule(30, 20)
    both = np.concatenate([vertices, size * vertices])
    mesh = TriangleMesh(both, np.concatenate([faces, faces + len(vertices)]))
    errors = measure(mesh, TriangleMesh(vertices, faces), Tolerance(0.01))
    assert errors.unsupported == pytest.approx(unsupported)
    assert bool(errors.exceeds(Tolerance(0.01))) == (unsupported == 0)


def test_separate_patches_do_not_add_up():
    vertices, faces = square(0.0, 41)
    vertices[np.abs(vertices[:, :2] - [0.25, 0.25]).max(axis=1) < 0.05, 2] = 0.1
    vertices[np.abs(vertices[:, :2] - [0.75, 0.75]).max(axis=1) < 0.05, 2] = 0.1
    one = measure(TriangleMesh(vertices, faces), plane(n=41), Tolerance(0.05)).patch_area
    vertices[vertices[:, 0] > 0.5, 2] = 0
    other = measure(TriangleMesh(vertices, faces), plane(n=41), Tolerance(0.05)).patch_area
    assert one == pytest.approx(other)


@pytest.mark.parametrize(
    ("positive", "area"),
    [(range(10), 4.0), ([6, 7], 9 / 16), ([6, 7, 2], 13 / 8), ([0, 5], 1 / 12), ([], 0.0)],
)
def test_patches_are_connected_by_positive_corners(positive, area):
    """A strip of four triangles of area 1, with values of 1 or -1; at centroids of 3 or -3."""
    vertices = np.array([[i // 2 * 2.0, i % 2, 0.0] for i in range(6)])
    strip = TriangleMesh(vertices, np.array([[0, 2, 1], [1, 2, 3], [2, 4, 3], [3, 4, 5]]))
    values = np.where(np.isin(np.arange(10), positive), 1.0, -1.0) * np.repeat([1, 3], [6, 4])
    assert largest_patch(strip, values) == pytest.approx(area)


def test_a_missing_part_that_touches_another_surface_is_a_hole():
    """A hand, wide where it lies on a plane, of which a frame has only the narrow arm above."""
    points, faces = square(0.0, 41)
    points[:, 2] = 0.001 + 0.2 * np.clip((0.45 - points[:, 0]) / 0.25, 0, 1)
    x, y, _ = points[faces].mean(axis=1).T
    limb = faces[np.abs(y - 0.5) < np.where(x < 0.25, 0.05, 0.4)][:, ::-1]
    ground, ground_faces = square(0.0, 41)

    def with_ground(some):
        vertices = np.concatenate([points, ground])
        return TriangleMesh(vertices, np.concatenate([some, ground_faces + len(points)]))

    is_arm = points[limb][:, :, 0].mean(axis=1) < 0.2
    errors = measure(with_ground(limb), with_ground(limb[is_arm]), Tolerance(0.01))
    assert not errors.exceeds(Tolerance(0.01))
    assert 0.05 < errors.unsupported < 0.25
