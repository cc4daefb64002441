"""The figures of one small evaluation: pictures that show something, with their panels."""

import numpy as np
import pytest
from PIL import Image

from meshreel.evaluation.paper.figures.matrices import projected_deltas
from meshreel.evaluation.paper.figures.meshes import telling_frame
from meshreel.evaluation.plots.labels import label_ends
from meshreel.rendering.plots import blank_figure
from meshreel.sequence import MeshSequence
from samples.meshes import waving_grid

PANELS = {
    "Fig. 2": 2,
    "Fig. 3": 5,  # 2, 5, 10 and 12 rows of 12 frames, and the original
    "Fig. 4": 1,
    "Fig. 5": 3,  # all frames together, blocks, graph frequencies
    "Fig. 6": 1,  # 12 frames are one block
    "Fig. 7": 17,  # 8 variants twice, and the original
    "Rate and distortion": 3,
}


@pytest.mark.slow
def test_every_figure_is_drawn_with_its_panels(pictures):
    assert {picture.title: picture.n_panels for picture in pictures} == PANELS


@pytest.mark.slow
def test_figures_are_pictures_that_show_something(pictures):
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


def test_telling_frame_is_the_one_that_differs():
    sequence = waving_grid()
    vertices = np.repeat(sequence.vertices[:1], 6, axis=0)
    vertices[4, ::3] += 0.5
    assert telling_frame(MeshSequence(vertices, sequence.faces)) == 4


def test_labels_are_beside_the_axes_at_the_height_of_their_lines():
    figure = blank_figure(6, 4)
    axes = figure.add_subplot()
    axes.set(xlim=(0, 1), ylim=(0, 10))
    label_ends(axes, [("pca", 1.0, 2.0), ("v2v", 1.0, 8.0)])
    places = {text.get_text(): text.get_position() for text in axes.texts}
    assert places["pca"] == pytest.approx((1.035, 0.2))
    assert places["v2v"] == pytest.approx((1.035, 0.8))


def test_labels_are_placed_when_an_error_is_zero_or_unknown_on_a_log_axis():
    axes = blank_figure(6, 4).add_subplot()
    axes.set(xlim=(0, 1), ylim=(1e-3, 10), yscale="log")
    label_ends(axes, [("pca", 1.0, 0.0), ("v2v", 1.0, float("nan"))])
    assert np.isfinite([text.get_position() for text in axes.texts]).all()
