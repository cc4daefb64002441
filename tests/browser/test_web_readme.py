"""The program for three.js in the README of the npm package plays."""

import numpy as np
import pytest

import meshreel
from samples.element_pages import until
from samples.page_play import assert_shown
from samples.pages import snippets
from samples.web_package import PACKAGE, THREE_PAGE, serving, three_files

pytestmark = pytest.mark.slow

PAGE = f"""<!doctype html><html lang="en">{THREE_PAGE}<body></body><script type="module">"""
PROGRAMS = [
    snippet.text for snippet in snippets(PACKAGE / "README.md") if snippet.text.startswith("import")
]
MILLIMETERS = 1000


def test_program_of_three_plays_a_model_in_millimeters_without_scroll_bars(new_page):
    [program] = [one for one in PROGRAMS if "ReelLoader" in one]
    flag = meshreel.simulate_flag(30, n_rows=12, n_columns=15)
    large = meshreel.MeshSequence(flag.vertices * np.float32(MILLIMETERS), flag.faces, fps=flag.fps)
    page = f"{PAGE}{program}\nObject.assign(window, {{ mesh }});</script></html>"
    files = {**three_files(page), "/walk.reel": meshreel.encode(large)}
    with serving(files) as (url, _):
        page = new_page(f"{url}/index.html", width=640, height=400, is_shown=False)
        until(page, "window.mesh?.frame > 2")
        sizes = "[scrollWidth, scrollHeight, clientWidth, clientHeight]"
        result = page.evaluate(f"(({{ {sizes[1:-1]} }}) => {sizes})(document.documentElement)")
        assert result == [640, 400, 640, 400]
        assert_shown(page.screenshot())
        page.close()  # while the server runs
