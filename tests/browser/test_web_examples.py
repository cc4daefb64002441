"""The examples of the package for pages play, in Chromium and in Firefox."""

import base64
import re

import pytest

import meshreel
from samples.firefox import message_of
from samples.npm_projects import EXAMPLES, built_example
from samples.page_play import (
    PATIENCE_MS,
    PLAYED,
    WATCHING,
    assert_played,
    assert_shown,
    complaints_of,
)
from samples.web_package import DIST, PACKAGE, built_package, serving, three_files

NAMES = ("plain", "react", "babylon")

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def data():
    return meshreel.encode(meshreel.simulate_flag(30, n_rows=20, n_columns=24))


@pytest.fixture(scope="module")
def pages(data, tmp_path_factory):
    """The files of an example by path; each is made once."""
    made = {}

    def files_of(name):
        if name not in made:
            folder = tmp_path_factory.mktemp(name)
            made[name] = plain() if name == "plain" else built_example(name, folder)
            made[name]["/flag.reel"] = data
            page = made[name]["/index.html"].decode()
            watched = page.replace("<meta", f"<script>{WATCHING}</script><meta", 1)
            made[name]["/index.html"] = watched.encode()
        return made[name]

    return files_of


def plain():
    built = [path for path in built_package().iterdir() if path.suffix in (".js", ".wasm")]
    return {
        **three_files((EXAMPLES / "plain" / "index.html").read_text("utf-8")),
        **{f"/meshreel/{path.name}": path.read_bytes() for path in built},
    }


@pytest.mark.parametrize("name", NAMES)
def test_example_plays_in_chromium(new_page, pages, data, name):
    with serving(pages(name)) as (url, _):
        page = new_page(f"{url}/index.html", width=640, height=400, is_shown=False)
        result = page.evaluate(PLAYED)
        assert_shown(page.screenshot())
    assert_played(result, data, name)


@pytest.mark.parametrize("name", NAMES)
def test_example_plays_in_firefox(pages, data, name):
    files = dict(pages(name))
    telling = f"""<script type="module">
      ({PLAYED})()
        .catch((error) => ({{ error: String(error) }}))
        .then((found) => fetch("/", {{ method: "POST", body: JSON.stringify(found) }}));
    </script>"""
    files["/index.html"] += telling.encode()
    result = message_of(files, "/index.html")
    assert "error" not in result, result
    assert_played(result, data, name)
    assert_shown(base64.b64decode(result["picture"].partition(",")[2]))


def test_a_plain_mesh_needs_no_script_of_textures_or_tracks(new_page, pages, data):
    chunks = re.findall(r"three_chunk\w+", pages("plain")["/meshreel/three.js"].decode())
    names = ["reel.wasm", *(f"{name}.js" for name in ("index", "three", *chunks))]
    needed = {f"/meshreel/{name}" for name in names}
    files = {
        path: body
        for path, body in pages("plain").items()
        if path in needed or not path.startswith("/meshreel/")
    }
    assert needed < set(files)
    with serving(files) as (url, _):
        page = new_page(f"{url}/index.html", width=640, height=400, is_shown=False)
        result = page.evaluate(PLAYED)
    assert_played(result, data, "plain")


def test_react_releases_everything_on_unmount_and_plays_after_remount(new_page, pages):
    with serving(pages("react")) as (url, _):
        page = new_page(f"{url}/index.html", width=640, height=400, is_shown=False)
        page.evaluate(PLAYED)
        assert len(page.workers) == 1
        page.evaluate("mesh.addEventListener('dispose', () => (window.isGone = true))")
        with page.workers[0].expect_event("close", timeout=PATIENCE_MS):
            page.get_by_role("checkbox").click()
        page.wait_for_function("window.isGone", timeout=PATIENCE_MS)
        assert page.workers == []
        page.evaluate("window.mesh = undefined")
        page.get_by_role("checkbox").click()
        result = page.evaluate(PLAYED)
        assert len(page.workers) == 1
    assert complaints_of(result, "react") == []


def test_the_example_with_the_element_plays(new_page, data):
    built_package()
    files = {
        "/index.html": (PACKAGE / "examples" / "element" / "index.html").read_bytes(),
        "/flag.reel": data,
        **{f"/meshreel/{name}": (DIST / name).read_bytes() for name in ("player.js", "reel.wasm")},
    }
    with serving(files) as (url, _):
        page = new_page(f"{url}/index.html", width=640, height=400, is_shown=False)
        player = "document.querySelector('reel-player')"
        page.wait_for_function(f"{player}.mesh?.frame > 3", timeout=PATIENCE_MS)
        assert not page.evaluate(f"{player}.paused")  # no other file was needed
