"""Plots over frames, before they are saved."""

import sys

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.rendering import plots

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
