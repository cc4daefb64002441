import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.model.flag import simulate_flag
from meshreel.rendering.camera import Camera, fit_camera
from meshreel.rendering.rasterizer import PAPER, render
from meshreel.rendering.visibility import inverse_depths, visible_faces

TRIANGLE = np.array([[-1.0, -1, 0], [1, -1, 0], [-1, 1, 0]])
FACE = np.array([[0, 1, 2]])
SIZE = {"width": 120, "height": 90}


def front(vertices, **arguments):
    return fit_camera(vertices, **{"azimuth_deg": 0, "elevation_deg": 0, **SIZE, **arguments})


def covered(picture, background=PAPER):
    return (picture != np.array(background, np.uint8)).any(axis=2)


def sphere():
    """A closed latitude-longitude sphere whose poles are degenerate faces."""
    theta, phi = np.meshgrid(np.linspace(0, np.pi, 25), np.linspace(0, 2 * np.pi, 49)[:-1])
    x, y, z = np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)
    vertex = np.arange(48 * 25).reshape(48, 25)
    a, b = vertex[:, :-1], vertex[:, 1:]
    c, d = np.roll(b, -1, axis=0), np.roll(a, -1, axis=0)
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)
    return np.stack([x, y, z], axis=-1).reshape(-1, 3), faces


@pytest.mark.parametrize("order", [[0, 1], [1, 0]])
def test_render_shows_the_nearer_triangle(order):
    hidden = 0.5 * TRIANGLE - [0.25, 0.25, 0.5]  # no edge of both in the same pixels
    vertices = np.concatenate([TRIANGLE, hidden])
    colors = np.repeat([[250, 0, 0], [0, 0, 250]], 3, axis=0)
    faces = np.array([[0, 1, 2], [3, 4, 5]])[order]
    picture = render(vertices, faces, front(TRIANGLE), colors=colors, supersample=1)
    red = picture[covered(picture)]
    assert (red[:, 0] > red[:, 2]).all()


def test_render_shades_both_sides_of_a_face_alike():
    camera = front(TRIANGLE)
    np.testing.assert_array_equal(
        render(TRIANGLE, FACE, camera), render(TRIANGLE, FACE[:, ::-1], camera)
    )


@pytest.mark.parametrize(
    "faces", [FACE[:, ::-1], np.concatenate([FACE, FACE[:, ::-1]])], ids=["back", "both sides"]
)
def test_render_lights_back_faces_and_those_with_canceling_normals(faces):
    assert render(TRIANGLE, faces, front(TRIANGLE))[60, 40].min() > 100


def test_render_is_invariant_to_common_rotation_of_mesh_and_camera():
    vertices, faces = sphere()
    vertices = vertices * [1.0, 0.6, 0.8]
    turned = vertices[:, [2, 1, 0]] * [1, 1, -1]
    expected = render(vertices, faces, front(vertices)).astype(int)
    actual = render(turned, faces, front(turned, azimuth_deg=90))
    assert np.abs(actual - expected).max() <= 1


def test_render_interpolates_colors_in_perspective():
    """The midpoint of the strip in space is far above its midpoint in the picture."""
    strip = np.array([[-1.0, 0, 0], [1, 0, 0], [1, 0, -40], [-1, 0, -40]])
    colors = [[250, 0, 0], [250, 0, 0], [0, 0, 250], [0, 0, 250]]
    camera = front(strip, elevation_deg=15, width=200, height=200)
    picture = render(strip, [[0, 1, 2], [0, 2, 3]], camera, colors=colors, supersample=1)
    (x, y), _ = camera.project(np.array([0.0, 0, -20]))
    red, _, blue = picture[int(y), int(x)].astype(int)
    assert abs(red - blue) < 12


@pytest.mark.parametrize("smooth", [False, True])
def test_flat_render_has_one_tone_per_face_and_smooth_render_gradual_ones(smooth):
    roof = np.array([[0.0, -1, 1], [0, 1, 1], [-1, 0, 0], [1, 0, 0]])
    faces = [[0, 1, 2], [0, 3, 1]]
    picture = render(roof, faces, front(roof), smooth=smooth, supersample=1)
    n_tones = len(np.unique(picture.reshape(-1, 3), axis=0))
    assert n_tones > 20 if smooth else n_tones == 2 + 1


