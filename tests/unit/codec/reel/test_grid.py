"""Positions on a grid: error bounds, sizes, and grids of quantizers and of decimal text."""

from io import BytesIO

import numpy as np
import pytest

import meshreel
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.reel.encoding.stored_grid import coarse_grid
from meshreel.codec.reel.normative.grid import PositionGrid
from meshreel.codec.subspace.trajectories import BoundingFrame
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.model.extent import extent_of
from samples.meshes import irregular_sequence, waving_grid
from samples.shapes import torus
from samples.streams import Stream, parts_of, recorded

DOUBLE = np.float64
SEQUENCES = {
    "waves": waving_grid(9),
    "waves in doubles": waving_grid(9, dtype=DOUBLE),
    "one frame": waving_grid(1),
    "irregular": irregular_sequence(8),
    "far away": meshreel.MeshSequence(
        waving_grid(9).vertices.astype(DOUBLE) + 1e6, waving_grid(9).faces
    ),
    "large": meshreel.MeshSequence(
        waving_grid(9).vertices.astype(DOUBLE) * 1e200, waving_grid(9).faces
    ),
    "still": meshreel.MeshSequence(
        np.repeat(waving_grid(1).vertices, 300, axis=0), waving_grid(1).faces
    ),
}


def noisy(n_frames=40):
    """Waves with noise, which modes code twice."""
    sheet, rng = waving_grid(n_frames), np.random.default_rng(6)
    noise = rng.normal(size=sheet.vertices.shape) * 1e-3
    return meshreel.MeshSequence((sheet.vertices + noise).astype(np.float32), sheet.faces)


def assert_kept(sequence, data, percent):
    diagonal = meshreel.info(data).diagonal
    decoded = meshreel.decode(data)
    assert decoded.vertices.dtype == sequence.vertices.dtype
    apart = (decoded.vertices.astype(DOUBLE) - sequence.vertices) / diagonal
    assert np.linalg.norm(apart, axis=2).max() <= percent / 100


@pytest.mark.parametrize("percent", [1.0, 0.01, 0.0001])
@pytest.mark.parametrize("name", SEQUENCES)
def test_every_position_is_within_the_bound(name, percent):
    sequence = SEQUENCES[name]
    data = meshreel.encode(sequence, "grid", max_error=percent, block_frames=4)
    assert_kept(sequence, data, percent)
    info = meshreel.info(data)
    assert info.method == "grid"
    assert info.error_bound_percent == pytest.approx(percent)
    assert set(info.n_modes) == {0}
    assert not info.is_lossless


def test_bound_may_be_a_length():
    sequence = waving_grid(5)
    data = meshreel.encode(sequence, "grid", max_error="0.5mm", unit="m")
    assert np.abs(meshreel.decode(data).vertices - sequence.vertices).max() <= 0.0005
    assert meshreel.ReelFile(BytesIO(data)).error_bound == pytest.approx(0.0005)


def test_positions_are_lossless_when_the_grid_is_too_fine():
    sequence = SEQUENCES["waves in doubles"]
    data = meshreel.encode(sequence, "grid", max_error=1e-9)
    assert (meshreel.decode(data).vertices == sequence.vertices).all()


@pytest.mark.slow
def test_max_error_selects_the_grid_when_it_takes_fewer_bytes():
    sequence = noisy(3)
    data = meshreel.encode(sequence, max_error=1e-4)
    assert meshreel.info(data).method == "grid"
    assert data == meshreel.encode(sequence, "grid", max_error=1e-4)
    assert_kept(sequence, data, 1e-4)
    assert len(data) < len(meshreel.encode(sequence, max_error=1e-4, effort=5))


@pytest.mark.parametrize("options", [{"effort": 5}, {"tune": "geometry"}, {"n_modes": 30}])
def test_options_of_modes_exclude_the_grid(options):
    data = meshreel.encode(noisy(), max_error=1e-3, **options)
    assert meshreel.info(data).method == "reel"


def test_max_error_keeps_modes_when_they_take_fewer_bytes():
    assert meshreel.info(meshreel.encode(waving_grid(60), max_error=0.1)).method == "reel"


