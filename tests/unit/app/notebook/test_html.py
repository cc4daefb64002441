"""HTML of sequences and files in notebooks."""

import re
from html import unescape
from io import BytesIO

import numpy as np
import pytest

from meshreel.app.notebook import show as notebook
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import InvalidInputError
from meshreel.model.sequence import MeshSequence
from samples.meshes import waving_grid
from samples.players import PAGE, carried


@pytest.fixture(autouse=True)
def _page(monkeypatch):
    monkeypatch.setattr(notebook, "built_page", lambda: PAGE)


@pytest.fixture
def reel():
    with ReelFile(BytesIO(encode(waving_grid(12)))) as opened:
        yield opened


def framed_page(html):
    return unescape(re.search(r'<iframe srcdoc="([^"]*)"', html)[1])


@pytest.mark.parametrize("kind", ["sequence", "file"])
def test_framed_player_contains_the_animation_when_it_is_small(reel, kind):
    animation = reel if kind == "file" else waving_grid(12)
    html = animation._repr_html_()
    data = carried(framed_page(html))
    np.testing.assert_array_equal(decode(data["stream"]).vertices, reel[:].vertices)
    assert data["facts"]["name"] == "grid"


def test_html_of_a_file_contains_its_figures(reel):
    html = reel._repr_html_()
    info = reel.info()
    assert f"{info.ratio:.1f} x smaller" in html
    assert f"{info.rate_bpvf:.3f} bits per vertex and frame" in html


def test_html_of_a_sequence_says_that_the_player_shows_its_encoding():
    size = len(encode(waving_grid(12)))
    assert f"encoded with default options, {size:,} bytes" in waving_grid(12)._repr_html_()


@pytest.mark.parametrize("kind", ["sequence", "file"])
def test_player_shows_changing_faces(kind):
    sequence = MeshSequence.of_segments([waving_grid(4), waving_grid(3, 5, 6)])
    data = encode(sequence)
    with ReelFile(BytesIO(data)) as opened:
        html = (opened if kind == "file" else sequence)._repr_html_()
    assert carried(framed_page(html))["stream"] == data


@pytest.mark.parametrize("limit", ["MAX_PLAYED", "MAX_AUTOMATIC_BYTES"])
def test_figures_are_shown_when_the_player_is_too_large(reel, monkeypatch, limit):
    monkeypatch.setattr(notebook, limit, 100)
    html = reel._repr_html_()
    assert "iframe" not in html
    assert "show()" in html
    assert f"{reel.info().ratio:.1f} x smaller" in html


def test_figures_are_shown_when_the_page_is_not_built(monkeypatch):
    def missing():
        raise InvalidInputError("the page of the player is not built")

    monkeypatch.setattr(notebook, "built_page", missing)
    assert "<b>vertices</b> 99" in waving_grid(12)._repr_html_()


def test_name_is_escaped_when_it_contains_html():
    grid = waving_grid(3)
    named = MeshSequence(grid.vertices, grid.faces, name='</iframe><script>"boo"</script>')
    html = named._repr_html_()
    assert "<script>" not in html
    assert "</iframe><" not in html.removesuffix("</iframe>")


@pytest.mark.parametrize(
    ("kind", "figures"),
    [
        ("sequence", ["<b>frames</b> 7", "<b>vertices</b> 99"]),
        ("file", ["7 frames in 2 segments, up to 99 vertices"]),
    ],
)
def test_figures_show_changing_faces(kind, figures, monkeypatch):
    for limit in ("MAX_ENCODED", "MAX_PLAYED"):
        monkeypatch.setattr(notebook, limit, 0)
    sequence = MeshSequence.of_segments([waving_grid(4), waving_grid(3, 5, 6)])
    with ReelFile(BytesIO(encode(sequence))) as opened:
        html = (opened if kind == "file" else sequence)._repr_html_()
    assert "iframe" not in html
    assert all(figure in html for figure in figures)
