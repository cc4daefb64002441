from dataclasses import replace

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.metrics.heat import HEATS, heat_field
from meshreel.metrics.reference import bounding_box_reference
from meshreel.model.cells import Cells
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Domain
from meshreel.model.tracks import FACE_MASKS, Track
from meshreel.rendering.camera import fit_camera
from meshreel.rendering.looks import TrackLook
from meshreel.rendering.rasterizer import CLAY, render
from meshreel.rendering.scenes import NO_SCALES, Scene
from meshreel.rendering.shots import scene_annotations
from meshreel.rendering.views import View
from samples.meshes import hard_box, quad_sheet, waving_grid


def drawn(scene, number=3, scales=NO_SCALES):
    camera = View().camera(scene.framed_sequence.vertices, 160, 120)
    return scene.draw(scene.read(number), camera, scales)


def test_error_for_heat_without_an_original_names_the_option(grid):
    with pytest.raises(InvalidInputError, match="original"):
        Scene(grid, None, "angle")


def test_scene_rejects_an_original_with_another_number_of_frames(grid):
    with pytest.raises(
        InvalidInputError, match=r"5 frames and the decoded 12; .* equal numbers of"
    ):
        Scene(grid, waving_grid(5))


@pytest.mark.parametrize("heat", ["angle", "sted"])
def test_scene_refuses_heat_of_vertices_if_the_original_has_another_mesh(heat, grid):
    with pytest.raises(InvalidInputError, match=r"vertex counts differ .* distance compares any"):
        Scene(grid, waving_grid(12, 5, 5), heat)


def test_scene_has_a_view_for_each_title(grid, lifted):
    for scene, titles in (
        (Scene(grid), [""]),
        (Scene(lifted, grid), ["original", "decoded"]),
        (Scene(lifted, grid, "angle"), ["original", "decoded", HEATS["angle"].label]),
    ):
        assert scene.titles == titles
        assert len(drawn(scene, scales=scene.scales([3]))) == len(titles)


@pytest.mark.parametrize("kind", HEATS)
def test_heat_range_covers_nearly_all_values(kind, grid, lifted):
    heat_range = Scene(lifted, grid, kind).scales(range(12)).heat
    diagonal = bounding_box_reference(grid.vertices).diagonal
    field = heat_field(kind, grid.faces, grid.n_verts, diagonal)
    values = np.concatenate(
        [field(*pair) for pair in zip(grid.vertices, lifted.vertices, strict=True)]
    )
    assert heat_range.largest == values.max()
    assert (values <= heat_range.high).mean() > 0.99
    assert heat_range.high <= 2 * values.max()


def test_heat_map_is_bright_only_at_displaced_vertices(grid, lifted):
    same, off = Scene(grid, grid, "distance"), Scene(lifted, grid, "distance")
    scales = off.scales([3])
    dark, bright = (drawn(scene, scales=scales)[2].astype(int) for scene in (same, off))
    changed = np.abs(bright - dark).max(axis=2) > 60
    assert 0.02 < changed.mean() < 0.5
    assert np.abs(drawn(off)[0].astype(int) - drawn(same)[0]).max() == 0


def test_scene_without_heat_has_no_range(grid):
    assert Scene(grid, grid).scales([0]) == NO_SCALES


def test_scene_shows_the_colors_of_the_surface():
    sheet = quad_sheet()
    plain = MeshSequence(sheet.vertices, sheet.faces)
    colored, gray = (drawn(Scene(sequence))[0].astype(int) for sequence in (sheet, plain))
    spread = [np.ptp(view, axis=2)[(view != 255).any(axis=2)].mean() for view in (colored, gray)]
    assert spread[0] > 2 * spread[1]


def with_track(sequence, values, domain="vertex", surface=None, **facts):
    tracks = {"heat": Track(values, domain, **facts)}
    surface = surface or sequence.surface
    return MeshSequence(
        sequence.vertices, sequence.faces, sequence.fps, surface=surface, tracks=tracks
    )


@pytest.mark.parametrize("domain", ["vertex", "face", "corner"])
def test_scene_shows_the_colors_of_a_track_of_any_domain(domain, grid):
    sizes = {"vertex": grid.n_verts, "face": grid.n_faces, "corner": 3 * grid.n_faces}
    low = np.zeros((12, sizes[domain]), np.float32)
    high = low + np.float32(1)
    scenes = [
        Scene(with_track(grid, values, domain), track=TrackLook("heat", range="0:1"))
        for values in (low, high)
    ]
    views = [drawn(scene, scales=scene.scales([3]))[0] for scene in scenes]
    inside = (views[0] != 255).any(axis=2)
    middle = [np.median(view[inside], axis=0) for view in views]
    assert middle[0][2] > 1.5 * middle[0][1]  # violet
    assert middle[1][1] > 1.5 * middle[1][2]  # yellow


