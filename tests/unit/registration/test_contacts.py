"""Surfaces that touch are followed although the raw surface lacks what is between them."""

import numpy as np
import pytest

from meshreel.registration.register import register
from meshreel.registration.triangle_mesh import TriangleMesh
from meshreel.registration.verification import Tolerance, measure
from samples.captures import as_frames, merging_spheres, revolved

LIMIT = Tolerance(0.01)


def sphere(radius, n_around=40):
    z = np.cos(np.linspace(0, np.pi, n_around // 2))
    return revolved(radius * np.sqrt(1 - z[1:-1] ** 2), radius * z, n_around)


def joined(outer, *inner):
    """Meshes as one."""
    vertices, faces = outer
    for more_vertices, more_faces in inner:
        faces = np.concatenate([faces, more_faces + len(vertices)])
        vertices = np.concatenate([vertices, more_vertices])
    return TriangleMesh(vertices, faces)


def test_what_a_closed_surface_hides_has_no_distance():
    outer, inner = sphere(1.0), sphere(0.4)
    errors = measure(joined(outer, inner), joined(outer), LIMIT)
    assert not errors.exceeds(LIMIT)
    assert errors.largest < 1e-9
    assert errors.unsupported == pytest.approx(0.16 / 1.16, rel=1e-3)


def test_a_hidden_surface_covers_nothing():
    errors = measure(joined(sphere(0.8)), joined(sphere(1.0)), LIMIT)
    assert errors.exceeds(LIMIT)
    assert errors.p99 > 0.19


def test_an_open_surface_hides_nothing():
    vertices, faces = sphere(1.0)
    is_open = vertices[faces][:, :, 2].mean(axis=1) < 0.1  # the upper part is missing
    bowl = vertices, faces[is_open]
    errors = measure(joined(bowl, sphere(0.4)), joined(bowl), LIMIT)
    assert errors.exceeds(LIMIT)


@pytest.mark.parametrize("is_reversed", [False, True])
def test_surfaces_that_merge_stay_one_segment(is_reversed):
    rng = np.random.default_rng(0)
    distances = [2.3, 2.15, 2.05, 1.95, 1.85, 1.75][:: -1 if is_reversed else 1]
    frames = [
        merging_spheres(distance, int(rng.integers(40, 46)), rng.random()) for distance in distances
    ]
    found = register(as_frames(frames), tolerance=0.4)
    [segment] = found.segments
    assert 0 < found.distances.unsupported_percent < 5
    assert max(errors.p99 for errors in segment.errors) <= found.tolerance.length
