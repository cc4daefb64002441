import numpy as np
import pytest

import meshreel
from meshreel.formats.gltf import morphs
from meshreel.formats.gltf.mesh_writer import describe_losses, fit_part, split_at_seams
from meshreel.formats.gltf.morphs import (
    BYTE,
    SHORT,
    fit_morphs,
    measure,
    select_normal_targets,
    solve_gram,
    static_normals,
)
from meshreel.formats.options import WriteOptions
from meshreel.formats.scenes.parts import PartMesh, split_parts
from meshreel.model.flag import simulate_flag
from meshreel.model.geometry.normals import vertex_normals
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Surface
from samples.meshes import octahedron_faces
from samples.surfaces import rich_cube, srgb


@pytest.fixture(scope="module")
def flag():
    """A flag in the wind as displacements from its mean, in meters."""
    vertices = simulate_flag(60, n_rows=16, n_columns=16).vertices
    return (vertices - vertices.mean(axis=0)).transpose(0, 2, 1).reshape(60, -1)


def plain_error(frames, n_targets):
    """Return the largest error of the leading components alone."""
    basis = np.linalg.svd(frames, full_matrices=False)[0][:, :n_targets]
    residuals = (frames - basis @ (basis.T @ frames)).reshape(len(frames), 3, -1)
    return np.linalg.norm(residuals, axis=1).max()


@pytest.mark.slow
@pytest.mark.parametrize("bound", [0.02, 0.003, 0.0003])
def test_fit_morphs_meets_the_bound(flag, bound):
    result = fit_morphs(flag, bound)
    decoded = result.weights.astype(np.float64) @ result.targets.values
    distances = np.linalg.norm((decoded - flag).reshape(len(flag), 3, -1), axis=1)
    assert distances.max() <= bound
    np.testing.assert_allclose(result.errors, distances.max(axis=1), atol=1e-6)


@pytest.mark.slow
def test_fit_morphs_needs_fewer_targets_than_components(flag):
    result = fit_morphs(flag, 0.005)
    assert plain_error(flag, len(result.targets)) > 1.5 * 0.005


def test_fit_morphs_needs_one_target_for_motion_of_rank_one():
    time = np.sin(np.arange(9.0))[:, None]
    frames = (time * np.random.default_rng(1).uniform(-1, 1, (1, 30))).astype(np.float32)
    result = fit_morphs(frames, 1e-4)
    assert (len(result.targets), result.error <= 1e-4) == (1, True)


@pytest.mark.slow
def test_rounding_becomes_finer_where_it_prevents_the_bound(flag, monkeypatch):
    monkeypatch.setattr(morphs, "ROUNDING_SHARE", 0.4)
    result = fit_morphs(flag, 0.003)
    assert result.error <= 0.003
    assert len(result.targets) < 40


def test_fit_morphs_returns_the_best_targets_if_integers_are_too_coarse(flag):
    result = fit_morphs(flag, 1e-7)
    assert 1e-7 < result.error < 1e-4


def test_float_targets_are_multiples_of_a_power_of_two(flag):
    targets = fit_morphs(flag, 0.002).targets
    steps = targets.stored(0) * 2**15
    assert targets.stored(0).dtype == np.float32
    np.testing.assert_array_equal(steps, np.rint(steps))


def test_integer_targets_are_bytes_where_those_suffice(flag):
    targets = fit_morphs(flag, 0.002, are_floats=False).targets
    assert set(targets.levels) == {BYTE, SHORT}
    assert {targets.stored(number).dtype for number in range(len(targets))} == {
        np.dtype(np.int8),
        np.dtype(np.int16),
    }


def test_measure_returns_the_errors_of_changed_weights(flag):
    result = fit_morphs(flag, 0.01)
    weights = result.weights.copy()
    weights[3] = 0
    errors = measure(result.targets, weights, flag).errors
    longest = np.linalg.norm(flag[3].reshape(3, -1), axis=0).max()
    assert errors[3] == pytest.approx(longest, rel=1e-6)
    others, before = np.delete(errors, 3), np.delete(result.errors, 3)
    np.testing.assert_allclose(others, before, rtol=1e-4, atol=1e-6 * longest)


