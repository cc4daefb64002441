"""What a notebook shows of a sequence and of a file."""

import base64
import re
from html import unescape
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

import meshreel.app.notebook.html as notebook
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import InvalidInputError
from meshreel.model.sequence import MeshSequence
from samples.costs import slow_but
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


def picture_in(html):
    data = re.search(r"data:image/png;base64,([A-Za-z0-9+/=]+)", html)[1]
    with Image.open(BytesIO(base64.b64decode(data))) as image:
        return np.asarray(image.convert("RGB"))


@pytest.mark.parametrize("kind", ["sequence", "file"])
def test_player_in_a_frame_carries_the_animation_when_it_is_small(reel, kind):
    shown = reel if kind == "file" else waving_grid(12)
    html = shown._repr_html_()
    data = carried(framed_page(html))
    np.testing.assert_array_equal(decode(data["stream"]).vertices, reel[:])
    assert data["facts"]["name"] == "grid"


def test_figures_of_a_file_stand_above_its_player(reel):
    html = reel._repr_html_()
    info = reel.info()
    assert f"{info.ratio:.0f} x smaller" in html
    assert f"{info.rate_bpvf:.3f} bits per vertex and frame" in html


def test_sequence_says_that_it_is_shown_as_encoded_when_it_plays():
    size = len(encode(waving_grid(12)))
    assert f"as encode() makes it by default, of {size:,} bytes" in waving_grid(12)._repr_html_()


@pytest.mark.parametrize("limit", slow_but(["MOST_HTML_BYTES"], ["MOST_PLAYED", "MOST_HTML_BYTES"]))
def test_picture_and_figures_are_shown_when_the_player_would_be_large(reel, monkeypatch, limit):
    monkeypatch.setattr(notebook, limit, 100)
    html = reel._repr_html_()
    assert "iframe" not in html
    assert "show()" in html
    assert f"{reel.info().ratio:.0f} x smaller" in html
    picture = picture_in(html)
    assert 0.1 < (picture != 255).any(axis=2).mean() < 0.9


def test_picture_is_shown_when_the_page_is_not_built(monkeypatch):
    def missing():
        raise InvalidInputError("the page of the player is not built")

    monkeypatch.setattr(notebook, "built_page", missing)
    assert (picture_in(waving_grid(12)._repr_html_()) != 255).any()


@pytest.mark.slow
def test_picture_is_small_and_soon_there_when_the_mesh_is_large():
    large = waving_grid(40, 120, 120)
    assert large.n_frames * large.n_verts > notebook.MOST_ENCODED
    html = large._repr_html_()
    assert "data:image/png" in html
    assert len(html) < 1_000_000


def test_figures_alone_are_shown_when_there_are_too_many_faces_to_draw(monkeypatch):
    monkeypatch.setattr(notebook, "MOST_DRAWN_FACES", 10)
    monkeypatch.setattr(notebook, "MOST_ENCODED", 10)
    html = waving_grid(2)._repr_html_()
    assert "none, for so many faces" in html
    assert "<img" not in html


def test_name_cannot_break_out_when_it_holds_html():
    grid = waving_grid(3)
    named = MeshSequence(grid.vertices, grid.faces, name='</iframe><script>"boo"</script>')
    html = named._repr_html_()
    assert "<script>" not in html
    assert "</iframe><" not in html.removesuffix("</iframe>")


@pytest.mark.parametrize(("most", "n_poses"), [(160, 4), (159, 1)])
def test_picture_has_one_pose_when_faces_are_many(monkeypatch, most, n_poses):
    monkeypatch.setattr(notebook, "MOST_FACES", most)
    [words] = re.findall(r'<img alt="([^"]*)"', notebook._picture_html(waving_grid(12)))
    assert len(words.split(", ")) == n_poses
