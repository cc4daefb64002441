from meshreel.model.sequence import MeshSequence
from meshreel.rendering.films import UNKNOWN_FPS, film
from meshreel.rendering.scenes import Scene
from meshreel.rendering.shots import frame_labels
from meshreel.rendering.views import View

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
