import json
from dataclasses import replace

import numpy as np
import pytest

from meshreel.app.figures import quality_rows
from meshreel.errors import InvalidInputError
from meshreel.metrics.compare import REST_PERCENT, RestMotion, compare, rest_motion
from meshreel.metrics.nmsve import nmsve_per_frame
from meshreel.metrics.normals import normal_angles
from meshreel.metrics.position_errors import position_errors
from meshreel.metrics.sted import sted
from meshreel.model.sequence import MeshSequence


@pytest.fixture
def pair(tube):
    original, decoded, faces = tube
    return MeshSequence(original, faces), MeshSequence(decoded, faces)


def with_faces(sequence, faces):
    return MeshSequence(sequence.vertices, np.asarray(faces, np.int32))


def test_compare_returns_every_metric(pair, tube):
    quality, perceived, angles = compare(*pair), sted(*tube), normal_angles(*tube)
    positions, at_rest = position_errors(*tube[:2]), rest_motion(*tube[:2])
    expected = {
        **vars(positions),
        "sted": perceived.sted,
        "sted_spatial": perceived.spatial,
        "sted_temporal": perceived.temporal,
        "nmsve": nmsve_per_frame(*tube).tolist(),
        "nmsve_mean": nmsve_per_frame(*tube).mean(),
        "normal_angle_mean_deg": angles.mean_deg,
        "normal_angle_p95_deg": angles.p95_deg,
        "n_degenerate_face_frames": 0,
        "n_rest_pairs": at_rest.n_pairs,
        "rest_motion_median_percent": at_rest.median_percent,
        "rest_motion_p99_percent": at_rest.p99_percent,
        "n_frames": 9,
        "n_verts": 40,
        "tracks": {},
        "diagonal": pytest.approx(np.linalg.norm(np.ptp(tube[0], axis=(0, 1))), rel=1e-14),
    }
    assert quality.as_dict() == expected
    assert json.loads(json.dumps(quality.as_dict(), allow_nan=False)) == quality.as_dict()


def test_equal_sequences_have_no_error(pair):
    plain = compare(pair[0], pair[0]).as_dict()
    errors = {key: plain[key] for key in plain if "error" in key or "sted" in key or "deg" in key}
    assert not any(errors.values())
    assert not any(plain["nmsve"])


def assert_same_figures(result, expected, rel):
    """Compare two results of `compare`."""
    one, other = result.as_dict(), expected.as_dict()
    assert one.pop("tracks") == other.pop("tracks") == {}
    assert one.pop("nmsve") == pytest.approx(other.pop("nmsve"), rel=rel)
    assert one == pytest.approx(other, rel=rel)


@pytest.mark.parametrize("scale", [1e-6, 3.7, 2.0**-900, 2.0**900])
def test_figures_do_not_depend_on_the_unit(pair, scale):
    scaled = [part.replace(vertices=part.vertices * scale) for part in pair]
    expected = compare(*pair)
    assert_same_figures(
        compare(*scaled), replace(expected, diagonal=scale * expected.diagonal), rel=1e-9
    )


def test_figures_are_precise_for_huge_offsets(pair):
    # Multiples of 2^-20 plus 2^30 are exact in float64, so only the metrics can lose digits.
    near = [part.replace(vertices=np.round(part.vertices * 2**20) / 2**20) for part in pair]
    far = [part.replace(vertices=part.vertices + 2.0**30) for part in near]
    assert_same_figures(compare(*far), compare(*near), rel=1e-9)


def test_float32_sequences_are_measured_in_float64(pair):
    single = [part.replace(vertices=part.vertices.astype(np.float32)) for part in pair]
    double = [part.replace(vertices=part.vertices.astype(np.float64)) for part in single]
    assert_same_figures(compare(*single), compare(*double), rel=1e-12)


@pytest.mark.parametrize(
    "metric", [position_errors, rest_motion, sted, nmsve_per_frame, normal_angles]
)
def test_error_names_both_shapes(metric):
    faces = [] if metric in (position_errors, rest_motion) else [np.array([[0, 1, 2]], np.int32)]
    with pytest.raises(InvalidInputError, match=r"\(2, 4, 3\) and \(2, 5, 3\)"):
        metric(np.zeros((2, 4, 3)), np.zeros((2, 5, 3)), *faces)


def test_order_and_first_corner_of_faces_do_not_matter(pair, rng):
    original, decoded = pair
    faces = original.faces[rng.permutation(original.n_faces)]
    turns = rng.integers(0, 3, len(faces))
    turned = np.array([np.roll(face, turn) for face, turn in zip(faces, turns, strict=True)])
    result = compare(original, with_faces(decoded, turned)).as_dict()
    assert result == compare(original, decoded).as_dict()


def test_rotated_degenerate_faces_are_accepted(pair):
    faces = [[4, 4, 1], [2, 3, 3], [5, 5, 5], [0, 1, 2]]
    turned = [[5, 5, 5], [1, 4, 4], [3, 3, 2], [2, 0, 1]]
    original, decoded = pair
    assert compare(with_faces(original, faces), with_faces(decoded, turned)).n_verts == 40


def test_error_names_the_first_missing_face(pair):
    original, decoded = pair
    faces = original.faces.copy()
    faces[[17, 50]] = faces[[17, 50], ::-1]
    named = rf"face 17 of the original, \[{', '.join(map(str, original.faces[17]))}\]"
    with pytest.raises(InvalidInputError, match=named):
        compare(original, with_faces(decoded, faces))


