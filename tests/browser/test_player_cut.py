"""Volume meshes cut open in the player."""

import numpy as np
import pytest

import meshreel
from conformance.sources import boxes, of_type
from samples.player_pages import picture_of, viewing, wait_until

CENTER = [2.0, 2.0, 2.0]


@pytest.fixture(scope="module")
def block_url(browser, tmp_path_factory):
    """Address of a page of a block that is hot inside."""
    points, cells = boxes(4, 4, 4)
    path = tmp_path_factory.mktemp("cut") / "block.reel"
    heat = (np.abs(points[cells].mean(axis=1) - CENTER) < 0.6).all(axis=1).astype(np.float32)
    tracks = {"heat": meshreel.Track(heat[None], domain="cell")}
    block = meshreel.MeshSequence(points[None], cells=of_type(12, cells), tracks=tracks)
    path.write_bytes(meshreel.encode(block))
    with viewing(path, "--track", "heat", "--range", "0:1") as (_, address):
        yield address


def is_yellow(page):
    red, green, blue = picture_of(page, "canvas").astype(int).reshape(-1, 3).T
    return ((red > 150) & (green > 120) & (blue < 100)).sum() > 50


def n_triangles(page):
    return page.evaluate("document.querySelector('reel-player').mesh.surface.triangles.length / 3")


def cut(page, selector, n_expected):
    page.locator(selector).click()
    wait_until(
        page,
        f"document.querySelector('reel-player').mesh.surface.triangles.length === {3 * n_expected}",
    )
    page.evaluate("player.seek(0)")


def test_cut_shows_the_inside(new_page, block_url):
    page = new_page(block_url)
    assert n_triangles(page) == 2 * 6 * 16
    assert not is_yellow(page)
    assert not page.locator("#cut-place").is_visible()
    cut(page, "#cut label:has([value=z])", 2 * (2 * 16 + 4 * 8))
    assert is_yellow(page)
    page.locator("#cut-place").fill("20")
    wait_until(page, "document.querySelector('reel-player').mesh.surface.triangles.length === 288")
    page.evaluate("player.seek(0)")
    assert not is_yellow(page)
    cut(page, "#cut-side", 2 * (2 * 16 + 4 * 12))
    cut(page, "#cut label:has([value=none])", 2 * 6 * 16)
    assert not page.locator("#cut-place").is_visible()


def test_surface_has_no_controls_for_cuts(new_page, tmp_path):
    flag = meshreel.simulate_flag(3, n_rows=8, n_columns=8)
    (tmp_path / "flag.reel").write_bytes(meshreel.encode(flag))
    with viewing(tmp_path / "flag.reel") as (_, address):
        page = new_page(address)
        assert not page.locator("#cuts").is_visible()
