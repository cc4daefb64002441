import itertools
import math

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
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
    temporal = sum(errors) / len(errors)
    return spatial, temporal, math.sqrt(spatial**2 + (9.144e-5 * temporal) ** 2)


@pytest.mark.parametrize("mesh", ["soup", "tube"])
@pytest.mark.parametrize("n_frames", [2, 5, 9, 14])
def test_sted_equals_the_definition_in_loops(mesh, n_frames, request):
    original, decoded, faces = request.getfixturevalue(mesh)
    original, decoded = original[:n_frames], decoded[:n_frames]
    found = sted(original, decoded, faces)
    expected = slow_sted(original, decoded, faces)
    assert (found.spatial, found.temporal, found.sted) == pytest.approx(expected, rel=1e-10)


def test_spatial_part_is_the_weighted_deviation_of_edges():
    # Vertex 2 turned about vertex 0 to (-4, 0, 0): edges 3 and 4 stay, edge 5 becomes 7.
    # e = 0, 0, -0.4 with weights 3, 4, 5: mean -2/12, mean square 0.8/12,
    # variance 1/15 - 1/36 = 7/180, the same at each vertex.
    decoded = RIGHT.copy()
    decoded[0, 2] = [-4, 0, 0]
    assert sted(RIGHT, decoded, TRIANGLE).spatial == pytest.approx(math.sqrt(7 / 180), rel=1e-14)


def test_spatial_part_is_the_mean_over_frames():
    original, decoded = np.repeat(RIGHT, 2, axis=0), np.repeat(RIGHT, 2, axis=0)
    decoded[1, 2] = [-4, 0, 0]
    found = sted(original, decoded, TRIANGLE).spatial
    assert found == pytest.approx(math.sqrt(7 / 180) / 2, rel=1e-14)


def test_temporal_part_is_relative_to_the_mean_speed():
    # D = 5; the original is static, s = 3e-4. Vertex 2 moves 5 * 4e-4: s^ = 5e-4.
    # |s - s^| / s = 2/3, the mean over three vertices 2/9.
    original, decoded = np.repeat(RIGHT, 2, axis=0), np.repeat(RIGHT, 2, axis=0)
    decoded[1, 2, 2] = 5 * 4e-4
    assert sted(original, decoded, TRIANGLE).temporal == pytest.approx(2 / 9, rel=1e-12)


def test_temporal_window_is_four_frames_back_and_five_ahead():
    # 13 frames, 12 steps; vertex 0 makes one step of 5 * 4e-4 (s = 5e-4) at frame 6, else 3e-4.
    # Decoded is static. Error 2e-4 at frame 6 only, whose window is frames 2..11, ten steps
    # of mean (9 * 3e-4 + 5e-4) / 10 = 3.2e-4. T = (2 / 3.2) / (3 vertices * 12 steps).
    original, decoded = np.repeat(RIGHT, 13, axis=0), np.repeat(RIGHT, 13, axis=0)
    original[6:, 0, 2] += 5 * 4e-4
    assert sted(original, decoded, TRIANGLE).temporal == pytest.approx(2 / 3.2 / 36, rel=1e-12)


def test_sted_combines_its_parts_with_the_weight_of_its_authors(tube):
    found = sted(*tube)
    expected = math.sqrt(found.spatial**2 + (9.144e-5 * found.temporal) ** 2)
    assert found.sted == pytest.approx(expected, rel=1e-14)


def test_sted_of_equal_sequences_is_exactly_zero(tube):
    found = sted(tube[0], tube[0].copy(), tube[2])
    assert (found.spatial, found.temporal, found.sted) == (0, 0, 0)


def test_temporal_part_of_one_frame_is_zero(tube):
    original, decoded, faces = tube
    assert sted(original[:1], decoded[:1], faces).temporal == 0


@pytest.mark.parametrize("scale", [1e-6, 12.5, 2.0**-900, 2.0**900])
def test_sted_is_invariant_to_scale(tube, scale):
    original, decoded, faces = tube
    found, expected = sted(original * scale, decoded * scale, faces), sted(*tube)
    assert found.spatial == pytest.approx(expected.spatial, rel=1e-9)
    assert found.temporal == pytest.approx(expected.temporal, rel=1e-9)


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


