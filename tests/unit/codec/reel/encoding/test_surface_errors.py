"""With the tune `surface`, vertices slide along the surface, and the shape stays."""

import numpy as np
import pytest

import meshreel
from meshreel import InvalidInputError, MeshSequence
from meshreel.codec.reel.encoding.block_frames import BlockFrames
from meshreel.codec.reel.encoding.surface_errors import ACROSS, ALONG, surface_forms
from meshreel.codec.reel.normative.mesh import FieldMesh
from meshreel.codec.subspace.trajectories import BoundingFrame
from samples.captures import bent, capsule
from samples.shapes import cube, square, torus


def bending(n_frames=6):
    """A bending capsule with vertices at uneven places of its surface."""
    vertices, faces = capsule(60, 60)
    turn = 0.02 * np.sin(40 * vertices @ [1.0, 2.0, 3.0])
    x, y, z = vertices.T
    vertices = np.stack(
        [x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn), z], axis=1
    )
    frames = [bent(vertices, angle) for angle in np.linspace(0, 0.6, n_frames)]
    return MeshSequence(np.stack(frames).astype(np.float32), faces, 25.0)


def coded(sequence, tune, **target):
    return meshreel.decode(meshreel.encode(sequence, tune=tune, **(target or {"quality": 70})))


@pytest.mark.usefixtures("few_grid_lines")
def test_sliding_keeps_the_surface_nearer_in_equal_size():
    sequence = bending()
    decoded = [coded(sequence, tune, size=6000, order="drop") for tune in ("visual", "surface")]
    vertices = [meshreel.compare(sequence, each).max_error_percent for each in decoded]
    surfaces = [
        meshreel.compare(sequence, each, surface=True, n_samples=4000).psnr_db for each in decoded
    ]
    assert vertices[1] > vertices[0]
    assert surfaces[1] > surfaces[0] + 1.0


def test_boundaries_and_corners_keep_their_place():
    flat, faces = square(n=40)
    rng = np.random.default_rng(0)
    inner = ((flat > 0) & (flat < 1))[:, :2].all(axis=1)
    flat[inner, :2] += rng.uniform(-0.008, 0.008, (inner.sum(), 2))
    frames = np.stack([flat + np.array([0.1 * t, 0, 0]) for t in range(4)]).astype(np.float32)
    decoded = coded(MeshSequence(frames, faces, 25.0), "surface")
    errors = np.abs(np.asarray(decoded.vertices) - frames)
    is_left = flat[:, 0] == 0
    is_corner = is_left & (flat[:, 1] == 0)
    assert errors[:, is_left, 0].max() < 0.5 * errors[:, inner, :2].max()
    assert errors[:, is_corner].max() < 0.5 * errors[:, inner, :2].max()


def test_forms_are_squared_distances_from_the_planes_of_faces():
    """The factors of a form give the same sum as its definition."""
    points, faces = cube()
    frames = np.stack([points, points @ np.diag([1.0, 1.0, 2.0])])
    mesh = FieldMesh(faces, len(points), 8)
    vectors = np.linalg.qr(np.random.default_rng(1).normal(size=(6, 5)))[0].reshape(3, 2, 5)
    block = BlockFrames(frames, BoundingFrame(np.zeros(3), 1.0))
    strengths = np.array([100.0, 50, 30, 21, 19])  # the last is too weak
    fields = np.tile(strengths, (len(points), 1))
    forms = surface_forms(vectors, fields, block, mesh, n_learned=32)[mesh.number]
    error = np.array([0.3, -1.0, 0.5, 2.0])
    expected = ALONG * error @ error
    at = 0
    around = faces[(faces == at).any(axis=1)]
    for time in range(2):
        corners = frames[time][around]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        areas = np.linalg.norm(normals, axis=1)
        moved = vectors[:, time, :4] @ error
        heights = normals @ moved / areas
        expected += (ACROSS - ALONG) * (areas * heights**2).sum() / areas.sum()
    row, total = forms[at], 0.0
    for k in range(4):
        *couplings, weight = row[k * (k + 1) // 2 :][: k + 1]
        total += weight * (error[k] + np.dot(couplings, error[:k])) ** 2
    assert total == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("n_frames", [1, 2, 30])
def test_meshes_with_defects(n_frames):
    """Isolated vertices, faces without area, twice the same face, and few modes."""
    points, faces = torus(12, 16)
    points = np.concatenate([points, [[3.0, 0, 0], [3.0, 0, 0]]])
    faces = np.concatenate([faces, faces[:1], [[0, 0, 1], [5, 5, 5]]]).astype(np.int32)
    frames = np.stack([points * (1 + 0.01 * t) for t in range(n_frames)]).astype(np.float32)
    decoded = coded(MeshSequence(frames, faces, 25.0), "surface")
    assert np.abs(np.asarray(decoded.vertices) - frames).max() < 0.1


@pytest.mark.parametrize("target", [{"max_error": 0.1}, {"kg": 0.1}, {"bound": "0.1%"}])
def test_bounds_of_vertex_errors_exclude_sliding(target):
    with pytest.raises(InvalidInputError, match=f"tune surface lets .*{next(iter(target))}"):
        meshreel.encode(bending(2), tune="surface", **target)