def test_each_polygon_has_the_color_of_its_value():
    sheet = quad_sheet()
    n_polygons = sheet.surface.n_items(Domain.FACE, sheet.n_verts, sheet.n_faces)
    assert n_polygons < sheet.n_faces
    values = np.arange(sheet.n_frames * n_polygons, dtype=np.float32).reshape(-1, n_polygons)
    scene = Scene(with_track(sheet, values, "face", sheet.surface), track=TrackLook("heat"))
    view = drawn(scene, 0, scene.scales([0]))[0]
    assert len(np.unique(view[(view != 255).any(axis=2)], axis=0)) >= n_polygons


def test_heat_map_of_a_track_shows_its_error_in_its_unit(grid):
    values = np.tile(np.linspace(0, 10, grid.n_verts, dtype=np.float32), (12, 1))
    off = values.copy()
    off[5, 7] += 2
    scene = Scene(
        with_track(grid, off, unit="Pa"),
        with_track(grid, values, unit="Pa"),
        "track",
        track=TrackLook("heat"),
    )
    assert scene.titles == ["original: heat", "decoded: heat", "error of heat, Pa"]
    scales = scene.scales(range(12))
    assert scales.heat.largest == pytest.approx(2.0)
    assert scales.heat.frame == 5
    annotations = scene_annotations(scene, scales)
    assert [(bar.unit, bar.column) for bar in annotations.bars] == [("Pa", 1), ("Pa", -1)]
    assert "The largest error shown is 2 Pa, in frame 5." in annotations.caption
    views = drawn(scene, 5, scales)
    assert len(views) == 3
    assert np.abs(views[2].astype(int) - drawn(scene, 4, scales)[2]).max() > 60


def test_scene_rejects_a_missing_or_different_track(grid):
    values = np.zeros((12, grid.n_verts), np.float32)
    other = np.zeros((12, grid.n_faces), np.float32)
    with pytest.raises(InvalidInputError, match="there is no track 'heta'; did you mean 'heat'"):
        Scene(with_track(grid, values), track=TrackLook("heta"))
    with pytest.raises(InvalidInputError, match="there are no tracks"):
        Scene(with_track(grid, values), grid, track=TrackLook("heat"))
    with pytest.raises(InvalidInputError, match="of the original is scalar of each face"):
        Scene(with_track(grid, values), with_track(grid, other, "face"), track=TrackLook("heat"))
    with pytest.raises(InvalidInputError, match="add track"):
        Scene(with_track(grid, values), with_track(grid, values), "track")


@pytest.mark.parametrize(("domain", "n_items"), [("vertex", 99), ("face", 160)])
def test_heat_of_positions_is_the_same_next_to_a_track(grid, lifted, domain, n_items):
    values = np.zeros((12, n_items))
    pair = with_track(lifted, values, domain), with_track(grid, values, domain)
    scene = Scene(*pair, "distance", track=TrackLook("heat"))
    assert scene.titles == ["original: heat", "decoded: heat", HEATS["distance"].label]
    views, alone = (
        drawn(shown, scales=shown.scales([3])) for shown in (scene, Scene(lifted, grid, "distance"))
    )
    np.testing.assert_array_equal(views[-1], alone[-1])


def test_hard_edges_give_each_face_of_a_box_one_color():
    box = hard_box(1)
    camera = fit_camera(box.vertices[0], azimuth_deg=30, elevation_deg=25, width=96, height=96)
    scene = Scene(box)
    (picture,) = scene.draw(scene.read(0), camera)
    smooth = Scene(box.replace(surface=replace(box.surface, hard_edges=None)))
    (smooth_picture,) = smooth.draw(smooth.read(0), camera)
    count = [len(np.unique(image.reshape(-1, 3), axis=0)) for image in (picture, smooth_picture)]
    flat = render(
        box.vertices[0], box.faces, camera, colors=CLAY, background=scene.background, smooth=False
    )
    assert np.abs(picture.astype(int) - flat).max() <= 1
    assert count[1] > 2 * count[0]


def test_faces_of_volume_meshes_are_flat():
    corners = np.array(list(np.ndindex(2, 2, 2)), np.float32)[None]
    box = MeshSequence(corners, cells=Cells(np.array([12]), np.array([0, 4, 6, 2, 1, 5, 7, 3])))
    camera = fit_camera(corners[0], azimuth_deg=30, elevation_deg=25, width=96, height=96)
    scene = Scene(box)
    (picture,) = scene.draw(scene.read(0), camera)
    flat = render(
        corners[0], box.faces, camera, colors=CLAY, background=scene.background, smooth=False
    )
    np.testing.assert_array_equal(picture, flat)


def with_other_faces(sequence):
    """The same surface in every frame, with vertices and faces in another order."""
    order = np.random.default_rng(3).permutation(sequence.n_verts)
    faces = np.argsort(order)[sequence.faces[::-1]]
    return MeshSequence(sequence.vertices[:, order], faces, sequence.fps)


