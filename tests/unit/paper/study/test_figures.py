"""The figures of a small evaluation: contents and panels."""

import re

import numpy as np
import pytest
from PIL import Image

import meshreel
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.open_stream import whole_stream
from meshreel.evaluation.plots import label_ends
from meshreel.model.sequence import MeshSequence
from meshreel.paper.decoder import coded_blocks
from meshreel.paper.stored_blocks import stored_block
from meshreel.paper.study.claims import near_zero_percent, projected_deltas
from meshreel.paper.study.figures.matrices import (
    averaged,
    draw_dictionaries,
    draw_projected_deltas,
    whole_dictionaries,
)
from meshreel.paper.study.figures.meshes import (
    ENLARGEMENT,
    detail_corner,
    render_detail,
    uncommon_frame,
)
from meshreel.paper.study.figures.panels import PAGE_PX, fit_layout
from meshreel.rendering.camera import fit_camera
from meshreel.rendering.plots import blank_figure
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


def test_labels_are_next_to_the_axes_at_the_height_of_their_lines():
    figure = blank_figure(6, 4)
    axes = figure.add_subplot()
    axes.set(xlim=(0, 1), ylim=(0, 10))
    label_ends(axes, [("pca", 1.0, 2.0), ("v2v", 1.0, 8.0)])
    places = {text.get_text(): text.get_position() for text in axes.texts}
    assert places["pca"] == pytest.approx((1.035, 0.2))
    assert places["v2v"] == pytest.approx((1.035, 0.8))


def test_labels_of_zero_and_undefined_errors_are_placed_on_a_log_axis():
    axes = blank_figure(6, 4).add_subplot()
    axes.set(xlim=(0, 1), ylim=(1e-3, 10), yscale="log")
    label_ends(axes, [("pca", 1.0, 0.0), ("v2v", 1.0, float("nan"))])
    assert np.isfinite([text.get_position() for text in axes.texts]).all()


BLOCK_FRAMES = 8


def _noisy(n_frames, n_rows=9, n_columns=11):
    """A grid whose every frame differs, so that all eigen-trajectories are determined."""
    sequence = waving_grid(n_frames, n_rows, n_columns)
    noise = np.random.default_rng(1).normal(0, 0.05, sequence.vertices.shape)
    return MeshSequence((sequence.vertices + noise).astype(np.float32), sequence.faces)


def _tracked(sequence, n_modes, dictionary="difference"):
    """A stream of `blocks` with this many columns in each dictionary."""
    choices = {"dictionary": dictionary} if dictionary != "difference" else None
    return meshreel.encode(
        sequence, "blocks", n_modes=n_modes, block_frames=BLOCK_FRAMES, choices=choices
    )


def _stored_bits(data, n_modes):
    """Mean bits of an entry of the dictionaries after the first, from the bytes of a stream."""
    opened = whole_stream(data)
    payloads = [
        stored_block(opened, number).payload(Section.BASIS) for number in range(opened.n_blocks)
    ]
    sizes = [len(payload) - 1 for payload in payloads[1:]]  # without the byte that names the kind
    return 8 * sum(sizes) / (len(sizes) * 3 * n_modes * BLOCK_FRAMES)


def test_whole_dictionaries_are_those_of_a_stream_with_all_columns():
    sequence = _noisy(4 * BLOCK_FRAMES + 3)
    blocks = coded_blocks(_tracked(sequence, BLOCK_FRAMES))
    found = whole_dictionaries(sequence, BLOCK_FRAMES)
    assert len(found) == 4
    for dictionary, block in zip(found, blocks[:4], strict=True):
        # Streams order vertices otherwise, which changes the last bit of sums.
        assert np.abs(dictionary.integers - block.basis.integers).max() <= 1


@pytest.mark.parametrize(("n_blocks", "n_panels"), [(1, 1), (2, 3), (7, 9)])
def test_fig_6_shows_five_dictionaries_at_most_and_their_differences(tmp_path, n_blocks, n_panels):
    sequence = _noisy(n_blocks * BLOCK_FRAMES)
    blocks = coded_blocks(_tracked(sequence, 3))
    assert draw_dictionaries(sequence, blocks, "grid", tmp_path).n_panels == n_panels


def test_caption_of_fig_6_has_the_bits_and_sizes_of_stored_dictionaries(tmp_path):
    sequence = _noisy(4 * BLOCK_FRAMES)
    picture = draw_dictionaries(sequence, coded_blocks(_tracked(sequence, 3)), "grid", tmp_path)
    for n_columns in (3, BLOCK_FRAMES):
        data = _tracked(sequence, n_columns)
        values = np.stack([block.basis.values for block in coded_blocks(data)])
        rms_of_difference = np.sqrt(np.mean((values[1:] - values[:-1]) ** 2))
        difference_bits = _stored_bits(data, n_columns)
        whole_bits = _stored_bits(_tracked(sequence, n_columns, "whole"), n_columns)
        assert re.search(
            rf"differences {rms_of_difference:.3f} and [\d.]+ \({difference_bits:.2f}\) bits, "
            rf"dictionaries {BLOCK_FRAMES**-0.5:.3f} and [\d.]+ \({whole_bits:.2f}\) bits",
            picture.caption,
        )


