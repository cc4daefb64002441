"""The built player page, served and exported."""

import base64
import os
import re
import subprocess
import sys
import tomllib
import zlib
from importlib.metadata import version
from pathlib import Path

import pytest

from meshreel.app.viewer.page import Page, built_page
from meshreel.errors import InvalidInputError
from samples.players import PAGE, carried, write_page
from samples.web_package import built_package

ROOT = Path(__file__).parents[4]
PAGE_FOLDER = "src/meshreel/app/viewer/page"


@pytest.mark.slow
def test_page_in_the_repository_equals_a_new_build(tmp_path):
    built_package()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    if f"ziglang=={version('ziglang')}" not in project["optional-dependencies"]["core"]:
        pytest.skip("needs the version of ziglang that the extra `core` names")
    command = ["npm", "run", "build:page", "--", str(tmp_path)]
    environment = {**os.environ, "PYTHON": sys.executable}
    subprocess.run(
        command, cwd=ROOT / "npm", env=environment, check=True, capture_output=True, timeout=300
    )
    built = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    stored = {file.name: file.read_bytes() for file in (ROOT / PAGE_FOLDER).iterdir()}
    assert set(built) == set(stored), "the page is older than its sources: rebuild it"
    for name, data in built.items():
        assert data == stored[name], f"{name} is older than its sources: rebuild it"


def test_page_and_script_contain_the_license_of_three_js():
    page = built_page()
    pages = [page.served, page.split({}), page.whole({}), page.script]
    notices = ["three.js authors", "Permission is hereby granted, free of charge"]
    assert all(notice in text for text in pages for notice in notices)


def test_built_page_reads_page_and_script(tmp_path):
    assert built_page(write_page(tmp_path / "page")) == PAGE


@pytest.mark.parametrize("missing", ["index.html", "player.js"])
def test_error_says_how_to_get_the_page_when_a_file_is_missing(tmp_path, missing):
    folder = write_page(tmp_path / "page")
    (folder / missing).unlink()
    with pytest.raises(InvalidInputError, match=r"is missing.*reinstall.*CONTRIBUTING"):
        built_page(folder)


@pytest.mark.parametrize("html", ["<html></html>", "<!--meshreel-data-->", "<!--script-->"])
def test_page_is_rejected_when_it_lacks_a_placeholder(html):
    with pytest.raises(InvalidInputError, match="has no placeholder for data; rebuild it"):
        Page(html, PAGE.script)


def test_served_page_references_the_script():
    assert PAGE.served == (
        "<!doctype html><html><head><title>p</title></head>"
        '<body><script type="module" src="player.js"></script></body></html>'
    )


def test_whole_page_contains_data_and_the_script():
    html = PAGE.whole({"a": {"b": [1.5, float("nan")]}})
    (packed,) = re.findall(r'<script id="packed-script" type="text/plain">([^<]*)</script>', html)
    assert zlib.decompress(base64.b64decode(packed), -15).decode() == PAGE.script
    assert carried(html) == {"a": {"b": [1.5, None]}}


@pytest.mark.parametrize("form", ["whole", "split"])
def test_data_cannot_close_their_script_element(form):
    name = "</script><script>alert(1)</script>\u2028<!--"
    html = getattr(PAGE, form)({"facts": {"name": name}})
    assert "alert(1)</script>" not in html
    assert carried(html) == {"facts": {"name": name}}