def test_repeated_faces_are_counted(pair):
    first, second = [[0, 1, 2], [0, 1, 2], [3, 4, 5]], [[0, 1, 2], [3, 4, 5], [3, 4, 5]]
    with pytest.raises(InvalidInputError, match="face 0 of the original"):
        compare(with_faces(pair[0], first), with_faces(pair[1], second))


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("change", "counts"),
    [
        (lambda v, f: (np.concatenate([v, v[:, :2]], axis=1), f), "40 vertices and the decoded 42"),
        (lambda v, f: (v[:7], f), "9 frames and the decoded 7"),
        (lambda v, f: (v, f[:-1]), "80 faces and the decoded 79"),
    ],
)
def test_error_names_both_counts(pair, change, counts):
    original, decoded = pair
    with pytest.raises(InvalidInputError, match=f"original has {counts}"):
        compare(original, MeshSequence(*change(decoded.vertices, decoded.faces)))


def test_progress_grows_up_to_one_in_steps_below_half(pair):
    heard = []
    compare(*pair, progress=lambda stage, fraction: heard.append((stage, fraction)))
    fractions = [fraction for _, fraction in heard]
    assert {stage for stage, _ in heard} == {"comparing"}
    assert 0 <= np.diff(fractions).min() <= np.diff(fractions).max() < 0.5
    assert (fractions[0], fractions[-1]) == (0, 1)


@pytest.mark.parametrize("kind", ["point", "line", "plane", "duplicates", "isolated"])
def test_figures_of_odd_meshes_are_finite(kind, pair, rng):
    vertices, faces = pair[0].vertices.copy(), pair[0].faces.copy()
    if kind == "point":
        faces = np.zeros_like(faces)
    elif kind == "line":
        vertices[..., 1:] = 0
    elif kind == "plane":
        vertices[..., 2] = 0
    elif kind == "duplicates":
        vertices[:, 20:] = vertices[:, :20]
    else:
        faces = faces[:10]
    decoded = vertices + 1e-3 * rng.normal(size=vertices.shape)
    quality = compare(MeshSequence(vertices, faces), MeshSequence(decoded, faces))
    assert np.isfinite([*quality.nmsve, quality.sted, quality.kg_error_percent]).all()


def test_table_has_a_row_for_motion_at_rest(pair):
    original, decoded = pair
    resting = replace(compare(original, decoded), n_rest_pairs=1, rest_motion_median_percent=0.25)
    assert quality_rows(resting)["motion at rest"].startswith("median 0.2500 % of the model size")
    assert "over 1 pair of vertex" in quality_rows(resting)["motion at rest"]
    moving = replace(resting, n_rest_pairs=0)
    assert quality_rows(moving)["motion at rest"] == "no vertex rests"


DIAGONAL = 2.0


def walking(n_frames=6, n_verts=50):
    """Return a cloud in a box of this diagonal; ten vertices move by 1 % per frame."""
    side = DIAGONAL / np.sqrt(3.0)
    places = np.random.default_rng(1).uniform(0.0, side, (n_verts, 3))
    places[10:12] = [[0, 0, 0], [side] * 3]
    result = np.repeat(places[None], n_frames, axis=0)
    result[:, :10, 0] *= 0.5
    result[:, :10, 0] += 0.01 * DIAGONAL * np.arange(n_frames)[:, None]
    return result


def test_only_resting_vertices_count():
    original = walking()
    decoded = original.copy()
    decoded[3, 10:, 1] += 0.002 * DIAGONAL
    decoded[:, :10] += np.random.default_rng(2).normal(size=(6, 10, 3))
    result = rest_motion(original, decoded)
    assert result.n_pairs == 5 * 40
    assert result.median_percent == 0.0
    assert result.p99_percent == pytest.approx(0.2)


def test_median_is_the_motion_of_most_pairs():
    original = walking()
    decoded = original + 0.0003 * DIAGONAL * np.array([0, 1, 0, 1, 0, 0])[:, None, None] * [0, 0, 1]
    assert rest_motion(original, decoded).median_percent == pytest.approx(0.03)


@pytest.mark.parametrize(("share", "n_pairs"), [(0.9, 200), (1.1, 170)])
def test_vertices_rest_below_the_threshold(share, n_pairs):
    original = walking()
    original[2:, 20:] += [share * REST_PERCENT / 100 * DIAGONAL, 0, 0]
    assert rest_motion(original, original).n_pairs == n_pairs


def test_result_is_invariant_to_travel_units_and_position():
    original = walking()
    decoded = original.copy()
    decoded[1::2, :, 1] += 0.001 * DIAGONAL
    result = rest_motion(original, decoded)
    far = rest_motion(1e6 * (original + 8.0), 1e6 * (decoded + 8.0))
    assert (far.n_pairs, far.median_percent) == (
        result.n_pairs,
        pytest.approx(result.median_percent),
    )
    jump = np.zeros((6, 1, 3))
    jump[5] = [100.0, 0.0, 0.0]
    walked = rest_motion(original + jump, decoded + jump)
    assert walked.n_pairs == result.n_pairs - 40
    assert walked.median_percent == pytest.approx(result.median_percent)


def test_nothing_is_measured_without_resting_vertices():
    moving = np.cumsum(np.ones((4, 5, 3)), axis=0) + np.arange(5)[:, None]
    assert rest_motion(moving, moving + 1.0) == RestMotion(0, 0.0, 0.0)
    assert rest_motion(moving[:1], moving[:1]) == RestMotion(0, 0.0, 0.0)
    assert rest_motion(np.ones((4, 5, 3)), np.ones((4, 5, 3))) == RestMotion(0, 0.0, 0.0)