def test_sted_is_precise_for_huge_offsets(tube):
    # Multiples of 2^-20 plus 2^30 are exact in float64, so only the metric can lose digits.
    original, decoded = (np.round(part * 2**20) / 2**20 for part in tube[:2])
    found = sted(original + 2.0**30, decoded + 2.0**30, tube[2])
    expected = sted(original, decoded, tube[2])
    assert found.spatial == pytest.approx(expected.spatial, rel=1e-9)
    assert found.temporal == pytest.approx(expected.temporal, rel=1e-9)


def test_spatial_part_is_precise_for_tiny_errors():
    # Vertex 0 moves by d = 2^-50 towards vertex 1: to first order the edge of 3 shrinks by d and
    # the others stay, e = d / 3 with weight 3 of 12: mean d / 12, mean square d^2 / 36,
    # variance d^2 (1/36 - 1/144) = d^2 3 / 144.
    decoded = RIGHT.copy()
    decoded[0, 0, 0] = 2.0**-50
    found = sted(RIGHT, decoded, TRIANGLE).spatial
    assert found == pytest.approx(2.0**-50 * math.sqrt(3 / 144), rel=1e-12)


def test_spatial_part_ignores_isolated_vertices():
    # The triangle of the first test, and two vertices without faces: the mean is over three.
    original = np.concatenate([RIGHT, [[[9.0, 9, 9], [8, 8, 8]]]], axis=1)
    decoded = original.copy()
    decoded[0, 2] = [-4, 0, 0]
    found = sted(original, decoded, TRIANGLE).spatial
    assert found == pytest.approx(math.sqrt(7 / 180), rel=1e-14)


def test_spatial_part_gives_edges_of_length_zero_no_weight():
    # Vertices 3 and 0 coincide; both are neighbors of 1: edges 01, 12, 02 as before, 13 = 3,
    # 03 = 0.
    # All vertices see all edges. Weights 3, 4, 5, 3, 0; e = -0.4 for the edge of 5 only:
    # mean -2/15, mean square 0.8/15, variance 4/75 - 4/225 = 8/225.
    original = np.concatenate([RIGHT, RIGHT[:, :1]], axis=1)
    decoded = original.copy()
    decoded[0, 2] = [-4, 0, 0]
    found = sted(original, decoded, np.array([[0, 1, 2], [0, 3, 1]], np.int32)).spatial
    assert found == pytest.approx(math.sqrt(8 / 225), rel=1e-14)


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
    found = sted(original, np.zeros_like(original), TRIANGLE).temporal
    assert found == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("moved", "expected"), [(0.0, 0), (1.0, math.inf)])
def test_temporal_part_of_a_single_point_is_zero_or_infinite(moved, expected):
    decoded = np.ones((3, 3, 3))
    decoded[1] += moved
    assert sted(np.ones((3, 3, 3)), decoded, TRIANGLE).temporal == expected


def test_sted_beyond_float64_is_infinite(tube):
    decoded = tube[0].copy()
    decoded[3, 4] = 1e300
    found = sted(tube[0], decoded, tube[2])
    assert (found.spatial, found.temporal) == (math.inf, math.inf)


def test_sted_does_not_depend_on_blocks_of_vertices(tube, monkeypatch):
    expected = sted(*tube).temporal
    monkeypatch.setattr("meshreel.metrics.sted._BLOCK_VALUES", 7 * len(tube[0]))
    assert sted(*tube).temporal == pytest.approx(expected, rel=1e-13)


def test_sted_accepts_read_only_inputs(tube):
    for array in tube:
        array.flags.writeable = False
    assert sted(*tube).sted > 0


def test_error_names_both_shapes():
    with pytest.raises(InvalidInputError, match=r"\(1, 3, 3\) and \(2, 3, 3\)"):
        sted(RIGHT, np.repeat(RIGHT, 2, axis=0), TRIANGLE)
