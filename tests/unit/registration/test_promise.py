"""The tolerance of registered frames, checked by dense samples without the code of the package."""

import numpy as np
import pytest

from meshreel.registration.register import register
from meshreel.registration.triangle_mesh import TriangleMesh
from meshreel.registration.verification import Tolerance, measure
from samples.captures import as_frames
from samples.dense_distances import promised
from samples.shapes import square

LENGTH = 0.02
FINE = 46, 47, 48


def sheet(n, height, keeps=None):
    """The unit square of n x n vertices with a height at (x, y), and with the faces to keep."""
    vertices, faces = square(0.0, n)
    vertices[:, 2] = height(vertices[:, 0], vertices[:, 1])
    return vertices, faces if keeps is None else faces[keeps(vertices[faces].mean(axis=1))]


def flat(x, y):
    return 0 * x


def outside(side):
    """Faces outside a square, with a side in tolerances."""
    return lambda points: np.abs(points[:, :2] - 0.53).max(axis=1) > side * LENGTH / 2


def plateau(side, height=2.0):
    """A square, with a side and a height in tolerances."""

    def heights(x, y):
        is_inside = np.maximum(abs(x - 0.53), abs(y - 0.53)) < side * LENGTH / 2
        return height * LENGTH * is_inside

    return heights


def wave(height, frequency):
    return lambda x, y: height * LENGTH * np.sin(frequency * x) * np.cos(frequency * y)


PAIRS = {
    "plateau above a coarse face": (sheet(4, flat), sheet(61, plateau(13))),
    "plateau above fine faces": (sheet(41, flat), sheet(61, plateau(7))),
    "strip between vertices": (
        sheet(6, flat),
        sheet(61, lambda x, y: 2 * LENGTH * (abs(x - 0.53) < 0.4 * LENGTH)),
    ),
    "wave": (sheet(9, flat), sheet(61, wave(1.5, 7))),
    "facets of a wave": (sheet(5, wave(4, 6)), sheet(61, wave(4, 6))),
    "hole above a coarse face": (sheet(61, flat, outside(14)), sheet(4, flat)),
    "hole above small faces": (sheet(61, flat, outside(11)), sheet(21, flat)),
    "hole in the raw surface": (sheet(4, flat), sheet(61, flat, outside(14))),
}


@pytest.mark.parametrize("name", PAIRS)
def test_patches_are_as_wide_as_dense_samples_tell(name):
    mesh, target = PAIRS[name]
    p99, side = promised(mesh, target, LENGTH)
    errors = measure(TriangleMesh(*mesh), TriangleMesh(*target), Tolerance(LENGTH))
    assert errors.p99 / LENGTH == pytest.approx(p99, rel=0.2, abs=0.3)
    assert errors.patch_area**0.5 / LENGTH == pytest.approx(side, rel=0.1)


def test_the_share_that_the_raw_surface_lacks_is_its_hole():
    mesh, target = (TriangleMesh(*each) for each in PAIRS["hole in the raw surface"])
    errors = measure(mesh, target, Tolerance(LENGTH))
    assert errors.unsupported == pytest.approx(1 - target.areas.sum(), rel=0.15)
    assert measure(target, mesh, Tolerance(LENGTH)).unsupported < 0.01


@pytest.mark.parametrize("width", [4, 24])
def test_what_is_above_a_hole_is_beyond_it_however_high(width):
    """A plateau in a hole 14 tolerances wide is lacking, as a finger would be; a wider one not."""
    mesh = sheet(61, plateau(width, 15))
    target = sheet(61, flat, outside(14))
    errors = measure(TriangleMesh(*mesh), TriangleMesh(*target), Tolerance(LENGTH))
    assert (errors.patch_area > 0) == (width > 14)


def frames(sizes, height, keeps=None):
    """Sheets of other meshes, whose height and faces depend on the frame number."""
    return as_frames(
        [
            sheet(n, lambda x, y, at=number: height(x, y, at), keeps and keeps(number))
            for number, n in enumerate(sizes)
        ]
    )


def traveling(height, width):
    """A hill that moves."""
    return lambda x, y, at: height * np.exp(-((x - 0.5 - 0.03 * at) ** 2 + (y - 0.5) ** 2) / width)


def waving(height, frequency):
    return lambda x, y, at: height * np.sin(frequency * x + 0.4 * at) * np.cos(frequency * y)


def torn_in_the_first(side):
    return lambda at: outside(side if at == 0 else 0)


CAPTURES = {
    "fine wave": (1, FINE, waving(0.03, 5)),
    "coarse wave": (1, (9, 10, 11), waving(0.05, 7)),
    "one coarse frame": (1, (8, 46, 47), waving(0.04, 6)),
    "low hill on coarse faces": (1, (9, 10, 11), traveling(0.03, 0.01)),
    "hill on coarse faces": (1, (11, 12, 13), traveling(0.05, 0.02)),
    "growing crease": (1, FINE, lambda x, y, at: 0.1 * at * abs(x - 0.5)),
    "step in one frame": (1, FINE, lambda x, y, at: 0.08 * (at == 2) * (abs(x - 0.5) < 0.1)),
    "small hole": (1, FINE, waving(0.03, 5), torn_in_the_first(4)),
    "large hole": (1, FINE, waving(0.03, 5), torn_in_the_first(16)),
    "a third missing": (2, FINE, waving(0.03, 5), torn_in_the_first(30)),
    "coarse faces of a high wave": (3, (9, 10, 11), waving(0.15, 14)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CAPTURES)
def test_dense_samples_confirm_the_tolerance(name):
    n_segments, *capture = CAPTURES[name]
    raw = frames(*capture)
    found = register(raw, tolerance=0.8)
    assert found.sequence.n_segments == n_segments
    length = found.tolerance.length * found.frames.capture.scale
    for number in range(raw.n_frames):
        frame, original = found.sequence[number], raw[number]
        mesh, target = ((one.vertices.astype(float), one.faces) for one in (frame, original))
        p99, side = promised(mesh, target, length)
        assert p99 <= 1.1
        assert side <= 10.5
