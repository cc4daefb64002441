"""Fields of single frames, against closed forms and against the figures of whole sequences."""

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.metrics.heat import (
    HEATS,
    heat_field,
    surface_distance_percent,
    vertex_distance_percent,
    vertex_normal_angle_deg,
)
from meshreel.metrics.position_errors import position_errors
from meshreel.metrics.reference import bounding_box_reference
from meshreel.metrics.sted import LocalSted, sted

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
SQUARE_FACES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def vertex_sted(original, decoded, faces):
    return LocalSted(faces, len(original)).field(original, decoded)


def test_vertex_distance_percent_is_precise_far_from_the_origin():
    far = SQUARE + 1e6
    decoded = far + np.array([2.0**-20, 0, 0])
    assert vertex_distance_percent(far, decoded, 1.0) == pytest.approx([100 / 2**20] * 4, rel=1e-12)


def test_maximum_of_vertex_distance_percent_is_the_largest_error(tube):
    original, decoded, _ = tube
    diagonal = bounding_box_reference(original).diagonal
    fields = [
        vertex_distance_percent(*pair, diagonal) for pair in zip(original, decoded, strict=True)
    ]
    expected = position_errors(original, decoded)
    assert np.max(fields) == pytest.approx(expected.max_error_percent, rel=1e-12)
    assert np.sqrt(np.mean(np.square(fields))) == pytest.approx(
        expected.rms_error_percent, rel=1e-12
    )


def test_vertex_distance_percent_without_a_diagonal_is_infinite():
    point = np.zeros((2, 3))
    moved = point.copy()
    moved[1, 0] = 1
    np.testing.assert_array_equal(vertex_distance_percent(point, moved, 0.0), [0, np.inf])


def test_surface_distance_percent_is_the_height_above_a_plane_triangulated_otherwise():
    square = np.array([[0, 0, 0], [4, 0, 0], [4, 3, 0], [0, 3, 0]], np.float32)
    points = np.array([[1, 1, 0.5], [9, 9, 9], [2, 2, 0], [3, 0.5, -1], [7, 3, 4]], np.float32)
    distances = surface_distance_percent(
        square, points, np.array([[0, 1, 2], [0, 2, 3]]), np.array([[0, 2, 3], [4, 3, 2]]),
        bounding_box_reference(square),
    )  # fmt: skip
    assert distances == pytest.approx([10, np.nan, 0, 20, 100], nan_ok=True)


def test_surface_distance_percent_is_infinite_when_there_is_no_diagonal():
    point = np.ones((3, 3))
    distances = surface_distance_percent(
        point, np.stack([point[0], 2 * point[0]]), np.array([[0, 1, 2]]), np.array([[0, 1, 1]]),
        bounding_box_reference(point),
    )  # fmt: skip
    assert distances.tolist() == [0, np.inf]


def test_vertex_normal_angle_deg_averages_incident_faces():
    # A square of two faces that share the edge 0-1; vertex 2 belongs to the face that tilts by
    # 90 degrees, vertex 3 to the other, vertex 4 to none.
    original = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [5, 5, 5]])
    decoded = original.copy()
    decoded[2] = [0, 0, 1]
    faces = np.array([[0, 1, 2], [1, 0, 3]], np.int32)
    result = vertex_normal_angle_deg(original, decoded, faces)
    assert result == pytest.approx([45, 45, 90, 0, 0])


def test_vertex_normal_angle_deg_ignores_degenerate_faces():
    original = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0]])
    decoded = original.copy()
    decoded[2] = [0, 0, 1]
    faces = np.array([[0, 1, 2], [0, 1, 3]], np.int32)  # the second is a line
    result = vertex_normal_angle_deg(original, decoded, faces)
    assert result == pytest.approx([90, 90, 90, 0])


def test_error_names_both_shapes():
    with pytest.raises(InvalidInputError, match=r"\(1, 3, 3\) and \(1, 4, 3\)"):
        vertex_normal_angle_deg(np.zeros((3, 3)), np.zeros((4, 3)), np.array([[0, 1, 2]], np.int32))


def test_vertex_sted_is_the_deviation_of_the_incident_edges():
    # Corners on a line: edges 0-1, 1-2 and 0-2, of which each vertex sees all three.
    original = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    decoded = np.array([[0.0, 0, 0], [1, 0, 0], [3, 0, 0]])
    lengths, errors = np.array([1, 1, 2]), np.array([0, -1, -0.5])
    mean = np.average(errors, weights=lengths)
    expected = np.sqrt(np.average((errors - mean) ** 2, weights=lengths))
    result = vertex_sted(original, decoded, np.array([[0, 1, 2]], np.int32))
    assert result == pytest.approx([expected] * 3)


def test_mean_of_vertex_sted_is_the_spatial_part(tube):
    original, decoded, faces = tube
    local = LocalSted(faces, original.shape[1])
    fields = [local.field(*pair) for pair in zip(original, decoded, strict=True)]
    assert np.mean(fields) == pytest.approx(sted(original, decoded, faces).spatial, rel=1e-12)


def test_vertex_sted_of_an_isolated_vertex_is_zero():
    lonely = np.concatenate([SQUARE, [[9.0, 9, 9]]])
    decoded = lonely + np.array([0.0, 0.1, 0.3, 0.2, 0.9])[:, None]
    assert vertex_sted(lonely, decoded, SQUARE_FACES)[4] == 0


@pytest.mark.parametrize("kind", HEATS)
def test_heat_field_returns_the_requested_kind(kind, tube):
    original, decoded, faces = tube[0][3], tube[1][3], tube[2]
    expected = {
        "distance": lambda: vertex_distance_percent(original, decoded, 7.0),
        "angle": lambda: vertex_normal_angle_deg(original, decoded, faces),
        "sted": lambda: vertex_sted(original, decoded, faces),
    }[kind]()
    result = heat_field(kind, faces, len(original), 7.0)(original, decoded)
    np.testing.assert_array_equal(result, expected)
    assert result.max() > 0


def test_error_for_an_unknown_kind_lists_the_kinds():
    with pytest.raises(InvalidInputError, match="distance, angle, sted; got 'fire'"):
        heat_field("fire", SQUARE_FACES, 4, 1.0)
