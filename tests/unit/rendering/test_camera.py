import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.model.extent import Extent
from meshreel.model.sequence import MeshSequence
from meshreel.rendering.camera import Camera, fit_camera
from meshreel.rendering.scenes import SelectedFrames
from meshreel.rendering.shots import MIN_DISTANCE_RATIO, Framing, framing_of
from meshreel.rendering.views import NAMED_VIEWS, View, guess_up, parse_view

VIEWS = [(0, 0), (30, 12), (200, -35), (-75, 90), (10, -90)]


def cloud(*shape):
    return np.random.default_rng(5).normal(size=(*shape, 3)) * [3, 1, 2] + [10, -4, 7]


@pytest.mark.parametrize(("azimuth_deg", "elevation_deg"), VIEWS)
@pytest.mark.parametrize(("width", "height"), [(300, 200), (120, 400)])
def test_fit_camera_keeps_every_vertex_inside_the_margin_in_all_directions(
    azimuth_deg, elevation_deg, width, height
):
    vertices = cloud(6, 50)
    camera = fit_camera(
        vertices,
        azimuth_deg=azimuth_deg,
        elevation_deg=elevation_deg,
        width=width,
        height=height,
        margin=0.1,
    )
    points, _ = camera.project(vertices)
    border = 0.1 * min(width, height) - 1e-6
    low, high = points.min(axis=(0, 1)), points.max(axis=(0, 1))
    assert (low >= border).all()
    assert (high <= np.array([width, height]) - border).all()


@pytest.mark.parametrize(("azimuth_deg", "elevation_deg"), VIEWS)
def test_fit_camera_fills_the_picture_up_to_the_margin(azimuth_deg, elevation_deg):
    vertices = cloud(300)
    camera = fit_camera(
        vertices, azimuth_deg=azimuth_deg, elevation_deg=elevation_deg, width=400, height=400
    )
    points, _ = camera.project(vertices)
    assert np.ptp(points, axis=0).max() == pytest.approx(400 * (1 - 2 * 0.06), abs=1e-6)


@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_fit_camera_shows_the_top_above_when_an_axis_is_up(up):
    ends = np.zeros((2, 3))
    ends[1, "xyz".index(up)] = 1
    points, _ = fit_camera(ends, up=up).project(ends)
    assert points[1, 1] < points[0, 1] - 100


def test_fit_camera_shows_x_to_the_right_when_looking_at_the_front():
    ends = np.array([[0.0, 0, 0], [1, 0, 0]])
    points, _ = fit_camera(ends, azimuth_deg=0).project(ends)
    assert points[1, 0] > points[0, 0] + 100


def test_fit_camera_looks_at_the_front_from_positive_z():
    ends = np.array([[0.0, 0, 0], [0, 0, 1]])
    _, depths = fit_camera(ends, azimuth_deg=0, elevation_deg=0).project(ends)
    assert depths[1] == pytest.approx(depths[0] - 1)


def test_fit_camera_moves_to_the_right_with_the_azimuth():
    assert fit_camera(cloud(20), azimuth_deg=40).axes[2, 0] < 0


def test_fit_camera_centers_a_single_point():
    camera = fit_camera(np.full((1, 3), 7.0), width=64, height=48)
    points, depths = camera.project(np.full((1, 3), 7.0))
    np.testing.assert_allclose(points[0], [32, 24])
    assert depths[0] > 0


def test_fit_camera_is_the_same_for_frames_and_for_one_cloud():
    vertices = cloud(4, 9)
    framed, merged = fit_camera(vertices), fit_camera(vertices.reshape(-1, 3))
    np.testing.assert_allclose(framed.eye, merged.eye, rtol=1e-12)  # BLAS may reorder sums


@pytest.mark.parametrize(
    ("vertices", "arguments"),
    [
        (np.full((2, 3), np.nan), {}),
        (np.full((2, 3), np.inf), {}),
        (np.zeros((2, 2)), {}),
        (np.zeros((0, 3)), {}),
        (np.zeros((2, 3)), {"up": "w"}),
        (np.zeros((2, 3)), {"margin": 0.5}),
        (np.zeros((2, 3)), {"elevation_deg": 91}),
        (np.zeros((2, 3)), {"azimuth_deg": float("nan")}),
        (np.zeros((2, 3)), {"width": 0}),
    ],
)
def test_fit_camera_rejects_invalid_arguments(vertices, arguments):
    with pytest.raises(InvalidInputError):
        fit_camera(vertices, **arguments)


def test_camera_rejects_axes_that_are_not_orthonormal():
    with pytest.raises(InvalidInputError, match="orthonormal"):
        Camera(np.zeros(3), 2 * np.eye(3), 100.0, 10, 10)


def test_project_has_no_point_when_a_vertex_is_behind_the_eye():
    camera = Camera(np.zeros(3), np.eye(3), 100.0, 10, 10)
    points, depths = camera.project(np.array([[3.0, 1, -2], [3, 1, 0]]))
    np.testing.assert_array_equal(points, 0)
    np.testing.assert_array_equal(depths, [-2, 0])


@pytest.mark.parametrize("name", NAMED_VIEWS)
def test_parse_view_returns_the_angles_of_a_name(name):
    assert parse_view(name, "z") == View("z", *NAMED_VIEWS[name])


def test_parse_view_returns_explicit_angles():
    assert parse_view("-20,35.5", "y") == View("y", -20.0, 35.5)