def test_supersampling_softens_outlines():
    tones = [
        len(np.unique(render(TRIANGLE, FACE, front(TRIANGLE), supersample=factor)[:, :, 0]))
        for factor in (1, 4)
    ]
    assert tones[0] == 2 < tones[1]


@pytest.mark.parametrize(
    "vertices",
    [TRIANGLE - [0, 0, -100], TRIANGLE - [-50, 0, 0], TRIANGLE * [1, 0, 0], TRIANGLE * 0],
    ids=["behind", "beside", "line", "point"],
)
def test_render_without_visible_faces_is_background(vertices):
    picture = render(vertices, FACE, front(TRIANGLE), background=(1, 2, 3))
    assert not covered(picture, (1, 2, 3)).any()


def test_render_does_not_modify_its_arguments():
    vertices, colors = TRIANGLE.copy(), np.full((3, 3), 90.0)
    render(vertices, FACE, front(TRIANGLE), colors=colors)
    np.testing.assert_array_equal(vertices, TRIANGLE)
    np.testing.assert_array_equal(colors, 90.0)


@pytest.mark.parametrize(
    "arguments",
    [
        {"vertices": TRIANGLE[:, :2]},
        {"vertices": TRIANGLE * np.nan},
        {"faces": FACE + 1},
        {"faces": FACE[:0]},
        {"colors": np.zeros((2, 3))},
        {"colors": (0, 0, 300)},
        {"colors": (0, 0, np.nan)},
        {"supersample": 0},
        {"supersample": 9},
        {"supersample": 1.5},
    ],
    ids=str,
)
def test_render_rejects_invalid_arguments(arguments):
    valid = {"vertices": TRIANGLE, "faces": FACE, "camera": front(TRIANGLE)}
    with pytest.raises(InvalidInputError):
        render(**{**valid, **arguments})


def test_glow_1_shows_unlit_colors():
    picture = render(TRIANGLE, FACE, front(TRIANGLE), colors=(10, 130, 250), glow=1.0)
    assert picture[60, 40].tolist() == [10, 130, 250]


def test_corner_colors_give_sharp_edges_between_faces():
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    colors = np.repeat([[[255, 0, 0]], [[0, 0, 255]]], 3, axis=1)
    picture = render(square, faces, front(square), colors=colors, glow=1.0, supersample=1)
    seen = picture[covered(picture)]
    assert {tuple(color) for color in seen.tolist()} == {(255, 0, 0), (0, 0, 255)}


@pytest.mark.slow
@pytest.mark.parametrize("smooth", [True, False])
def test_supersampled_render_equals_a_reduced_larger_picture(smooth):
    sequence = simulate_flag(8, n_rows=12, n_columns=16)
    vertices = sequence.vertices[7]
    camera = front(vertices)
    large = front(vertices, width=3 * SIZE["width"], height=3 * SIZE["height"])
    actual = render(vertices, sequence.faces, camera, smooth=smooth, supersample=3).astype(float)
    single = render(vertices, sequence.faces, large, smooth=smooth, supersample=1).astype(float)
    expected = single.reshape(SIZE["height"], 3, SIZE["width"], 3, 3).mean(axis=(1, 3))
    assert np.abs(actual - expected).max() < 4


@pytest.mark.parametrize("glow", [-0.1, 1.5, float("nan")])
def test_render_rejects_a_glow_outside_0_to_1(glow):
    with pytest.raises(InvalidInputError, match=r"glow must be in 0\.\.1"):
        render(TRIANGLE, FACE, front(TRIANGLE), glow=glow)


def flat_camera(width, height):
    return Camera(np.zeros(3), np.eye(3), 1.0, width, height)


def seen(points, faces, *, depths=None, size=(100, 80)):
    depths = np.ones(len(points)) if depths is None else np.asarray(depths, float)
    camera = flat_camera(*size)
    size = camera.width, camera.height
    return visible_faces(np.asarray(points, float), inverse_depths(depths), np.asarray(faces), size)


