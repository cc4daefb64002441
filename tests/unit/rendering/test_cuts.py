"""Volume meshes cut open."""

import numpy as np
import pytest

from conformance.sources import boxes, of_type, tetrahedra
from meshreel.errors import InvalidInputError
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Domain
from meshreel.model.tracks import Track
from meshreel.rendering.cuts import Cut, cut_open, parse_cut
from meshreel.rendering.looks import TrackLook
from meshreel.rendering.scenes import Scene
from meshreel.rendering.views import View
from samples.meshes import waving_grid

POINTS, HEXAHEDRA = boxes(4, 3, 2)
POINTS = POINTS.astype(np.float32)
LAYER = POINTS[HEXAHEDRA].mean(axis=1)
"""Center of each cell, 0.5 to 3.5 along x."""

FRAMES = np.stack([POINTS, POINTS + np.float32([9, 0, 0])])
BLOCK = MeshSequence(FRAMES, cells=of_type(12, HEXAHEDRA))


@pytest.mark.parametrize(
    ("text", "cut"),
    [
        ("x", Cut(0, 50.0, True)),
        ("-y", Cut(1, 50.0, True, True)),
        ("z=40%", Cut(2, 40.0, True)),
        (" X=-1.5 ", Cut(0, -1.5, False)),
        ("-z=2e-3", Cut(2, 0.002, False, True)),
    ],
)
def test_cuts_are_parsed(text, cut):
    assert parse_cut(text) == cut


@pytest.mark.parametrize("text", ["", "w", "x=", "x=40 mm", "x=1:2", "xy=3", "x=1.2.3", "x=.", "3"])
def test_other_text_is_refused(text):
    with pytest.raises(InvalidInputError, match=r"an axis and a position: x=40% of the box"):
        parse_cut(text)


@pytest.mark.parametrize(
    ("cut", "kept"),
    [
        ("x=2", LAYER[:, 0] < 2),
        ("-x=2", LAYER[:, 0] > 2),
        ("x=50%", LAYER[:, 0] < 2),
        ("y=1.5", LAYER[:, 1] <= 1.5),
        ("x=100", LAYER[:, 0] < 100),
    ],
)
def test_surface_is_that_of_the_cells_on_one_side(cut, kept):
    faces, surface, owners = cut_open(BLOCK.segments[0], parse_cut(cut))
    assert set(owners) <= set(np.flatnonzero(kept))
    assert len(surface.face_sizes) == len(owners)
    low, high = POINTS[HEXAHEDRA[kept]].min(axis=(0, 1)), POINTS[HEXAHEDRA[kept]].max(axis=(0, 1))
    nx, ny, nz = (high - low).astype(int)
    assert len(owners) == 2 * (nx * ny + ny * nz + nz * nx)
    assert len(faces) == 2 * len(owners)
    np.testing.assert_array_equal(POINTS[faces].min(axis=(0, 1)), low)
    np.testing.assert_array_equal(POINTS[faces].max(axis=(0, 1)), high)


def test_tetrahedra_are_cut_open_too():
    mesh = MeshSequence(POINTS[None], cells=of_type(10, tetrahedra(POINTS, HEXAHEDRA)))
    faces, _, owners = cut_open(mesh.segments[0], parse_cut("x=2"))
    assert np.bincount(np.unique(faces, axis=0)[:, 0]).any()
    assert len(owners) == len(faces)
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] % 2 == 0).all()  # closed


@pytest.mark.parametrize(
    ("cut", "message"),
    [("x=-1", r"no cell is below x = -1; .* x = 0 to 4"), ("-x=9", "no cell is above x = 9")],
)
def test_plane_beside_the_mesh_is_refused(cut, message):
    with pytest.raises(InvalidInputError, match=message):
        cut_open(BLOCK.segments[0], parse_cut(cut))


def test_surface_without_cells_is_refused():
    with pytest.raises(InvalidInputError, match=r"cut shows the inside of cells; .* without cells"):
        cut_open(waving_grid().segments[0], parse_cut("x"))


def has_yellow(scene):
    camera = View(azimuth_deg=0, elevation_deg=0).camera(scene.frames([0]), 200, 160)
    (picture,) = scene.draw(scene.read(0), camera, scene.scales([0]))
    red, _, blue = picture.astype(int).reshape(-1, 3).T
    return bool(((red > 120) & (blue < red / 2)).any())


@pytest.mark.parametrize("domain", [Domain.CELL, Domain.VERTEX])
def test_cut_shows_values_inside(domain):
    points, cells = boxes(4, 4, 4)
    places = points[cells].mean(axis=1) if domain is Domain.CELL else points
    is_inner = (np.abs(places - 2) < 0.6).all(axis=1)
    tracks = {"t": Track(is_inner[None].astype(np.float32), domain=domain)}
    block = MeshSequence(points[None].astype(np.float32), cells=of_type(12, cells), tracks=tracks)
    look = TrackLook("t", range="0:1")
    assert not has_yellow(Scene(block, track=look))
    assert has_yellow(Scene(block, track=look, cut=parse_cut("z=2")))


def test_camera_frames_the_kept_cells():
    whole, half = Scene(BLOCK), Scene(BLOCK, cut=parse_cut("x=2"))
    (frame,), (kept,) = whole.frames([1]), half.frames([1])
    assert (frame[:, 0].min(), frame[:, 0].max()) == (9, 13)
    assert (kept[:, 0].min(), kept[:, 0].max()) == (9, 11)


def test_track_of_faces_cannot_be_cut():
    values = np.arange(float(len(BLOCK.surface.face_sizes)))
    mesh = BLOCK.replace(tracks={"f": Track(np.stack([values, values]), domain=Domain.FACE)})
    with pytest.raises(InvalidInputError, match="values of each face of the outer surface"):
        Scene(mesh, track=TrackLook("f"), cut=parse_cut("x"))