@pytest.mark.parametrize(("n_rows", "is_on_grid"), [(16, True), (80, False)])
def test_quality_of_a_single_frame_takes_the_smaller_of_grid_and_modes(n_rows, is_on_grid):
    vertices, faces = torus(n_rows, 2 * n_rows, bend=0.3)
    vertices += 0.2 * np.sin(3 * vertices[:, [1, 2, 0]])
    mesh = meshreel.MeshSequence(vertices[None].astype(np.float32), faces)
    data, modes = meshreel.encode(mesh), meshreel.encode(mesh, tune="visual")
    assert (meshreel.info(data).method == "grid") == is_on_grid
    assert len(data) <= len(modes)
    error = [
        meshreel.compare(mesh, meshreel.decode(one)).rms_error_percent for one in (data, modes)
    ]
    assert error[0] <= error[1]


@pytest.mark.slow
@pytest.mark.parametrize("percent", [1e-3, 2e-5])
def test_grid_never_takes_more_bytes_than_lossless(percent):
    sequence = noisy()
    exact = len(meshreel.encode(sequence, lossless=True))
    assert len(meshreel.encode(sequence, max_error=percent)) <= exact + 40


def test_live_frames_anywhere_are_within_the_bound():
    vertices = waving_grid(10).vertices * np.linspace(1, 40, 10, dtype=np.float32)[:, None, None]
    sequence = waving_grid(10).replace(vertices=vertices)
    data = recorded(sequence, block_frames=3, method="grid", max_error=0.001)
    bound = meshreel.ReelFile(BytesIO(data)).error_bound
    decoded = meshreel.decode(data).vertices.astype(DOUBLE)
    assert np.linalg.norm(decoded - vertices, axis=2).max() <= bound


def test_grid_requires_a_bound_or_a_step():
    with pytest.raises(InvalidInputError, match="rounds positions to a grid; set max_error"):
        meshreel.encode(waving_grid(2), "grid")


@pytest.mark.parametrize("n_frames", [1, 5])
def test_step_is_that_of_the_grid(n_frames):
    sequence = waving_grid(n_frames)
    data = meshreel.encode(sequence, "grid", step=0.01)
    info = meshreel.info(data)
    assert info.error_bound_percent is None
    apart = np.abs(meshreel.decode(data).vertices - sequence.vertices) / info.diagonal
    assert 0.004 < apart.max() <= 0.00501


def test_grid_has_no_modes():
    data = meshreel.encode(waving_grid(2), "grid", max_error=0.1)
    with pytest.raises(InvalidInputError, match="a stream of method grid has no modes"):
        meshreel.ReelFile(BytesIO(data), n_modes=3)


def test_positions_beyond_the_number_type_are_refused():
    far = PositionGrid(1.0, BoundingFrame((0.0, 0.0, 0.0), 1e35))
    with pytest.raises(CorruptStreamError, match="go beyond the numbers of type float32"):
        far.positions(np.full((1, 1, 3), 2**30, np.int32), np.float32)


def rough_sheet():
    """One frame without any pattern in its coordinates."""
    sheet, rng = waving_grid(1, rows=60, columns=60), np.random.default_rng(3)
    noise = rng.normal(scale=0.03, size=sheet.vertices.shape)
    return sheet.replace(vertices=(sheet.vertices + noise).astype(np.float32))


SHEET = rough_sheet()


def quantized(digits=None, dtype=np.float32):
    """Return the sheet on a grid of 9 bits, without -0, optionally read from text of few digits."""
    step = np.ptp(SHEET.vertices) / 511
    values = (np.rint(SHEET.vertices / step) * step).astype(np.float32) + np.float32(0)
    if digits is not None:
        values = np.array([float(f"{value:.{digits}g}") for value in values.ravel()], dtype)
    return SHEET.replace(vertices=values.reshape(SHEET.vertices.shape))


def sections_of(data):
    return {section for section, _ in parts_of(Stream(data))}


def assert_exact(sequence, data):
    decoded = meshreel.decode(data).vertices
    assert decoded.dtype == sequence.vertices.dtype
    assert decoded.tobytes() == sequence.vertices.tobytes()


@pytest.mark.parametrize(
    ("options", "digits"),
    [
        ({}, None),
        ({}, 7),
        ({"lossless": True}, 6),
        ({"lossless": True}, 7),
        ({"max_error": 0.1}, 7),
    ],
)
def test_grid_is_exact_and_takes_a_third_of_lossless(options, digits):
    sequence = quantized(digits)
    data = meshreel.encode(sequence, order="keep", **options)
    assert Section.ROUNDING in sections_of(data)
    assert_exact(sequence, data)
    assert 3 * len(data) < len(meshreel.encode(SHEET, lossless=True, order="keep"))