@pytest.mark.parametrize("order", [[0, 1, 2], [0, 2, 1], [2, 0, 1]])
def test_visible_faces_covers_the_area_of_a_triangle(order):
    points = np.array([[3.2, 5.1], [95.7, 12.3], [40.4, 77.9]])
    ab, ac = points[1] - points[0], points[2] - points[0]
    area = abs(ab[0] * ac[1] - ab[1] * ac[0]) / 2
    assert (seen(points, [order]) == 0).sum() == pytest.approx(area, rel=0.02)


def test_visible_faces_covers_each_pixel_of_adjacent_faces_once():
    """Irregular faces tile the whole picture: their areas add up to it."""
    rng = np.random.default_rng(2)
    grid = np.stack(np.meshgrid(np.linspace(0, 100, 12), np.linspace(0, 80, 9)), axis=-1)
    grid[1:-1, 1:-1] += rng.uniform(-3, 3, (7, 10, 2))
    vertex = np.arange(108).reshape(9, 12)
    a, b, c, d = vertex[:-1, :-1], vertex[1:, :-1], vertex[1:, 1:], vertex[:-1, 1:]
    faces = np.concatenate(
        [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([c, d, a], -1).reshape(-1, 3)]
    )
    points = grid.reshape(-1, 2)
    assert sum((seen(points, [face]) == 0).sum() for face in faces) == 8000
    assert (seen(points, faces) >= 0).all()


def test_visible_faces_of_crossing_faces_changes_at_their_intersection():
    """Along x one face recedes and the other comes nearer: equal depth, in 1/z, at x = 50."""
    points = [[0, -500], [100, 40], [0, 580], [100, -500], [0, 40], [100, 580]]
    ids = seen(points, [[0, 1, 2], [3, 4, 5]], depths=[1, 3, 1, 1, 3, 1]).reshape(80, 100)
    assert (ids[:, :50] == 0).all()
    assert (ids[:, 50:] == 1).all()


def test_visible_faces_fills_the_picture_with_a_huge_face():
    assert (seen([[-1e9, -1e9], [1e9, -1e9], [0, 1e9]], [[0, 1, 2]]) == 0).all()


@pytest.mark.parametrize(
    "points",
    [
        [[5, 5], [5, 5], [5, 5]],
        [[5, 5], [50, 50], [95, 95]],
        [[5, 7.5], [50, 7.5], [95, 7.5]],
        [[200, 5], [300, 5], [200, 60]],
        [[-20, 5], [-10, 5], [-20, 60]],
        [[5, 200], [50, 200], [5, 260]],
    ],
)
def test_visible_faces_ignores_degenerate_and_outside_faces(points):
    assert (seen(points, [[0, 1, 2]]) == -1).all()


def test_visible_faces_omits_faces_that_reach_behind_the_eye():
    points = [[0, 0], [99, 0], [0, 79], [99, 79]]
    ids = seen(points, [[0, 1, 2], [1, 2, 3]], depths=[-1, 1, 1, 1])
    assert set(ids) == {-1, 1}


def test_visible_faces_is_empty_behind_the_eye():
    assert (seen([[0, 0], [99, 0], [0, 79]], [[0, 1, 2]], depths=[-1, -2, 0]) == -1).all()


def test_visible_faces_agrees_with_a_plain_loop():
    rng = np.random.default_rng(8)
    points, depths = rng.uniform(-20, 120, (60, 2)), rng.uniform(1, 5, 60)
    faces = np.arange(60).reshape(20, 3)
    x, y = np.meshgrid(np.arange(100) + 0.5, np.arange(80) + 0.5)
    best, expected = np.zeros((80, 100)), np.full((80, 100), -1)
    for number, face in enumerate(faces):
        matrix = np.vstack([points[face].T, np.ones(3)])
        weights = np.linalg.solve(matrix, np.stack([x, y, np.ones_like(x)]).reshape(3, -1))
        near = (weights * (1 / depths[face])[:, None]).sum(axis=0).reshape(x.shape)
        inside = (weights >= 0).all(axis=0).reshape(x.shape) & (near > best)
        best[inside], expected[inside] = near[inside], number
    ids = seen(points, faces, depths=depths).reshape(80, 100)
    assert (ids == expected).mean() > 0.999
