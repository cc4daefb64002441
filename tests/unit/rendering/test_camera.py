import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.rendering.camera import Camera, fit_camera

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
