"""Plots over frames, before they are saved."""

import sys

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from PIL import Image

from meshreel.errors import InvalidInputError
from meshreel.model.sequence import MeshSequence
from meshreel.model.tracks import Track
from meshreel.rendering import plots
from meshreel.rendering.plots import plot_track
from meshreel.rendering.track_colors import TrackLook

LINES = {"original": np.array([1.0, 2, 3]), "decoded": np.array([1.5, np.nan, 3])}


@pytest.fixture
def axes(monkeypatch):
    """A function that plots and returns the axes instead of saving."""
    figures = []
    monkeypatch.setattr(plots, "save_figure", lambda figure, *_, **__: figures.append(figure))

    def plot_axes(*arguments, **options):
        plots.plot_over_time(*arguments, **options)
        return figures[-1].axes[0]

    return plot_axes


def test_plot_has_the_given_lines_and_labels(axes, tmp_path):
    plot = axes(tmp_path / "a.png", "a title", "heat, K", [3, 5, 9], LINES)
    assert (plot.get_xlabel(), plot.get_ylabel()) == ("frame", "heat, K")
    assert plot.get_title(loc="left") == "a title"
    assert [line.get_label() for line in plot.lines] == ["original", "decoded"]
    for line, numbers in zip(plot.lines, LINES.values(), strict=True):
        np.testing.assert_array_equal(line.get_data(), [[3, 5, 9], numbers])
    assert plot.lines[0].get_linewidth() > plot.lines[1].get_linewidth()
    assert [text.get_text() for text in plot.get_legend().texts] == ["original", "decoded"]
    assert [plot.spines[side].get_visible() for side in ("top", "right", "left")] == [0, 0, 1]


@pytest.mark.parametrize(("n_frames", "marker"), [(1, "o"), (2, "None")])
def test_single_frame_is_a_point(axes, tmp_path, n_frames, marker):
    lines = {"decoded": LINES["original"][:n_frames]}
    plot = axes(tmp_path / "a.png", "", "", range(n_frames), lines)
    assert plot.lines[0].get_marker() == marker
    assert plot.get_legend() is None


def test_seconds_begin_at_the_start(axes, tmp_path):
    plot = axes(tmp_path / "a.png", "", "", [0, 1, 2], LINES, fps=25.0, start_s=2.0)
    [seconds] = plot.child_axes
    to_seconds, to_frames = seconds._functions
    assert to_seconds(50) == 4
    assert to_frames(4) == 50
    assert not axes(tmp_path / "a.png", "", "", [0, 1, 2], LINES).child_axes


def test_error_names_the_extra_of_missing_matplotlib(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(InvalidInputError, match=r"pip install 'meshreel\[plot\]'"):
        plots.require_matplotlib()


def heated(grid, values, unit="K", **facts):
    tracks = {"heat": Track(np.asarray(values, np.float32), unit=unit, **facts)}
    return MeshSequence(grid.vertices, grid.faces, 25.0, "grid", 2.0, tracks=tracks)


@pytest.fixture
def plotted(monkeypatch):
    """The arguments of the plot, which is not drawn."""
    captured = {}

    def capture(path, title, label, frames, lines, **options):
        captured.update(title=title, label=label, frames=list(frames), lines=lines, **options)

    monkeypatch.setattr(plots, "plot_over_time", capture)
    return captured


def test_plot_has_the_numbers_of_both_when_there_is_an_original(grid, plotted, tmp_path):
    values = np.arange(12 * 99).reshape(12, 99)
    original, shown = heated(grid, values), heated(grid, values + 0.5)
    plot_track(tmp_path / "a.png", TrackLook("heat"), 7, shown, original, [2, 5])
    assert plotted["title"] == "heat at vertex 7 of grid"
    assert (plotted["label"], plotted["frames"]) == ("heat, K", [2, 5])
    lines = {name: line.tolist() for name, line in plotted["lines"].items()}
    assert lines == {"original": [205, 502], "decoded": [205.5, 502.5]}
    assert (plotted["fps"], plotted["start_s"]) == (25, 2)


def test_plot_has_one_component_of_all_frames_when_it_is_named(grid, plotted, tmp_path):
    values = np.zeros((12, grid.n_faces, 3))
    values[:, 4, 1] = np.arange(12)
    plot_track(tmp_path / "a.png", TrackLook("heat", "y"), 4, heated(grid, values, domain="face"))
    assert plotted["title"] == "heat, y at face 4 of grid"
    assert plotted["lines"]["decoded"].tolist() == list(range(12))


@pytest.mark.parametrize(
    ("item", "look", "message"),
    [
        (99, TrackLook("heat"), "has values of vertex 0 to 98; got 99"),
        (-1, TrackLook("heat"), "got -1"),
        (0, TrackLook("cold"), "there is no track 'cold'"),
    ],
)
def test_plot_is_rejected_when_the_item_or_track_does_not_exist(
    grid, tmp_path, item, look, message
):
    with pytest.raises(InvalidInputError, match=message):
        plot_track(tmp_path / "a.png", look, item, heated(grid, np.zeros((12, 99))))


def test_plot_requires_a_component_when_a_track_has_colors(grid, tmp_path):
    painted = heated(grid, np.zeros((12, 99, 3)), kind="color")
    with pytest.raises(InvalidInputError, match="--component 0"):
        plot_track(tmp_path / "a.png", TrackLook("heat"), 0, painted)


@pytest.mark.parametrize("n_frames", [1, 12])
def test_plot_draws_a_line_for_each_name_when_written(grid, tmp_path, n_frames):
    values = np.sin(np.arange(12)[:, None] / 2 + np.arange(99))
    values[5] = np.nan
    shown, original = heated(grid, values), heated(grid, values + 0.2)
    plot_track(tmp_path / "a.png", TrackLook("heat"), 3, shown, original, range(n_frames))
    with Image.open(tmp_path / "a.png") as image:
        pixels = np.asarray(image.convert("RGB")).reshape(-1, 3)
    for color in (rgb_of("#8C8C8C"), rgb_of("#4B0092")):
        assert (np.abs(pixels.astype(int) - color).max(axis=1) < 8).sum() > 20


def rgb_of(name):
    return np.round(255 * np.array(to_rgb(name))).astype(int)
