from typing import Any

import numpy as np
import pytest
from PIL import Image

from meshreel.errors import InvalidInputError
from meshreel.model.frame_choice import spread_frames
from meshreel.model.sequence import MeshSequence
from meshreel.rendering.scenes import Scene
from meshreel.rendering.shots import frame_labels, representative_frames
from meshreel.rendering.stills import save_png, still
from meshreel.rendering.views import View


def panel():
    return np.full((120, 160, 3), (200, 10, 10), np.uint8)


def test_save_png_round_trips_pixels(tmp_path):
    pixels = np.random.default_rng(1).integers(0, 256, (9, 7, 3), np.uint8)
    save_png(pixels, tmp_path / "noise.png")
    with Image.open(tmp_path / "noise.png") as image:
        np.testing.assert_array_equal(np.asarray(image), pixels)


@pytest.mark.parametrize("image", [panel().astype(float), panel()[:, :, 0]])
def test_save_png_rejects_invalid_pictures(image, tmp_path):
    with pytest.raises(InvalidInputError, match="a picture must be"):
        save_png(image, tmp_path / "new.png")


def test_save_png_does_not_overwrite_a_file_by_default(tmp_path):
    (tmp_path / "old.png").write_bytes(b"old")
    with pytest.raises(InvalidInputError, match="exists"):
        save_png(panel(), tmp_path / "old.png")
    assert (tmp_path / "old.png").read_bytes() == b"old"


def test_save_png_replaces_a_file_with_overwrite(tmp_path):
    (tmp_path / "old.png").write_bytes(b"old")
    save_png(panel(), tmp_path / "old.png", overwrite=True)
    assert (tmp_path / "old.png").read_bytes().startswith(b"\x89PNG")


FRONT = View("y", 0.0, 0.0)


def inked(picture):
    return (np.asarray(picture) != 255).any(axis=2)


def test_single_frame_fills_the_still(grid):
    picture = inked(still(Scene(grid), [0], FRONT, size=(300, 240)))
    assert picture.shape == (240, 300)
    rows, columns = np.flatnonzero(picture.any(axis=1)), np.flatnonzero(picture.any(axis=0))
    margin = round(0.06 * 240)
    touches = [rows[0], 239 - rows[-1], columns[0], 299 - columns[-1]]
    assert min(touches) == pytest.approx(margin, abs=2)
    box = np.ptp(rows) * np.ptp(columns)
    assert 0.9 < picture.sum() / box <= 1.01  # a sheet from the front is a rectangle


@pytest.mark.slow
def test_still_has_a_mesh_for_each_frame(grid):
    single, several = (
        inked(still(Scene(grid), numbers, FRONT, size=(640, 480))).mean()
        for numbers in ([0], range(8))
    )
    assert 0.3 < several < single


def test_still_centers_every_frame_of_a_mesh_that_moves_a_little(grid):
    far = np.linspace(0, 0.6, grid.n_frames) * np.ptp(grid.vertices[..., 0])
    moved = grid.vertices + far[:, None, None] * np.array([1.0, 0.0, 0.0])
    scene = Scene(MeshSequence(moved.astype(np.float32), grid.faces))
    default, static = (
        inked(still(scene, [0, 11], FRONT, size=(600, 240), is_followed=follow))[:200]
        for follow in (None, False)
    )

    def off_center(ink):
        halves = np.split(ink.any(axis=0), 2)
        return max(abs(np.flatnonzero(half).mean() - 150) for half in halves)

    assert off_center(default) < 10 < 30 < off_center(static)


def test_heat_map_is_shaded_but_stays_close_to_its_color(grid):
    """Without errors, a heat map has one color, which is darker in folds."""
    picture = np.asarray(still(Scene(grid, grid, "distance"), [3], View(), size=(900, 300)))
    left = picture.shape[1] * 2 // 3
    heat = picture[60:250, left : left + 130].reshape(-1, 3).astype(int)
    violet = heat[(heat[:, 2] - heat[:, 1] > 40) & (heat.max(axis=1) < 160)]
    assert len(violet) > 500
    darkest, lightest = np.percentile(violet.sum(axis=1), (2, 90))
    assert 20 < lightest - darkest < 60


def test_still_is_reproducible(grid, lifted):
    scene = Scene(lifted, grid, "sted")
    first, second = (
        still(scene, [0, 5], FRONT, size=(640, 480), caption="twice").tobytes() for _ in range(2)
    )
    assert first == second


@pytest.mark.parametrize(("height", "bar_height"), [(300, 150), (110, 30)])
def test_heat_map_has_a_color_bar_with_numbers(grid, lifted, height, bar_height):
    without, with_heat = (
        np.asarray(still(Scene(lifted, grid, heat), [3], FRONT, size=(900, height)))
        for heat in (None, "distance")
    )
    saturation = np.ptp(with_heat[:, -120:].astype(int), axis=2)
    assert ((saturation > 60).sum(axis=0) > bar_height).sum() > 10  # a bar, high and wide
    assert np.ptp(without[:, -20:].astype(int), axis=2).max() < 60
    dark = (with_heat[:, -60:].max(axis=2) < 140).sum()
    assert dark > 40  # letters


def test_still_reports_progress(grid, lifted):
    calls: list[tuple[str, Any]] = []
    still(
        Scene(lifted, grid, "angle"), [0, 4], FRONT, size=(600, 400),
        progress=lambda *call: calls.append(call),
    )  # fmt: skip
    reports = [(stage, count.done, count.total, count.unit) for stage, count in calls]
    assert reports[:2] == [("measuring", 1, 2, "frames"), ("measuring", 2, 2, "frames")]
    assert reports[-1] == ("drawing", 6, 6, "views")


def test_labels_have_the_number_and_the_time(grid):
    assert frame_labels(Scene(grid), 5) == ["frame 5, 0.20 s"]
    later = MeshSequence(grid.vertices, grid.faces, 10.0, start_s=2.0)
    assert frame_labels(Scene(later, grid), 5) == ["frame 5, 2.50 s", ""]
    assert frame_labels(Scene(MeshSequence(grid.vertices, grid.faces)), 5) == ["frame 5"]


@pytest.mark.parametrize(
    ("n_frames", "max_frames", "expected"),
    [(9, 3, [0, 4, 8]), (2, 8, [0, 1]), (1, 8, [0]), (175, 8, [0, 25, 50, 75, 99, 124, 149, 174])],
)
def test_frames_are_spread_from_the_first_to_the_last(n_frames, max_frames, expected):
    assert spread_frames(range(n_frames), max_frames) == expected


@pytest.mark.parametrize(
    ("n_frames", "expected"), [(300, [100, 199, 299]), (3, [0, 1, 2]), (1, [0])]
)
def test_representative_frames_skip_the_first_when_there_are_enough(n_frames, expected):
    assert representative_frames(range(n_frames), 3) == expected