@pytest.fixture
def changing(grid):
    """A grid whose second half has half the faces."""
    return MeshSequence.of_segments([
        MeshSequence(grid.vertices[:6], grid.faces, grid.fps),
        MeshSequence(grid.vertices[6:], grid.faces[::2], grid.fps),
    ])  # fmt: skip


def test_scene_draws_each_frame_with_the_faces_of_its_segment(changing, grid):
    camera = View().camera(grid.vertices, 160, 120)
    scene = Scene(changing)
    for number in (5, 6, 2):
        (view,) = scene.draw(scene.read(number), camera)
        faces = grid.faces if number < 6 else grid.faces[::2]
        expected = render(
            grid.vertices[number], faces, camera, colors=CLAY, background=scene.background
        )
        assert np.array_equal(view, expected)


def test_heat_of_segments_is_the_vertex_distance_if_their_meshes_are_the_same(changing, lifted):
    decoded = MeshSequence.of_segments([
        MeshSequence(lifted.vertices[:6], changing.segments[0].faces, 25.0),
        MeshSequence(lifted.vertices[6:], changing.segments[1].faces, 25.0),
    ])  # fmt: skip
    scene = Scene(decoded, changing, "distance")
    assert scene.titles[-1] == HEATS["distance"].label
    moment = scene.read(8)
    low, high = changing.extent.low, changing.extent.high
    expected = np.where(np.arange(99) < 20, 5.0 / np.linalg.norm(high - low), 0.0)
    assert moment.field(*moment.positions) == pytest.approx(expected, rel=1e-5, abs=1e-9)


def test_heat_is_the_distance_to_the_surface_if_the_order_of_vertices_differs(changing, grid):
    shuffled = MeshSequence.of_segments(
        [with_other_faces(segment) for segment in changing.segments]
    )
    same = Scene(shuffled, changing, "distance")
    assert same.titles[-1] == "distance to the original surface, % of the diagonal"
    assert same.scales(range(12)).heat.largest < 1e-10
    raised = [
        MeshSequence(segment.read(0, segment.n_frames) + np.float32(0.5), segment.faces)
        for segment in shuffled.segments
    ]
    heat = Scene(MeshSequence.of_segments(raised), changing, "distance").scales(range(12)).heat
    longest = 50 * np.sqrt(3) / np.linalg.norm(changing.extent.high - changing.extent.low)
    assert 0.5 * longest < heat.largest <= longest * (1 + 1e-6)


def test_heat_is_the_distance_to_the_surface_if_faces_change_in_other_frames(changing, grid):
    assert Scene(grid, changing, "distance").scales([2]).heat.largest < 1e-10
    with pytest.raises(InvalidInputError, match="change in different frames; a heat map of sted"):
        Scene(grid, changing, "sted")


def test_segments_without_the_track_are_gray(changing):
    first, second = changing.segments
    values = np.linspace(0, 1, 6 * 99, dtype=np.float32).reshape(6, 99)
    scene = Scene(
        MeshSequence.of_segments([first, with_track(second, values)]), track=TrackLook("heat")
    )
    scales = scene.scales(range(12))
    assert scales.track.has_missing
    camera = View().camera(changing.segments[0].vertices, 160, 120)
    spreads = []
    for number in (3, 9):
        (view,) = scene.draw(scene.read(number), camera, scales)
        spreads.append(np.ptp(view.astype(int), axis=2).max())
    assert spreads[0] <= 2
    assert spreads[1] > 60


def test_scene_rejects_a_track_of_other_kinds_in_different_segments(changing):
    first, second = changing.segments
    tracks = np.zeros((6, 99), np.float32), np.zeros((6, 99, 2), np.float32)
    sequence = MeshSequence.of_segments(
        [with_track(first, tracks[0]), with_track(second, tracks[1])]
    )
    with pytest.raises(InvalidInputError, match="2 x float32; only a track of one kind"):
        Scene(sequence, track=TrackLook("heat"))


@pytest.mark.parametrize("name", FACE_MASKS)
def test_faces_are_hidden_where_a_mask_is_zero(name):
    """Also of polygons; a track of another domain hides nothing."""
    sheet = quad_sheet()
    is_shown = np.zeros((sheet.n_frames, len(sheet.surface.face_sizes)), bool)
    is_shown[1, 0] = True

    def n_covered(track, number):
        view = drawn(Scene(sheet.replace(tracks={name: track})), number)[0]
        return np.count_nonzero((view != 255).any(axis=2))

    whole = n_covered(Track(np.ones_like(is_shown), Domain.FACE), 1)
    assert n_covered(Track(is_shown, Domain.FACE), 0) == 0
    assert 0 < n_covered(Track(is_shown, Domain.FACE), 1) < 0.5 * whole
    at_vertices = np.zeros((sheet.n_frames, sheet.n_verts), bool)
    assert n_covered(Track(at_vertices), 1) == whole
