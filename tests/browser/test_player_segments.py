"""`meshreel view` and `export` play files with several segments."""

import subprocess

import numpy as np
import pytest

import meshreel
from samples.meshes import quad_sheet, waving_grid
from samples.player_pages import COMMAND, picture_of, positions_of, show, viewing, wait_until

FRAMES = [0, 5, 6, 9, 2, 10, 7]
"""Forward and back across the boundaries at frames 6 and 10."""


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    grid, sheet = waving_grid(6).replace(fps=24.0), quad_sheet(4)
    sequence = meshreel.concatenate([grid, sheet, grid.replace(vertices=grid.vertices[:3])])
    path = tmp_path_factory.mktemp("segments") / "three.reel"
    path.write_bytes(meshreel.encode(sequence))
    return path


@pytest.fixture(scope="module")
def decoded(path):
    return meshreel.decode(path)


@pytest.fixture(scope="module")
def exported(path):
    page = path.with_suffix(".html")
    subprocess.run([*COMMAND, "export", path, "-o", page], check=True, capture_output=True)
    return page.as_uri()


def assert_frames_match(page, decoded):
    for frame in FRAMES:
        show(page, frame)
        assert page.evaluate("player.state().frame") == frame
        np.testing.assert_allclose(positions_of(page), decoded[frame].vertices, atol=1e-3)


def test_frames_match_decode_across_boundaries(new_page, path, decoded):
    with viewing(path) as (_, url):
        page = new_page(url)
        assert_frames_match(page, decoded)
        page.evaluate("player.play()")
        wait_until(page, "player.state().frame >= 7")


def test_exported_page_shows_edges_of_the_current_segment(new_page, exported, decoded):
    page = new_page(exported)
    page.keyboard.press("w")
    assert_frames_match(page, decoded)
    show(page, 7)
    first = picture_of(page, "canvas")
    show(page, 1)
    show(page, 7)
    assert np.abs(picture_of(page, "canvas").astype(int) - first).max() <= 8


def test_a_comparison_is_refused(path):
    command = [*COMMAND, "export", path, "--original", path, "-o", path.with_name("a.html")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "a comparison in the player needs the same faces in every frame" in " ".join(
        done.stderr.split()
    )