@pytest.mark.slow
def test_fig_2_has_a_detail_only_if_it_is_a_part_of_the_matrix(tmp_path):
    assert draw_projected_deltas(_noisy(8), "small", tmp_path).n_panels == 2
    assert draw_projected_deltas(_noisy(8, 20, 20), "large", tmp_path).n_panels == 4


def test_near_zero_percentage_is_relative_to_the_largest_entry():
    assert near_zero_percent(np.array([[50.0, 0.5], [0.51, 0.0]]), 0.01) == 50
    assert near_zero_percent(np.zeros((2, 3)), 0.01) == 100


def test_caption_of_fig_2_counts_the_entries_near_zero(tmp_path):
    sequence = _noisy(8)
    magnitudes = projected_deltas(sequence)
    shares = [100 * np.mean(magnitudes < limit * magnitudes.max()) for limit in (0.01, 0.001)]
    assert 0 < shares[1] < shares[0] < 100
    caption = draw_projected_deltas(sequence, "grid", tmp_path).caption
    assert f"{shares[0]:.1f} % of the entries are at most 1 % of the largest" in caption
    assert f"{shares[1]:.1f} % at most 0.1 %" in caption
    assert "mean of" not in caption


@pytest.mark.slow
def test_caption_of_fig_2_states_the_entries_averaged_in_a_pixel(tmp_path):
    caption = draw_projected_deltas(_noisy(8, 30, 40), "grid", tmp_path).caption
    assert "A pixel of the whole matrix is the mean of 1 x 3 entries." in caption


def test_large_matrix_is_averaged_over_neighbors():
    values = np.arange(15.0).reshape(3, 5)
    np.testing.assert_array_equal(averaged(values, 5), values)
    np.testing.assert_array_equal(averaged(values, 2), [[3.5, 6], [11, 13.5]])


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


def test_detail_shows_where_variants_differ():
    vertices, faces = _squares([0.0])
    camera = _front_camera(vertices)
    equal = _near(vertices, -0.6, 0.6, 10.0)
    angles = [equal + _near(vertices, 0.6, -0.6, angle) for angle in (0.0, 10.0, 20.0)]
    corner = detail_corner(vertices, faces, angles, camera, (40, 40))
    right, wrong = camera.project(np.array([[0.6, -0.6, 0.0], [-0.6, 0.6, 0.0]]))[0]
    assert _contains(corner, (40, 40), right)
    assert not _contains(corner, (40, 40), wrong)


def test_detail_ignores_a_single_bad_variant():
    vertices, faces = _squares([0.0])
    camera = _front_camera(vertices)
    angles = [_near(vertices, 0.6, -0.6, angle) for angle in (0.0, 0.0, 5.0, 5.0)]
    bad = _near(vertices, -0.6, 0.6, 60.0)
    corner = detail_corner(vertices, faces, [*angles, bad], camera, (40, 40))
    assert _contains(corner, (40, 40), camera.project(np.array([0.6, -0.6, 0.0]))[0])


def test_detail_prefers_few_large_differences_to_many_small_ones():
    vertices, faces = _squares([0.0])
    camera = _front_camera(vertices)
    angle = np.maximum(_near(vertices, 0.6, -0.6, 8.0), np.where(vertices[:, 0] < 0, 4.0, 0.0))
    corner = detail_corner(vertices, faces, [np.zeros(441), angle], camera, (40, 40))
    assert _contains(corner, (40, 40), camera.project(np.array([0.6, -0.6, 0.0]))[0])


def test_detail_ignores_hidden_differences():
    vertices, faces = _squares([0.0, 0.5])
    camera = _front_camera(vertices)
    is_hidden = vertices[:, 2] < 0
    angle = np.where(is_hidden, _near(vertices, -0.6, 0.6, 90.0), _near(vertices, 0.6, 0.6, 1.0))
    corner = detail_corner(vertices, faces, [angle], camera, (40, 40))
    assert _contains(corner, (40, 40), camera.project(np.array([0.6, 0.6, 0.0]))[0])


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


@pytest.mark.parametrize("aspect", [0.4, 0.7, 1.0, 1.6, 2.5])
@pytest.mark.parametrize("n_columns", range(2, 11))
def test_panels_fit_on_a_page_and_do_not_overlap(aspect, n_columns):
    layout = fit_layout(n_columns, [aspect, max(aspect, 1.0), aspect], 3)
    width, height = layout.size
    assert width <= PAGE_PX[0]
    assert height <= PAGE_PX[1]
    covered = np.zeros((height, width), int)
    for column in range(n_columns):
        for row in range(3):
            box = layout.cell(column, row)
            assert box.left + box.width <= width
            assert box.top + box.height <= height
            rows = slice(box.top, box.top + box.height)
            covered[rows, box.left : box.left + box.width] += 1
    assert covered.max() == 1


def test_panels_of_an_upright_model_are_side_by_side():
    assert fit_layout(9, [0.4, 1.0, 0.4], 3).n_bands == 1
    assert fit_layout(9, [1.0, 1.0, 1.0], 3).columns_per_band == 5
    assert fit_layout(9, [2.5, 2.5, 2.5], 3).columns_per_band == 3