@pytest.mark.parametrize("text", ["behind", "1", "1,2,3", "a,b", ""])
def test_parse_view_lists_the_views_when_the_text_is_invalid(text):
    with pytest.raises(InvalidInputError, match="front, side, top or AZIMUTH,ELEVATION"):
        parse_view(text, "y")


@pytest.mark.parametrize(
    ("low", "high", "up"),
    [
        ((-1, 0, -1), (1, 2, 1), "y"),
        ((-1, -1, 0), (1, 1, 2), "z"),
        ((-1, -1, 0.05), (1, 1, 2), "z"),
        ((-1, 0, 0), (1, 2, 2), "y"),  # on both floors
        ((-1, -1, -1), (1, 1, 1), "y"),  # on neither
        ((0, -1, 0), (3, 1, 0), "y"),  # flat, seen from the front
        ((0, 0, 0), (0, 0, 0), "y"),
    ],
)
def test_guess_up_is_z_when_the_mesh_is_only_on_that_floor(low, high, up):
    assert guess_up(Extent(np.array(low, float), np.array(high, float), 1.0)) == up


@pytest.mark.parametrize(("size", "aspect"), [((4, 1, 0), 4.0), ((1, 2, 0), 0.5)])
def test_view_aspect_is_that_of_a_rectangle_when_it_is_seen_from_the_front(size, aspect):
    corners = np.array([[x, y, 0.0] for x in (0, size[0]) for y in (0, size[1])])
    assert View("y", 0.0, 0.0).aspect([corners]) == pytest.approx(aspect, rel=0.01)


def test_view_aspect_is_one_when_all_vertices_are_one_point():
    assert View().aspect([np.zeros((3, 3))]) == 1


FRONT = View("y", 0.0, 0.0)


def travelling(sequence, step):
    """The sequence, moving to the right by `step` per frame."""
    steps = np.arange(sequence.n_frames)[:, None] * np.array([step, 0, 0])
    vertices = sequence.vertices + steps[:, None]
    return SelectedFrames(sequence.replace(vertices=vertices), range(0, sequence.n_frames, 3))


def test_static_camera_sees_all_frames(grid):
    frames = travelling(grid, 0.5)
    cameras = Framing(FRONT).cameras(frames, 300, 200)
    assert len(cameras) == len(frames.numbers)
    assert all(camera is cameras[0] for camera in cameras)
    points = np.array([cameras[0].project(frame)[0] for frame in frames])
    assert points.min() >= 0
    assert points[..., 0].max() <= 300
    assert np.ptp(points[..., 0]) > 240


def test_following_camera_keeps_the_mean_vertex_in_place(grid):
    frames = travelling(grid, 0.5)
    cameras = Framing(FRONT, is_followed=True).cameras(frames, 300, 200)
    middles = [
        camera.project(frame.mean(axis=0, dtype=np.float64)[None])[0][0]
        for camera, frame in zip(cameras, frames, strict=True)
    ]
    assert np.ptp(middles, axis=0) == pytest.approx([0, 0], abs=1e-6)
    steps = np.diff([camera.eye for camera in cameras], axis=0)
    motion = np.diff([frame.mean(axis=0, dtype=np.float64) for frame in frames], axis=0)
    assert steps == pytest.approx(motion)


def test_aspect_of_a_following_camera_is_that_of_one_frame(grid):
    frames = travelling(grid, 0.5)
    assert Framing(FRONT).aspect(frames) > 3 * Framing(FRONT, is_followed=True).aspect(frames)


def distance_ratio(frames):
    """Ratio of the distance of a static camera to that of one that follows."""
    static = Framing(FRONT).cameras(frames, 512, 512)
    following = Framing(FRONT, is_followed=True).cameras(frames, 512, 512)
    far, near = (
        np.mean([(frame.mean(axis=0, dtype=np.float64) - camera.eye) @ camera.axes[2]
                 for camera, frame in zip(cameras, frames, strict=True)])
        for cameras in (static, following)
    )  # fmt: skip
    return far / near


def test_camera_follows_if_that_brings_it_much_nearer(grid):
    steps = np.linspace(0, 0.05, 26)
    ratios = [distance_ratio(travelling(grid, step)) for step in steps]
    followed = [framing_of(FRONT, travelling(grid, step)).is_followed for step in steps]
    assert min(ratios) < 1.1 < MIN_DISTANCE_RATIO == 1.15 < 1.2 < max(ratios)
    assert followed == [ratio > MIN_DISTANCE_RATIO for ratio in ratios]


@pytest.mark.parametrize("is_followed", [True, False])
def test_explicit_choice_overrides_the_default(grid, is_followed):
    for step in (0.0, 0.5):
        frames = travelling(grid, step)
        assert framing_of(FRONT, frames, is_followed=is_followed).is_followed == is_followed


def test_a_following_camera_does_not_jump_where_the_faces_change(grid):
    """Vertices that are added in a corner move their mean, but not the surface."""
    still = grid.replace(vertices=np.repeat(grid.vertices[:1], 4, axis=0))
    corner = np.repeat(still.vertices[:, :1], 200, axis=1)
    dense = still.replace(vertices=np.concatenate([still.vertices, corner], axis=1))
    frames = SelectedFrames(MeshSequence.of_segments([still, dense]), range(8))
    eyes = np.array(
        [camera.eye for camera in Framing(FRONT, is_followed=True).cameras(frames, 300, 200)]
    )
    means = np.array([frame.mean(axis=0) for frame in frames])
    assert np.ptp(means, axis=0).max() > 0.2
    assert np.ptp(eyes, axis=0).max() < 1e-6
