"""The figures of a small evaluation: contents and panels."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from meshreel.model.sequence import MeshSequence
from meshreel.paper.study.figures import matrices
from meshreel.paper.study.figures.matrices import (
    _draw_matrix,
    draw_dictionaries,
    draw_projected_deltas,
)
from meshreel.paper.study.figures.meshes import (
    ENLARGEMENT,
    detail_corner,
    render_detail,
    save_sheet,
    uncommon_frame,
)
from meshreel.paper.study.runs import near_zero_percent, projected_deltas
from meshreel.rendering.camera import fit_camera
from meshreel.rendering.rasterizer import render
from samples.meshes import grid_faces, waving_grid

PANELS = {
    "Fig. 2": 2,  # a linear and a log scale; the matrix is as small as the detail
    "Fig. 3": 5,  # 2, 5, 10 and 12 rows of 12 frames, and the original
    "Fig. 4": 1,
    "Fig. 5": 3,  # all frames together, blocks, graph frequencies
    "Fig. 6": 1,  # 12 frames are one block
    "Fig. 7": 26,  # 8 variants shaded, enlarged and with their errors, and the original twice
    "Rate and distortion": 3,
}


@pytest.mark.slow
def test_every_figure_is_drawn_with_its_panels(pictures):
    assert {picture.title: picture.n_panels for picture in pictures} == PANELS


@pytest.mark.slow
def test_figures_are_not_blank(pictures):
    for picture in pictures:
        with Image.open(picture.path) as image:
            assert image.format == "PNG", picture.title
            assert min(image.size) > 300, picture.title
            colors = image.convert("RGB").getcolors(maxcolors=1 << 24)
        commonest = max(count for count, _ in colors)
        assert len(colors) > 50, picture.title
        assert commonest < 0.98 * sum(count for count, _ in colors), picture.title


@pytest.mark.slow
def test_every_label_of_fig_4_is_a_variant(results):
    assert [result["identity"]["setting"]["method"] for result in results.variants] == [
        "pca", "pca-q", "v2v", "pca-qs", "pca-qp", "pca-qp", "blocks", "gft",
    ]  # fmt: skip


def test_projected_deltas_have_the_energy_of_the_deltas():
    sequence = waving_grid()
    magnitudes = projected_deltas(sequence)
    assert magnitudes.shape == (12, 99)
    energy = (magnitudes**2).sum(axis=1)
    assert energy[6:].sum() < 1e-3 * energy.sum()


def test_uncommon_frame_is_the_one_that_differs():
    sequence = waving_grid()
    vertices = np.repeat(sequence.vertices[:1], 6, axis=0)
    vertices[4, ::3] += 0.5
    assert uncommon_frame(MeshSequence(vertices, sequence.faces)) == 4


BLOCK_FRAMES = 8


def _noisy(n_frames, n_rows=9, n_columns=11):
    """A grid of which no two frames are equal, so that all eigen-trajectories are determined."""
    sequence = waving_grid(n_frames, n_rows, n_columns)
    noise = np.random.default_rng(1).normal(0, 0.05, sequence.vertices.shape)
    return MeshSequence((sequence.vertices + noise).astype(np.float32), sequence.faces)


@pytest.mark.slow
@pytest.mark.parametrize(("n_blocks", "n_panels"), [(1, 1), (2, 3), (7, 9)])
def test_fig_6_shows_five_dictionaries_at_most_and_their_differences(tmp_path, n_blocks, n_panels):
    sequence = _noisy(n_blocks * BLOCK_FRAMES + 3)
    picture = draw_dictionaries(sequence, BLOCK_FRAMES, 3, "grid", tmp_path)
    assert picture.n_panels == n_panels
    assert "The dashed line follows column 3" in picture.caption
    assert ("differences" in picture.caption) == (n_blocks > 1)


@pytest.mark.parametrize(("n_kept", "lines"), [(3, [[3.5, 3.5]]), (8, [])])
def test_matrix_has_a_line_after_the_kept_columns_if_there_are_others(n_kept, lines):
    axes = Figure().add_subplot()
    _draw_matrix(axes, np.eye(8), 1.0, n_kept)
    assert [list(line.get_xdata()) for line in axes.lines] == lines


def test_first_matrices_of_fig_6_number_the_frames(tmp_path, monkeypatch):
    figures = []
    monkeypatch.setattr(matrices, "save_figure", lambda figure, *_, **__: figures.append(figure))
    draw_dictionaries(_noisy(2 * BLOCK_FRAMES), BLOCK_FRAMES, 3, "grid", tmp_path)
    labels = [axes.get_ylabel() for axes in figures[0].axes]
    assert labels == ["frame of the block", "", "frame of the block", "entry"]


@pytest.mark.slow
def test_fig_2_has_a_detail_only_if_it_is_a_part_of_the_matrix(tmp_path):
    assert draw_projected_deltas(_noisy(8), "small", tmp_path).n_panels == 2
    assert draw_projected_deltas(_noisy(8, 20, 20), "large", tmp_path).n_panels == 4


def test_near_zero_percentage_is_relative_to_the_largest_entry():
    assert near_zero_percent(np.array([[50.0, 0.5], [0.51, 0.0]]), 0.01) == 50
    assert near_zero_percent(np.zeros((2, 3)), 0.01) == 100


@pytest.mark.slow
def test_caption_of_fig_2_counts_the_entries_near_zero(tmp_path):
    sequence = _noisy(8)
    magnitudes = projected_deltas(sequence)
    shares = [100 * np.mean(magnitudes < limit * magnitudes.max()) for limit in (0.01, 0.001)]
    assert 0 < shares[1] < shares[0] < 100
    caption = draw_projected_deltas(sequence, "grid", tmp_path).caption
    assert f"{shares[0]:.1f} % of the entries are at most 1 % of the largest" in caption
    assert f"{shares[1]:.1f} % at most 0.1 %" in caption


def _squares(distances):
    """Squares of 20 x 20 cells behind each other, seen from the front."""
    x, y = np.meshgrid(np.linspace(-1, 1, 21), np.linspace(-1, 1, 21))
    vertices = [
        np.stack([x.ravel(), y.ravel(), np.full(441, -distance)], axis=1) for distance in distances
    ]
    faces = np.concatenate([grid_faces(21, 21) + 441 * number for number in range(len(distances))])
    return np.concatenate(vertices), faces


def _front_camera(vertices):
    return fit_camera(vertices, azimuth_deg=0, elevation_deg=0, width=120, height=120)


def _near(vertices, x, y, angle_deg):
    """Angles that are large around a place, on all squares."""
    return angle_deg * (np.hypot(vertices[:, 0] - x, vertices[:, 1] - y) < 0.25)


def _contains(corner, size, point):
    return all(
        low <= at <= low + extent for low, extent, at in zip(corner, size, point, strict=True)
    )


def _at_lower_right(vertices, *angles_deg):
    return [_near(vertices, 0.6, -0.6, angle_deg) for angle_deg in angles_deg]


def _at_upper_left(vertices, angle_deg):
    return _near(vertices, -0.6, 0.6, angle_deg)


@pytest.mark.parametrize(
    ("distances", "angles_of"),
    [
        pytest.param(
            [0.0],
            lambda v: [_at_upper_left(v, 10.0) + each for each in _at_lower_right(v, 0.0, 10, 20)],
            id="where variants differ",
        ),
        pytest.param(
            [0.0],
            lambda v: [*_at_lower_right(v, 0.0, 0.0, 5.0, 5.0), _at_upper_left(v, 60.0)],
            id="without a single bad variant",
        ),
        pytest.param(
            [0.0],
            lambda v: [
                np.zeros(441),
                np.maximum(_at_lower_right(v, 8.0)[0], np.where(v[:, 0] < 0, 4.0, 0.0)),
            ],
            id="few large differences rather than many small ones",
        ),
        pytest.param(
            [0.0, 0.5],
            lambda v: [np.where(v[:, 2] < 0, _at_upper_left(v, 90.0), _at_lower_right(v, 1.0)[0])],
            id="visible differences only",
        ),
    ],
)
def test_detail_shows(distances, angles_of):
    vertices, faces = _squares(distances)
    camera = _front_camera(vertices)
    corner = detail_corner(vertices, faces, angles_of(vertices), camera, (40, 40))
    right, wrong = camera.project(np.array([[0.6, -0.6, 0.0], [-0.6, 0.6, 0.0]]))[0]
    assert _contains(corner, (40, 40), right)
    assert not _contains(corner, (40, 40), wrong)


def test_detail_without_differences_is_on_the_mesh():
    vertices, faces = _squares([0.0])
    camera = fit_camera(vertices, azimuth_deg=0, elevation_deg=0, width=120, height=120, margin=0.3)
    left, top = detail_corner(vertices, faces, [np.zeros(441)], camera, (20, 20))
    shown = render_detail(vertices, faces, camera, (left, top), (20, 20))
    assert (shown[5:-5, 5:-5] < 240).all()  # no background


def test_enlarged_detail_is_the_part_of_the_panel_with_finer_edges():
    sequence = waving_grid()
    vertices, faces = sequence.vertices[3], sequence.faces
    camera = fit_camera(vertices, width=120, height=90)
    (left, top), (width, height) = (10, 5), (80, 60)  # with an outline
    detail = render_detail(vertices, faces, camera, (left, top), (width, height))
    part = render(vertices, faces, camera)[top : top + height, left : left + width].astype(float)
    assert detail.shape == (ENLARGEMENT * height, ENLARGEMENT * width, 3)
    tiles = detail.reshape(height, ENLARGEMENT, width, ENLARGEMENT, 3).astype(float)
    assert np.abs(tiles.mean(axis=(1, 3)) - part).mean() < 2.0
    assert tiles.std(axis=(1, 3)).max() > 10.0


@pytest.mark.parametrize(("n_columns", "n_bands"), [(1, 1), (5, 1), (9, 2)])
def test_columns_of_a_sheet_are_wrapped_into_bands(tmp_path, n_columns, n_bands):
    panel = np.zeros((100, 320, 3), np.uint8)
    save_sheet([(f"title {n}", [panel]) for n in range(n_columns)], tmp_path / "sheet.png")
    with Image.open(tmp_path / "sheet.png") as sheet:
        dark = np.asarray(sheet.convert("L")) < 1
    assert dark.sum() >= n_columns * 100 * 320
    starts = np.flatnonzero(np.diff(dark.any(axis=1).astype(int)) == 1)
    tall = [start for start in starts if dark[start + 1 : start + 100].any(axis=1).all()]
    assert len(tall) == n_bands
    assert dark.shape[1] < 2000
