"""Draco frames of a capture, whose faces change in every frame."""

import DracoPy
import numpy as np
import pytest

from meshreel.formats.load import load

pytestmark = pytest.mark.real

FRAMES = (0, 40, 80)


@pytest.fixture(scope="module")
def paths(existing):
    folder = existing("capture/liam")
    return [folder / f"{number:05d}.drc" for number in FRAMES]


@pytest.mark.parametrize("index", range(len(FRAMES)))
def test_positions_and_coordinates_of_a_capture_are_those_of_draco(paths, index):
    decoded = DracoPy.decode(paths[index].read_bytes())
    loaded = load(paths[index])
    np.testing.assert_array_equal(loaded.vertices[0][loaded.faces], decoded.points[decoded.faces])
    [uv] = loaded.surface.attributes
    np.testing.assert_array_equal(uv.per_item(), decoded.tex_coord[decoded.faces.ravel()])


@pytest.mark.parametrize("index", range(len(FRAMES)))
def test_seams_of_a_capture_are_welded_without_collapsed_faces(paths, index):
    decoded = DracoPy.decode(paths[index].read_bytes())
    loaded = load(paths[index])
    assert loaded.n_verts < 0.83 * len(decoded.points)
    assert (loaded.faces != loaded.faces[:, [1, 2, 0]]).all()
    _, n_faces = np.unique(edges(loaded.faces), axis=0, return_counts=True)
    _, n_before = np.unique(edges(decoded.faces), axis=0, return_counts=True)
    assert n_faces.max() == 2
    # Edges of no length and ambiguous ones stay open: a hundredth of those of the seams.
    assert (n_faces == 1).sum() < 0.01 * (n_before == 1).sum()


def test_frames_of_a_capture_are_segments(paths):
    notes = []
    loaded = load(paths, notes=notes)
    assert [segment.n_frames for segment in loaded.segments] == [1, 1, 1]
    assert "the faces change: 3 frames in 3 segments of constant connectivity" in notes


def edges(faces):
    return np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
