"""The page of the package, and the forms in which it goes out."""

import base64
import re
import zlib

import pytest

from meshreel.errors import InvalidInputError
from meshreel.viewer.page import Page, built_page
from samples.players import PAGE, carried, write_page


def test_page_and_script_are_read_when_they_are_there(tmp_path):
    assert built_page(write_page(tmp_path / "page")) == PAGE


@pytest.mark.parametrize("missing", ["index.html", "player.js"])
def test_error_says_how_to_get_the_page_when_it_is_not_built(tmp_path, missing):
    folder = write_page(tmp_path / "page")
    (folder / missing).unlink()
    with pytest.raises(InvalidInputError, match=r"npm ci && npm run build.*wheel"):
        built_page(folder)


@pytest.mark.parametrize("html", ["<html></html>", "<!--meshreel-data-->", "<!--script-->"])
def test_page_is_refused_when_it_has_no_place_for_something(html):
    with pytest.raises(InvalidInputError, match="has no place for data; build it anew"):
        Page(html, "")


def test_script_is_beside_the_page_when_it_is_served():
    assert PAGE.served == (
        "<!doctype html><html><head><title>p</title></head>"
        '<body><script src="player.js"></script></body></html>'
    )


def test_script_and_data_are_inside_the_page_when_it_is_whole():
    html = PAGE.whole({"a": {"b": [1.5, float("nan")]}})
    packed = re.search(r'<script id="packed" type="text/plain">([^<]*)</script>', html)[1]
    assert zlib.decompress(base64.b64decode(packed), -15).decode() == PAGE.script
    assert carried(html) == {"a": {"b": [1.5, None]}}


@pytest.mark.parametrize("form", ["whole", "split"])
def test_data_cannot_end_their_script_when_they_try(form):
    name = "</script><script>alert(1)</script>\u2028<!--"
    html = getattr(PAGE, form)({"facts": {"name": name}})
    assert "alert(1)</script>" not in html
    assert carried(html) == {"facts": {"name": name}}