def angles_deg(fitted, vertices, faces):
    """Return the angles between animated and original normals of every vertex and frame."""
    displacements = np.tensordot(
        fitted.morphs.weights[:, fitted.normals.numbers], fitted.normals.targets, 1
    )
    normals = fitted.normals.base + displacements
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    expected = np.stack([vertex_normals(frame, faces) for frame in vertices])
    return np.degrees(np.arccos(np.clip((normals * expected).sum(axis=2), -1, 1)))


@pytest.mark.slow
def test_normals_follow_a_fluttering_flag():
    flag = simulate_flag(30, n_rows=16, n_columns=16)
    options = WriteOptions(normals=True)
    fitted = fit_part(flag.vertices, flag.faces, 0.002, options)
    angles = angles_deg(fitted, flag.vertices, flag.faces)
    assert (angles.mean() < 1, angles.max() < 10, fitted.errors.max() <= 0.002) == (True,) * 3


def test_normals_follow_a_rotating_body():
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    body = np.concatenate([np.eye(3), -np.eye(3)])[[0, 3, 1, 4, 2, 5]]
    rotations = np.stack(
        [[np.cos(a), -np.sin(a), 0, np.sin(a), np.cos(a), 0, 0, 0, 1] for a in angles]
    )
    vertices = (body @ rotations.reshape(-1, 3, 3)).astype(np.float32)
    options = WriteOptions(normals=True)
    fitted = fit_part(vertices, octahedron_faces(), 0.002, options)
    assert angles_deg(fitted, vertices, octahedron_faces()).max() < 2


def test_normals_of_degenerate_faces_point_along_z():
    result = static_normals(np.zeros((3, 3), np.float32), np.array([[0, 1, 2]], np.int32))
    np.testing.assert_array_equal(result.base, np.tile(np.float32([0, 0, 1]), (3, 1)))


@pytest.mark.slow
@pytest.mark.parametrize("choice", [None, True])
def test_stated_angle_is_that_of_the_stored_normals(choice):
    flag = simulate_flag(24, n_rows=12, n_columns=12)
    fitted = fit_part(flag.vertices, flag.faces, 0.002, WriteOptions(normals=choice))
    measured = angles_deg(fitted, flag.vertices, flag.faces).mean()
    assert fitted.normals.angle_deg == pytest.approx(measured, rel=1e-2)


@pytest.mark.slow
def test_smooth_normals_need_fewer_targets_than_exact_ones():
    flag = simulate_flag(60, n_rows=20, n_columns=20)
    near, exact = (
        fit_part(flag.vertices, flag.faces, 0.0005, WriteOptions(normals=choice))
        for choice in (None, True)
    )
    assert len(near.normals.numbers) < 0.7 * len(exact.normals.numbers)
    assert near.normals.angle_deg < 5
    assert near.errors.max() <= 0.0005


def test_creased_mesh_has_normals_only_on_request():
    box = rich_cube(4)
    results = [
        fit_part(box.vertices, box.faces, 0.001, WriteOptions(normals=one))
        for one in (None, True, False)
    ]
    assert [result.normals is not None for result in results] == [False, True, False]


@pytest.mark.parametrize(("error_share", "n_targets"), [(1.01, 1), (0.99, 2), (0.2, 3)])
def test_fewest_targets_that_reach_the_error_of_normals_are_selected(error_share, n_targets):
    """Of three targets that change normals by 3, 2 and 1, the last two have a squared sum of 5."""
    rng = np.random.default_rng(4)
    basis, _ = np.linalg.qr(np.column_stack([np.ones(7), rng.standard_normal((7, 3))]))
    fields, _ = np.linalg.qr(rng.standard_normal((30, 3)))
    amounts = np.array([3.0, 2.0, 1.0])
    offsets = (basis[:, 1:] * amounts) @ fields.T
    weights = (basis[:, 1:] * amounts).astype(np.float32)
    length_error = error_share * np.sqrt(5 / (offsets.size / 3))
    result = select_normal_targets(weights, offsets.astype(np.float32), length_error)
    assert result.tolist() == list(range(n_targets))


