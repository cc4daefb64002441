"""Diagrams over frames, before they are stored."""

import sys

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.rendering import plots

LINES = {"original": np.array([1.0, 2, 3]), "decoded": np.array([1.5, np.nan, 3])}


@pytest.fixture
def axes(monkeypatch):
    """The axes of what is plotted, in place of a file."""
    figures = []
    monkeypatch.setattr(plots, "save_figure", lambda figure, *_, **__: figures.append(figure))

    def plotted(*arguments, **options):
        plots.plot_over_time(*arguments, **options)
        return figures[-1].axes[0]

    return plotted


def test_lines_and_words_are_those_given(axes, tmp_path):
    found = axes(tmp_path / "a.png", "a title", "heat, K", [3, 5, 9], LINES)
    assert (found.get_xlabel(), found.get_ylabel()) == ("frame", "heat, K")
    assert found.get_title(loc="left") == "a title"
    assert [line.get_label() for line in found.lines] == ["original", "decoded"]
    for line, numbers in zip(found.lines, LINES.values(), strict=True):
        np.testing.assert_array_equal(line.get_data(), [[3, 5, 9], numbers])
    assert found.lines[0].get_linewidth() > found.lines[1].get_linewidth()
    assert [text.get_text() for text in found.get_legend().texts] == ["original", "decoded"]
    assert [found.spines[side].get_visible() for side in ("top", "right", "left")] == [0, 0, 1]


@pytest.mark.parametrize(("n_frames", "marker"), [(1, "o"), (2, "None")])
def test_a_single_frame_is_a_point(axes, tmp_path, n_frames, marker):
    one = {"decoded": LINES["original"][:n_frames]}
    found = axes(tmp_path / "a.png", "", "", range(n_frames), one)
    assert found.lines[0].get_marker() == marker
    assert found.get_legend() is None


def test_seconds_begin_at_the_start(axes, tmp_path):
    found = axes(tmp_path / "a.png", "", "", [0, 1, 2], LINES, fps=25.0, start_s=2.0)
    [seconds] = found.child_axes
    to_seconds, to_frames = seconds._functions
    assert to_seconds(50) == 4
    assert to_frames(4) == 50
    assert not axes(tmp_path / "a.png", "", "", [0, 1, 2], LINES).child_axes


def test_the_extra_is_named_when_matplotlib_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(InvalidInputError, match=r"pip install 'meshreel\[plot\]'"):
        plots.require_matplotlib()
