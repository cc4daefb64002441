"""The examples of the package for pages play."""

import io

import numpy as np
import pytest
from PIL import Image

import meshreel
from samples.web_package import DIST, PACKAGE, built_package, serving

PATIENCE_MS = 60_000


@pytest.fixture(scope="module", autouse=True)
def _package():
    built_package()


def test_the_example_without_a_bundler_plays(new_page):
    flag = meshreel.simulate_flag(30, n_rows=20, n_columns=24)
    three = PACKAGE / "node_modules" / "three" / "build"
    files = {
        "/index.html": (PACKAGE / "examples" / "plain" / "index.html").read_bytes(),
        "/flag.reel": meshreel.encode(flag),
        **{f"/meshreel/{path.name}": path.read_bytes() for path in DIST.glob("*.js")},
        **{f"/three/{path.name}": path.read_bytes() for path in three.glob("three*.js")},
    }
    with serving(files) as (url, _):
        page = new_page(f"{url}/index.html", width=640, height=400, is_shown=False)
        page.wait_for_function("window.mesh && mesh.frame > 3", timeout=PATIENCE_MS)
        assert page.evaluate("mesh.isOnGpu && mesh.isPlaying")
        page.evaluate("mesh.pause(), mesh.seek({ frame: 12 })")
        page.wait_for_function("!mesh.isWaiting", timeout=PATIENCE_MS)
        page.wait_for_timeout(500)
        picture = np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB"), int)
    background = picture[2, 2]
    is_drawn = np.abs(picture - background).max(axis=2) > 12
    assert 0.05 < is_drawn.mean() < 0.9


def test_the_example_with_the_element_plays(new_page):
    files = {
        "/index.html": (PACKAGE / "examples" / "element" / "index.html").read_bytes(),
        "/flag.reel": meshreel.encode(meshreel.simulate_flag(30, n_rows=20, n_columns=24)),
        "/meshreel/player.js": (DIST / "player.js").read_bytes(),  # and nothing else
    }
    with serving(files) as (url, _):
        page = new_page(f"{url}/index.html", width=640, height=400, is_shown=False)
        player = "document.querySelector('reel-player')"
        page.wait_for_function(f"{player}.mesh?.frame > 3", timeout=PATIENCE_MS)
        assert not page.evaluate(f"{player}.paused")