QUADS = np.array([[0, 1, 2, 3], [1, 4, 5, 2]], np.int32)
CORNERS = QUADS.ravel()


def two_quads(*attributes, groups=(), n_verts=6):
    """Return two adjacent squares with corners 0 to 7."""
    faces = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]], np.int32)
    surface = Surface(np.array([4, 4], np.int32), attributes, groups)
    (part,) = split_parts(faces, surface.validated(n_verts, faces), n_verts, "squares")
    assert isinstance(part, PartMesh)
    return part


def attribute(kind, domain, values, dtype=np.float32, name="a"):
    return Attribute(name, kind, domain, np.asarray(values, dtype))


def uv(domain, values):
    return attribute(Kind.UV, domain, values)


def triangles(split):
    """Return the corners of all triangles as original vertices."""
    return np.concatenate(
        [split.sources[primitive.verts][primitive.triangles] for primitive in split.primitives]
    )


@pytest.mark.parametrize("n_verts", [6, 9])
def test_vertices_that_faces_use_are_not_split_without_seams(n_verts):
    split = split_at_seams(two_quads(n_verts=n_verts))
    assert split.sources.tolist() == list(range(6))
    assert triangles(split).tolist() == [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]]


def test_vertices_are_split_where_uvs_differ():
    values = np.zeros((8, 2))
    values[4] = 0.5, 0.25  # vertex 1, in the second square only
    split = split_at_seams(two_quads(uv(Domain.CORNER, values)))
    assert split.sources.tolist() == [0, 1, 1, 2, 3, 4, 5]
    written = split.attributes["TEXCOORD_0"]
    corner = np.flatnonzero((written == [0.5, 0.75]).all(axis=1))
    assert split.sources[corner].tolist() == [1]
    assert triangles(split).tolist() == [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]]


@pytest.mark.parametrize("kind", [Kind.OTHER, Kind.COLOR])
def test_vertices_are_not_split_for_the_sign_of_zero(kind):
    values = np.zeros((8, 3))
    values[4:] = -0.0
    split = split_at_seams(two_quads(attribute(kind, Domain.CORNER, values)))
    assert split.sources.tolist() == list(range(6))


def test_vertices_are_not_split_where_uvs_agree():
    values = np.array([[0.1, 0.2], [0.3, 0.4], [0.5, -0.0], [1, 0], [0, 0], [1, 1]])
    split = split_at_seams(two_quads(uv(Domain.CORNER, values[CORNERS])))
    assert split.sources.tolist() == list(range(6))
    expected = np.stack([values[:, 0], 1 - values[:, 1]], axis=1).astype(np.float32)
    np.testing.assert_array_equal(split.attributes["TEXCOORD_0"], expected)


def test_vertex_attributes_split_nothing():
    colors = np.arange(24).reshape(6, 4)
    split = split_at_seams(two_quads(attribute(Kind.COLOR, Domain.VERTEX, colors, np.uint8)))
    assert split.sources.tolist() == list(range(6))
    written = split.attributes["COLOR_0"]
    assert written.dtype == np.uint16
    np.testing.assert_array_equal(np.rint(255 * srgb(written / 0xFFFF)), colors)


def test_vertices_are_split_along_edges_where_face_colors_differ():
    colors = [[255, 0, 0], [0, 255, 0]]
    split = split_at_seams(two_quads(attribute(Kind.COLOR, Domain.FACE, colors, np.uint8)))
    assert split.sources.tolist() == [0, 1, 1, 2, 2, 3, 4, 5]
    corners = split.primitives[0].triangles
    expected = np.repeat(np.array(colors), 2, axis=0)[:, None].repeat(3, axis=1)
    np.testing.assert_array_equal(split.attributes["COLOR_0"][corners], expected)


def test_each_used_material_has_a_primitive():
    groups = (FaceGroups("material", ("unused", "red"), np.array([1, -1], np.int32)),)
    split = split_at_seams(two_quads(groups=groups))
    assert [primitive.material for primitive in split.primitives] == ["red", None]
    assert [split.sources[primitive.verts].tolist() for primitive in split.primitives] == [
        [0, 1, 2, 3],
        [1, 2, 4, 5],
    ]
    assert split.primitives[1].triangles.tolist() == [[0, 2, 3], [0, 3, 1]]


