"""A quality leads to the same visible errors on all sequences."""

from functools import partial

import numpy as np
import pytest

import meshreel
from meshreel.codec.reel.encoding import visibility
from meshreel.codec.reel.encoding.visibility import (
    MAX_BEND_DEG,
    NORMAL_ERROR_DEG,
    POSITION_ERROR,
    SEAM_ERROR,
    SampledSurface,
)
from samples.meshes import waving_grid
from samples.streams import recorded

FACES = np.array([[0, 1, 2], [2, 1, 3]], np.int32)


def hinge(angle_deg):
    """Two triangles whose normals have this angle."""
    turn = np.radians(angle_deg)
    return np.array([[-1, 0, 0], [0, 0, 0], [0, 1, 0], [np.cos(turn), 0.5, np.sin(turn)]], float)


WITHOUT_AREA = np.array([[0, 1, 2], [2, 1, 3], [3, 1, 4]], np.int32)
BENDS = {
    "flat": (FACES, [hinge(0.0)], 0.0),
    "4 degrees": (FACES, [hinge(4.0)], 4.0),
    "a right angle": (FACES, [hinge(90.0)], MAX_BEND_DEG),
    "mean over frames": (FACES, [hinge(1.0), hinge(1.0), hinge(7.0)], 3.0),
    "a face without area": (WITHOUT_AREA, [[*hinge(4.0), hinge(4.0)[3]]], 4.0),
    "a flipped face": (np.array([[0, 1, 2], [1, 2, 3]], np.int32), [hinge(4.0)], 4.0),
    "no area": (FACES, [np.zeros((4, 3))], MAX_BEND_DEG),
    "one face": (FACES[:1], [hinge(4.0)], MAX_BEND_DEG),
    "no faces": (FACES[:0], [hinge(4.0)], MAX_BEND_DEG),
}


@pytest.mark.every_case
@pytest.mark.parametrize("name", BENDS)
def test_bend_is_the_mean_angle_between_adjacent_faces(name):
    faces, frames, bend = BENDS[name]
    assert SampledSurface(faces, np.array(frames)).bend_deg == pytest.approx(bend, abs=1e-6)


