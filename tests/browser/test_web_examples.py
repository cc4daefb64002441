"""The examples of the package for pages play, in Chromium and in Firefox."""

import base64
import io
from queue import Queue

import numpy as np
import pytest
from PIL import Image

import meshreel
from samples.firefox import require_screen, said_by
from samples.npm_projects import EXAMPLES, built_example
from samples.web_package import DIST, PACKAGE, built_package, serving

PATIENCE_MS = 60_000
NAMES = ("plain", "react", "babylon")

pytestmark = pytest.mark.slow

WATCHING = """
window.complaints = [];
addEventListener("error", (event) => complaints.push(event.message));
addEventListener("unhandledrejection", (event) => complaints.push(String(event.reason)));
for (const kind of ["error", "warn"]) {
  const say = console[kind];
  console[kind] = (...words) => (complaints.push(words.join(" ")), say(...words));
}
const contextOf = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, options) {
  return contextOf.call(this, kind, { ...options, preserveDrawingBuffer: true });
};
"""
"""Before all scripts of a page: what is wrong is noted, and pictures can be read."""

PLAYED = """async () => {
  const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
  const until = async (what, isSo) => {
    for (const end = performance.now() + PATIENCE_MS; !isSo(); await pause(20)) {
      if (performance.now() > end) throw new Error(`waited for ${what}; ${complaints}`);
    }
  };
  await until("a mesh", () => window.mesh);
  const isReelMesh = mesh.type === "ReelMesh";
  const frames = new Set();
  await until("four frames", () => {
    if (!mesh.isWaiting) frames.add(isReelMesh ? mesh.frame : mesh.metadata.frame);
    return frames.size >= 4;
  });
  let frame, positions;
  if (isReelMesh) {
    mesh.pause();
    mesh.seek({ frame: (frame = 12) });
    await until("frame 12", () => !mesh.isWaiting && mesh.frame === frame);
    const one = mesh.position.clone();
    positions = Array.from(mesh.sources, (_, i) => mesh.getVertexPosition(i, one).toArray()).flat();
  } else {
    frame = mesh.metadata.frame;
    positions = [...mesh.getVerticesData("position")];
  }
  await pause(500); // some pictures
  const picture = document.querySelector("canvas").toDataURL();
  const origin = mesh.reel?.info.center;
  const { isOnGpu } = mesh;
  return { frames: [...frames], frame, positions, origin, isOnGpu, picture, complaints };
}""".replace("PATIENCE_MS", str(PATIENCE_MS))


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
    built_package()
    three = PACKAGE / "node_modules" / "three" / "build"
    return {
        "/index.html": (EXAMPLES / "plain" / "index.html").read_bytes(),
        **{f"/meshreel/{path.name}": path.read_bytes() for path in DIST.glob("*.js")},
        **{f"/three/{path.name}": path.read_bytes() for path in three.glob("three*.js")},
    }


def complaints_of(name, found):
    """What the page said, but for a word of three.js on what React's renderer makes of it."""
    known = "THREE.Clock: This module has been deprecated" if name == "react" else None
    return [one for one in found["complaints"] if not (known and one.startswith(known))]


def assert_played(name, found, data):
    """Frames passed, and the one that was shown is that of Python."""
    assert complaints_of(name, found) == []
    assert len(found["frames"]) >= 4
    assert found.get("isOnGpu") is (None if name == "babylon" else True)
    decoded = meshreel.decode(data).vertices[found["frame"]]
    positions = np.reshape(found["positions"], (-1, 3))
    if name == "babylon":
        assert np.array_equal(positions, np.float32(decoded))
        return
    origin = found["origin"] if name == "react" else 0
    diagonal = np.linalg.norm(np.ptp(decoded, axis=0))
    assert np.abs(positions + origin - decoded).max() < 1e-4 * diagonal


def assert_shown(png):
    """Something is shown, from its front, on which light falls."""
    picture = np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), int)
    is_drawn = np.abs(picture - picture[-3, 2]).max(axis=2) > 12
    assert 0.05 < is_drawn.mean() < 0.9
    assert picture[is_drawn].mean() > 96


@pytest.mark.parametrize("name", NAMES)
def test_example_plays_in_chromium(new_page, pages, data, name):
    with serving(pages(name)) as (url, _):
        page = new_page(f"{url}/index.html", width=640, height=400, is_shown=False)
        found = page.evaluate(PLAYED)
        assert_shown(page.screenshot())
    assert_played(name, found, data)


@pytest.mark.parametrize("name", NAMES)
def test_example_plays_in_firefox(pages, data, name):
    require_screen()
    posted = Queue()
    files = dict(pages(name))
    telling = f"""<script type="module">
      ({PLAYED})()
        .catch((error) => ({{ error: String(error) }}))
        .then((found) => fetch("/", {{ method: "POST", body: JSON.stringify(found) }}));
    </script>"""
    files["/index.html"] += telling.encode()
    with serving(files, posted=posted) as (url, _):
        found = said_by(f"{url}/index.html", posted)
    assert "error" not in found, found
    assert_played(name, found, data)
    assert_shown(base64.b64decode(found["picture"].partition(",")[2]))


def test_react_lets_all_go_when_the_component_goes_and_plays_again_when_it_comes(new_page, pages):
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
        found = page.evaluate(PLAYED)
        assert len(page.workers) == 1
    assert complaints_of("react", found) == []