def test_attributes_of_the_same_kind_are_numbered():
    zeros = np.zeros((6, 2))
    own = attribute(Kind.OTHER, Domain.VERTEX, np.zeros((6, 1)), name="heat")
    split = split_at_seams(two_quads(uv(Domain.VERTEX, zeros), own, uv(Domain.VERTEX, zeros + 1)))
    assert list(split.attributes) == ["TEXCOORD_0", "_heat", "TEXCOORD_1"]


@pytest.mark.parametrize(
    ("values", "dtype", "expected"),
    [
        ([-1, 0.5, 1.5], np.float64, np.array([0, 0.21404114, 1], np.float32)),
        ([0, 255, 128], np.uint8, np.array([0, 0xFFFF, 14146], np.uint16)),
        ([-4, 300, 128], np.int32, np.array([0, 0xFFFF, 14146], np.uint16)),
    ],
)
def test_colors_are_clipped_to_the_valid_range(values, dtype, expected):
    colors = attribute(Kind.COLOR, Domain.VERTEX, np.tile(values, (6, 1)), dtype)
    result = split_at_seams(two_quads(colors)).attributes["COLOR_0"]
    assert result.dtype == expected.dtype
    np.testing.assert_array_equal(result, np.tile(expected, (6, 1)))


def test_describe_losses_names_what_gltf_cannot_store():
    wide = attribute(Kind.OTHER, Domain.VERTEX, np.zeros((6, 5)), name="wide")
    integer = attribute(Kind.OTHER, Domain.VERTEX, np.zeros((6, 1)), np.int32, "id")
    bright = attribute(Kind.COLOR, Domain.VERTEX, np.full((6, 3), 2.0), name="hot")
    groups = (FaceGroups("group", ("left",), np.zeros(2, np.int32)),)
    surface = two_quads(wide, integer, bright, groups=groups).surface  # of triangles
    assert list(describe_losses(surface, 4)) == [
        "clipped colors 'hot' to 0..1",
        "left out attribute 'wide': glTF does not support 5 components of float32",
        "left out attribute 'id': glTF does not support 1 components of int32",
        "left out face groups 'group': glTF supports only materials",
    ]


def test_the_fit_of_all_parts_and_segments_reports_a_share_that_rises(tmp_path):
    flag = meshreel.simulate_flag(6, n_rows=6, n_columns=8)
    both = meshreel.concatenate([flag, flag.replace(faces=flag.faces[::-1])])
    heard = []
    meshreel.save(both, tmp_path / "a.glb", progress=lambda *state: heard.append(state))
    shares = [share for stage, share in heard if stage == "morph targets"]
    assert shares == sorted(shares)
    assert (shares[0], 0.5 in shares, len(shares) > 10) == (0, True, True)
    assert 0.5 < shares[-1] < 1


RNG = np.random.default_rng(3)
ROWS, GOALS = RNG.normal(size=(5, 40)), RNG.normal(size=(7, 40))


def solution(rows):
    return solve_gram(rows @ rows.T, rows @ GOALS.T)


def test_weights_equal_those_of_lstsq():
    expected = np.linalg.lstsq(ROWS.T, GOALS.T, rcond=None)[0]
    np.testing.assert_allclose(solution(ROWS), expected, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("more", [ROWS[:1], 0 * ROWS[:1], ROWS[:1] + 1e-9 * ROWS[1:2]])
def test_weights_of_dependent_rows_have_minimum_norm(more):
    rows = np.concatenate([ROWS, more])
    weights = solution(rows)
    np.testing.assert_allclose(weights.T @ rows, solution(ROWS).T @ ROWS, atol=1e-6)
    assert np.abs(weights).max() < 10 * np.abs(solution(ROWS)).max()


@pytest.mark.parametrize("shape", [(0, 7), (0, 0)])
def test_no_rows_give_no_weights(shape):
    assert solve_gram(np.zeros((0, 0)), np.zeros(shape)).shape == shape