def test_sampled_sides_cover_the_whole_surface():
    """A ribbon with folds of 1 degree in its first half and 7 degrees in the other."""
    n_quads = 12_000
    ribbon = np.array([[-1, 0, 0], [0, 0, 0], [0, 1, 0], [1, 0.5, 0]])
    turn = np.radians(np.where(np.arange(n_quads) < n_quads // 2, 1.0, 7.0))
    vertices = np.tile(ribbon, (n_quads, 1, 1))
    vertices[:, 3, 0], vertices[:, 3, 2] = np.cos(turn), np.sin(turn)
    faces = (FACES + 4 * np.arange(n_quads, dtype=np.int32)[:, None, None]).reshape(-1, 3)
    surface = SampledSurface(faces, vertices.reshape(1, -1, 3))
    assert surface.bend_deg == pytest.approx(4.0, abs=0.5)


def test_independent_errors_turn_normals_as_predicted():
    sheet = waving_grid(1, 30, 30, np.float64)
    predicted = SampledSurface(sheet.faces, sheet.vertices).normals_per_error
    error = np.random.default_rng(1).normal(size=sheet.vertices.shape)
    error *= 1e-4 / np.sqrt(np.square(error).sum(axis=2).mean())
    noisy = meshreel.MeshSequence(sheet.vertices + error, sheet.faces)
    measured = meshreel.compare(sheet, noisy).normal_angle_mean_deg
    assert measured == pytest.approx(predicted * 1e-4, rel=0.25)


def rough_body(n_frames, n_motions, side=40):
    """A rough sheet with a number of independent motions."""
    sheet = waving_grid(1, side, side, np.float64)
    rng = np.random.default_rng(3)
    rest = sheet.vertices[0] + 0.02 * rng.normal(size=(side**2, 3))
    motions = 0.01 * rng.normal(size=(n_motions, side**2, 3))
    curves = np.sin(np.arange(n_frames)[:, None] * np.linspace(0.1, 0.9, n_motions))
    return meshreel.MeshSequence(rest + np.tensordot(curves, motions, 1), sheet.faces)


def error_of(sequence, **options):
    """RMS error of positions, in mean diagonals of frames."""
    decoded = meshreel.decode(meshreel.encode(sequence, order="vertices", **options))
    error = np.square(decoded.vertices - sequence.vertices).sum(axis=2).mean() ** 0.5
    return error / np.linalg.norm(np.ptp(sequence.vertices, axis=1), axis=1).mean()


@pytest.mark.every_case
@pytest.mark.parametrize(("n_frames", "n_motions"), [(1, 0), (40, 2), (40, 20), (90, 60)])
def test_errors_are_the_same_whatever_the_number_of_modes(n_frames, n_motions):
    body = rough_body(n_frames, n_motions)
    assert error_of(body) == pytest.approx(POSITION_ERROR, rel=0.35)


def test_twelve_points_halve_the_error():
    body = rough_body(30, 10)
    assert error_of(body, quality=68) == pytest.approx(2 * error_of(body, quality=80), rel=0.15)


@pytest.mark.every_case
@pytest.mark.parametrize("is_live", [False, True])
def test_errors_are_those_of_the_block_that_moves_most(is_live):
    body = rough_body(40, 20)
    vertices = np.concatenate([np.repeat(body.vertices[:1], 40, axis=0), body.vertices])
    halves = meshreel.MeshSequence(vertices, body.faces)
    encode = recorded if is_live else partial(meshreel.encode, order="vertices")
    moving = meshreel.decode(encode(halves, block_frames=40)).vertices[40:]
    error = np.square(moving - body.vertices).sum(axis=2).mean() ** 0.5
    assert error < 1.35 * POSITION_ERROR * np.linalg.norm(np.ptp(vertices, axis=1), axis=1).mean()


def test_flat_surface_limits_the_error_of_normals():
    sheet = waving_grid(1, 60, 60, np.float64)
    flat = sheet.vertices * [1.0, 1.0, 1e-3]
    tilted = flat @ np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    sequence = meshreel.MeshSequence(tilted, sheet.faces)
    decoded = meshreel.decode(meshreel.encode(sequence, order="vertices"))
    measured = meshreel.compare(sequence, decoded).normal_angle_mean_deg
    assert measured == pytest.approx(NORMAL_ERROR_DEG, rel=0.4)


def test_coincident_vertices_are_coded_more_finely(monkeypatch):
    body = rough_body(20, 5, side=12)
    corners = body.faces.ravel()
    apart = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
    soup = meshreel.MeshSequence(body.vertices[:, corners], apart)
    assert SampledSurface(soup.faces, soup.vertices).has_seams
    assert not SampledSurface(body.faces, body.vertices).has_seams
    assert error_of(soup) < 1.3 * SEAM_ERROR
    monkeypatch.setattr(visibility, "SEAM_ERROR", 1.0)
    assert error_of(soup) > 2.0 * SEAM_ERROR


@pytest.mark.every_case
@pytest.mark.parametrize("scale", [1e-150, 1e150])
def test_units_do_not_matter(scale):
    body = rough_body(10, 3, side=12)
    scaled = meshreel.MeshSequence(body.vertices * scale, body.faces)
    assert error_of(scaled) == pytest.approx(error_of(body), rel=0.01)


def test_live_recording_is_coded_as_finely_as_a_file():
    body = rough_body(60, 60, side=20)
    streams = recorded(body, block_frames=60), meshreel.encode(body)
    errors = [meshreel.compare(body, data).rms_error_percent for data in streams]
    assert errors[0] == pytest.approx(errors[1], rel=0.02)