@pytest.mark.parametrize("target", [{"quality": 80}, {"max_error": 0.1}, {"kg": 0.05}])
@pytest.mark.parametrize(("options", "is_on_grid"), [({}, True), ({"effort": 5}, False)])
def test_shape_of_several_frames_is_stored_on_its_grid_unless_an_option_needs_modes(
    target, options, is_on_grid
):
    vertices = np.repeat(quantized().vertices, 3, axis=0)
    data = meshreel.encode(SHEET.replace(vertices=vertices), order="keep", **target, **options)
    assert (Section.ROUNDING in sections_of(data)) == is_on_grid
    assert (meshreel.decode(data).vertices.tobytes() == vertices.tobytes()) == is_on_grid


def test_negative_zeros_are_kept():
    values = quantized(7).vertices.copy()
    on_axis = values[0, :, 2] == values[0, 0, 2]
    values[0, :, 2] -= values[0, 0, 2]
    values[0, on_axis, 2] = -0.0
    sequence = SHEET.replace(vertices=values)
    assert np.signbit(values[values == 0]).any()
    assert_exact(sequence, meshreel.encode(sequence, lossless=True, order="keep"))


def test_values_that_share_a_coordinate_are_stored_without_the_grid():
    values = quantized().vertices.copy()
    values[0, 5] = np.nextafter(values[0, 5], np.float32(9))
    sequence = SHEET.replace(vertices=values)
    data = meshreel.encode(sequence, lossless=True, order="keep")
    assert Section.ROUNDING not in sections_of(data)
    assert_exact(sequence, data)


def test_doubles_that_text_rounded_are_exact_when_lossless():
    sequence = quantized(7, np.float64)
    assert_exact(sequence, meshreel.encode(sequence, lossless=True, order="keep"))


def on_coarse_grid(noise, n_more=0):
    """Positions near a grid of 10 cells along the longest side, far from the origin, and others."""
    rng = np.random.default_rng(8)
    cells = np.concatenate([[[0, 0, 0], [10, 4, 7]], rng.integers(0, (11, 5, 8), (200, 3))])
    more = rng.uniform((0, 0, 0), (10, 4, 7), (n_more, 3))
    positions = 0.25 * np.concatenate([cells, more]) + (40, -3, 9)
    return positions + rng.uniform(-noise, noise, positions.shape)


def coarse_grid_of(*frames, tolerance):
    """Return the coarse grid of frames of shape (V, 3)."""
    return coarse_grid(len(frames), frames.__getitem__, extent_of(np.stack(frames)), tolerance)


def test_coarse_grid_is_found_within_the_tolerance():
    positions = on_coarse_grid(noise=1e-3)
    step, origin = coarse_grid_of(positions, tolerance=3e-3)
    assert step == pytest.approx(0.25, rel=2e-3)
    cells = (positions - origin) / step
    assert np.abs(cells - np.rint(cells)).max() * step < 4e-3
    assert coarse_grid_of(positions, tolerance=5e-4) is None


def test_a_single_position_off_a_coarse_grid_excludes_it():
    positions = on_coarse_grid(0.0, n_more=1)
    assert coarse_grid_of(positions, tolerance=1e-3) is None
    on_grid = np.concatenate([positions[:-1], positions[:1]])
    assert coarse_grid_of(on_grid, positions, tolerance=1e-3) is None
    assert coarse_grid_of(np.zeros((5, 3)), tolerance=1e-3) is None


@pytest.mark.parametrize("target", [{"max_error": 0.1}, {"quality": 80}])
@pytest.mark.parametrize("n_frames", [1, 3])
def test_positions_near_a_coarse_grid_are_stored_on_it(target, n_frames):
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    faces = [[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4]]
    moving = np.stack([corners + np.float32([i, 0, 0]) for i in range(n_frames)])
    pyramid = meshreel.MeshSequence(moving, np.array(faces))
    shaken = np.random.default_rng(1).normal(size=moving.shape) * 0.01
    other = pyramid.replace(vertices=(moving + shaken).astype(np.float32))
    data = meshreel.encode(pyramid, **target)
    np.testing.assert_allclose(meshreel.decode(data).vertices, moving, atol=1e-6)
    assert len(data) <= len(meshreel.encode(other, **target)) - 12
