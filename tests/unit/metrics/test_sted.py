import itertools
import math

import numpy as np
import pytest

from meshreel.metrics.sted import sted

TRIANGLE = np.array([[0, 1, 2]], np.int32)
RIGHT = np.array([[[0.0, 0, 0], [3, 0, 0], [0, 4, 0]]])  # edges of length 3, 4, 5; D = 5


def slow_sted(original, decoded, faces):
    """The definition in loops, slow but plain."""
    n_frames, n_verts = original.shape[:2]
    edges = {tuple(sorted(p)) for f in faces.tolist() for p in itertools.combinations(f, 2)}
    ring = {v: {v} for v in range(n_verts)}
    for a, b in edges:
        ring[a].add(b)
        ring[b].add(a)
    deviations = []
    for frame, frame_hat in zip(original, decoded, strict=True):
        for v in range(n_verts):
            lengths, errors = [], []
            for a, b in edges:
                if a in ring[v] or b in ring[v]:
                    length = math.dist(frame[a], frame[b])
                    lengths.append(length)
                    errors.append((length - math.dist(frame_hat[a], frame_hat[b])) / length)
            if not lengths:
                continue
            mean = sum(w * e for w, e in zip(lengths, errors, strict=True)) / sum(lengths)
            squares = sum(w * (e - mean) ** 2 for w, e in zip(lengths, errors, strict=True))
            deviations.append(math.sqrt(squares / sum(lengths)))
    spatial = sum(deviations) / len(deviations)

    size = max(math.dist(p, q) for p, q in itertools.combinations(original[0], 2))

    def speed(frames, f, v):
        return math.hypot(math.dist(frames[f][v], frames[f - 1][v]) / size, 3e-4)

    errors = []
    for v in range(n_verts):
        for f in range(1, n_frames):
            window = [g for g in range(1, n_frames) if f - 5 < g <= f + 5]
            mean = sum(speed(original, g, v) for g in window) / len(window)
            errors.append(abs(speed(original, f, v) - speed(decoded, f, v)) / mean)
    temporal = sum(errors) / max(len(errors), 1)
    return spatial, temporal, math.sqrt(spatial**2 + (9.144e-5 * temporal) ** 2)


@pytest.mark.slow
@pytest.mark.every_case
@pytest.mark.parametrize("mesh", ["soup", "tube"])
@pytest.mark.parametrize("n_frames", [1, 2, 5, 9, 14])
def test_sted_equals_the_definition_in_loops(mesh, n_frames, request):
    original, decoded, faces = request.getfixturevalue(mesh)
    original, decoded = original[:n_frames], decoded[:n_frames]
    result = sted(original, decoded, faces)
    expected = slow_sted(original, decoded, faces)
    assert (result.spatial, result.temporal, result.sted) == pytest.approx(expected, rel=1e-10)


# Vertex 2 turned about vertex 0 to (-4, 0, 0): edges 3 and 4 stay, edge 5 becomes 7.
# e = 0, 0, -0.4 with weights 3, 4, 5: mean -2/12, mean square 0.8/12,
# variance 1/15 - 1/36 = 7/180, the same at each vertex.
# If vertices 3 and 0 coincide, all vertices see edges of 3, 4, 5, 3, 0; e = -0.4 for the edge of 5
# only: mean -2/15, mean square 0.8/15, variance 4/75 - 4/225 = 8/225.
@pytest.mark.every_case
@pytest.mark.parametrize(
    ("more", "faces", "variance"),
    [
        (np.zeros((0, 3)), [[0, 1, 2]], 7 / 180),
        ([[9.0, 9, 9], [8, 8, 8]], [[0, 1, 2]], 7 / 180),
        ([[0.0, 0, 0]], [[0, 1, 2], [0, 3, 1]], 8 / 225),
    ],
    ids=["triangle", "isolated vertices", "edge of length zero"],
)
def test_spatial_part_is_the_weighted_deviation_of_edges(more, faces, variance):
    original = np.concatenate([RIGHT, [more]], axis=1)
    decoded = original.copy()
    decoded[0, 2] = [-4, 0, 0]
    result = sted(original, decoded, np.array(faces, np.int32)).spatial
    assert result == pytest.approx(math.sqrt(variance), rel=1e-14)


def test_spatial_part_is_invariant_to_rigid_motion(tube):
    original, decoded, faces = tube
    turned = decoded[..., [1, 2, 0]] + np.array([4.0, 5, 6])
    expected = sted(*tube).spatial
    assert sted(original, turned, faces).spatial == pytest.approx(expected, rel=1e-9)


def test_spatial_part_of_uniform_scaling_is_zero(tube):
    original, _, faces = tube
    assert sted(original, 1.25 * original, faces).spatial < 1e-12


def test_temporal_part_is_invariant_to_translation(tube):
    original, decoded, faces = tube
    moved = sted(original, decoded + np.array([4.0, 5, 6]), faces).temporal
    assert moved == pytest.approx(sted(*tube).temporal, rel=1e-9)


def test_spatial_part_is_precise_for_tiny_errors():
    # Vertex 0 moves by d = 2^-50 towards vertex 1: to first order the edge of 3 shrinks by d and
    # the others stay, e = d / 3 with weight 3 of 12: mean d / 12, mean square d^2 / 36,
    # variance d^2 (1/36 - 1/144) = d^2 3 / 144.
    decoded = RIGHT.copy()
    decoded[0, 0, 0] = 2.0**-50
    result = sted(RIGHT, decoded, TRIANGLE).spatial
    assert result == pytest.approx(2.0**-50 * math.sqrt(3 / 144), rel=1e-12)


def test_spatial_part_is_zero_if_all_edges_have_length_zero():
    decoded = np.random.default_rng(1).normal(size=(1, 3, 3))
    assert sted(np.ones((1, 3, 3)), decoded, TRIANGLE).spatial == 0


def test_spatial_part_is_zero_without_edges():
    decoded = RIGHT + 1
    assert sted(RIGHT, decoded, np.zeros((1, 3), np.int32)).spatial == 0


def test_temporal_part_uses_the_whole_diagonal_if_frame_0_is_a_point():
    # Frame 0 is a point, so D = 5, the diagonal of the box 3 x 4 of frame 1 and the point (0, 0).
    # Original speeds: vertices 0, 1, 2 move 0, 3/5, 4/5 against dt; decoded stays at the point.
    original = np.concatenate([np.zeros_like(RIGHT), RIGHT])
    speeds = np.hypot([0, 3 / 5, 4 / 5], 3e-4)
    expected = ((speeds - 3e-4) / speeds).mean()
    result = sted(original, np.zeros_like(original), TRIANGLE).temporal
    assert result == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("moved", "expected"), [(0.0, 0), (1.0, math.inf)])
def test_temporal_part_of_a_single_point_is_zero_or_infinite(moved, expected):
    decoded = np.ones((3, 3, 3))
    decoded[1] += moved
    assert sted(np.ones((3, 3, 3)), decoded, TRIANGLE).temporal == expected


def test_sted_beyond_float64_is_infinite(tube):
    decoded = tube[0].copy()
    decoded[3, 4] = 1e300
    result = sted(tube[0], decoded, tube[2])
    assert (result.spatial, result.temporal) == (math.inf, math.inf)


def test_sted_does_not_depend_on_blocks_of_vertices(tube, monkeypatch):
    expected = sted(*tube).temporal
    monkeypatch.setattr("meshreel.metrics.sted._BLOCK_VALUES", 7 * len(tube[0]))
    assert sted(*tube).temporal == pytest.approx(expected, rel=1e-13)
