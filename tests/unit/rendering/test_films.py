import subprocess
import sys

import numpy as np
import pytest
from PIL import Image, ImageSequence

from meshreel.errors import FormatError, InvalidInputError
from meshreel.model.sequence import MeshSequence
from meshreel.rendering import films
from meshreel.rendering.films import UNKNOWN_FPS, film, save_film, save_gif
from meshreel.rendering.scenes import Scene
from meshreel.rendering.shots import frame_labels
from meshreel.rendering.views import View


def make_film(grid, fps=25.0, size=(160, 120), n_frames=12):
    scene = Scene(MeshSequence(grid.vertices, grid.faces, fps))
    return film(scene, range(n_frames), View(), size=size)


def read_gif(path):
    """Pictures as arrays, and their durations in milliseconds."""
    with Image.open(path) as image:
        pictures, durations = [], []
        for _ in ImageSequence.Iterator(image):
            pictures.append(np.asarray(image.convert("RGB")).astype(int))
            durations.append(image.info["duration"])
        assert image.info["loop"] == 0
    return pictures, durations


@pytest.mark.slow
def test_gif_contains_every_picture(grid, tmp_path):
    grid_film = make_film(grid)
    save_gif(grid_film, tmp_path / "a.gif")
    pictures, _ = read_gif(tmp_path / "a.gif")
    expected = [np.asarray(picture).astype(int) for picture in grid_film.pictures()]
    assert len(pictures) == len(expected) == 12
    for actual, picture in zip(pictures, expected, strict=True):
        assert np.abs(actual - picture).mean() < 2
        assert np.abs(actual - picture).max() < 60


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fps", "n_pictures"), [(25.0, 12), (24.0, 12), (30.0, 12), (60.0, 6), (120.0, 4)]
)
def test_gif_lasts_as_long_as_the_frames_despite_rounding(grid, tmp_path, fps, n_pictures):
    save_gif(make_film(grid, fps), tmp_path / "a.gif")
    pictures, durations = read_gif(tmp_path / "a.gif")
    assert len(pictures) == n_pictures
    assert min(durations) >= 20
    assert sum(durations) == pytest.approx(1000 * 12 / fps, abs=5.001)


@pytest.mark.slow
@pytest.mark.parametrize("extension", ["gif", "mp4"])
def test_film_is_reproducible(grid, tmp_path, extension):
    pytest.importorskip("imageio_ffmpeg")
    paths = [tmp_path / f"{name}.{extension}" for name in "ab"]
    for path in paths:
        save_film(make_film(grid), path)
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_gif_of_a_static_mesh_shows_it_in_every_picture(grid, tmp_path):
    static = MeshSequence(np.repeat(grid.vertices[:1], 3, axis=0), grid.faces, 25.0)
    save_gif(film(Scene(static), range(3), View(), size=(160, 120)), tmp_path / "a.gif")
    pictures, _ = read_gif(tmp_path / "a.gif")
    mesh = slice(0, 90)  # above the label
    np.testing.assert_array_equal(pictures[0][mesh], pictures[2][mesh])


@pytest.mark.slow
def test_mp4_has_every_picture_at_its_rate(grid, tmp_path):
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    grid_film = make_film(grid, fps=12.5)
    save_film(grid_film, tmp_path / "a.mp4")
    path = str(tmp_path / "a.mp4")
    assert ffmpeg.count_frames_and_secs(path) == (12, pytest.approx(12 / 12.5, abs=0.01))
    command = [ffmpeg.get_ffmpeg_exe(), "-i", path, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    done = subprocess.run(command, capture_output=True, check=True)
    assert b"h264" in done.stderr
    assert b"12.50 fps" in done.stderr
    actual = np.frombuffer(done.stdout, np.uint8).reshape(12, 120, 160, 3).astype(int)
    for decoded, picture in zip(actual, grid_film.pictures(), strict=True):
        assert np.abs(decoded - np.asarray(picture)).mean() < 3


def test_mp4_error_contains_the_message_of_ffmpeg(grid, tmp_path, monkeypatch):
    pytest.importorskip("imageio_ffmpeg")
    monkeypatch.setattr(films, "_MP4_OPTIONS", ["-c:v", "nothing"])
    with pytest.raises(OSError, match=r"ffmpeg could not write .*a\.mp4: .*nothing"):
        save_film(make_film(grid), tmp_path / "a.mp4")
    assert list(tmp_path.iterdir()) == []


def test_mp4_with_an_odd_side_is_rejected(grid, tmp_path):
    pytest.importorskip("imageio_ffmpeg")
    with pytest.raises(InvalidInputError, match="even width and height; got 161 x 120"):
        save_film(make_film(grid, size=(161, 120)), tmp_path / "a.mp4")
    assert list(tmp_path.iterdir()) == []


def test_error_names_the_extra_of_a_missing_library(grid, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(FormatError, match=r"pip install 'meshreel\[video\]'"):
        save_film(make_film(grid), tmp_path / "a.mp4")


def test_existing_film_is_not_overwritten(grid, tmp_path):
    path = tmp_path / "a.gif"
    path.write_bytes(b"mine")
    with pytest.raises(InvalidInputError, match="already exists"):
        save_film(make_film(grid), path)
    assert path.read_bytes() == b"mine"
    save_film(make_film(grid, n_frames=2), path, overwrite=True)
    assert len(read_gif(path)[0]) == 2


def test_error_for_an_unknown_extension_lists_the_formats(grid, tmp_path):
    with pytest.raises(FormatError, match=r"films are \.mp4 and \.gif files"):
        save_film(make_film(grid), tmp_path / "a.avi")


VIEW, SIZE = View(), (160, 120)


def test_static_film_has_a_picture_for_each_frame(grid):
    result = film(Scene(grid), range(2, 9), VIEW, size=SIZE)
    assert (result.n_pictures, result.size, result.fps) == (7, SIZE, 25.0)
    assert [number for number, _ in result.shots] == list(range(2, 9))
    assert len({id(camera) for _, camera in result.shots}) == 1
    assert {picture.size for picture in result.pictures()} == {SIZE}


def test_film_of_unknown_rate_plays_at_the_default_rate(grid):
    unknown = MeshSequence(grid.vertices, grid.faces)
    assert film(Scene(unknown), range(3), VIEW, size=SIZE).fps == UNKNOWN_FPS


def test_film_reads_frames_on_demand(grid, monkeypatch):
    scene = Scene(grid)
    result = film(scene, range(12), VIEW, size=SIZE)
    read, read_frame = [], Scene.read
    monkeypatch.setattr(
        Scene, "read", lambda self, number: read.append(number) or read_frame(self, number)
    )
    next(result.pictures())
    assert 0 in read
    assert len(read) < 12


def test_default_size_of_a_film_has_even_sides(grid, lifted):
    result = film(Scene(lifted, grid, "angle"), range(2), VIEW, max_size=(501, 333))
    assert result.size[0] % 2 == result.size[1] % 2 == 0


def test_frames_that_are_not_evenly_spaced_are_shown_when_they_are_due(grid):
    timed = grid[:4].replace(times=[0, 0.1, 0.2, 1.5])
    shown = film(Scene(timed), range(4), VIEW, size=SIZE)
    assert shown.fps == 2
    assert [number for number, _ in shown.shots] == [0, 2, 2, 3]
    assert frame_labels(shown.scene, 3) == ["frame 3, 1.5 s"]
