"""<reel-player> while images, servers and WebGL contexts appear and disappear."""

import io
import re
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import meshreel
from meshreel.model.materials import Image as FileImage
from meshreel.model.materials import Material, Texture
from meshreel.model.surface import FaceGroups
from samples.browser import checked_rules
from samples.element_pages import PAGE, PATIENCE_S, picture, press, settled, showing, text_of, until
from samples.numbered_video import moving_sheet
from samples.web_package import DIST, serving

pytestmark = pytest.mark.slow

SLOW_IMAGES = """
const given = window.createImageBitmap;
window.createImageBitmap = async (...what) => {
  await new Promise((resolve) => setTimeout(resolve, 500));
  return given(...what);
};
"""

NETWORK = """
window.isCut = false;
window.nAsked = 0;
const given = window.fetch;
window.fetch = async (...what) => {
  window.nAsked++;
  if (window.isCut) throw new TypeError("Failed to fetch");
  return given(...what);
};
const wait = window.setTimeout;
window.setTimeout = (run, ms, ...more) => wait(run, window.isCut ? Math.min(ms, 50) : ms, ...more);
"""
"""Without a network once `isCut` is true; pauses before further attempts are then short."""


@pytest.fixture(scope="module")
def files():
    flag = meshreel.simulate_flag(45, n_rows=20, n_columns=30)
    # More bytes than in the first request, so that later blocks need further requests.
    large = meshreel.simulate_flag(60, n_rows=40, n_columns=50)
    return {
        "/page.css": b"body { margin: 0; font: 16px sans-serif; background: #fff }",
        "/flag.reel": meshreel.encode(flag, max_error=0.02, effort=5, block_frames=15),
        "/large.reel": meshreel.encode(large, max_error=0.001, effort=1, block_frames=15),
        "/gold.reel": meshreel.encode(golden_sheet(), max_error=0.01, effort=5),
        "/red.reel": meshreel.encode(red_sheet(), max_error=0.01, effort=5),
        "/noise.reel": meshreel.encode(noisy_sheet(), max_error=0.01, effort=5),
    }


def with_material(sheet, material, images=()):
    groups = FaceGroups("material", (material.name,), np.zeros(len(sheet.faces), np.int32))
    surface = replace(sheet.surface, groups=(groups,), materials=(material,), images=images)
    return sheet.replace(surface=surface)


def golden_sheet():
    """A flag with a gold material."""
    flag = meshreel.simulate_flag(10, n_rows=12, n_columns=18)
    gold = Material(
        "gold", base_color=(1, 0.75, 0.3, 1), metallic=1, roughness=0.2, double_sided=True
    )
    return with_material(flag, gold)


def red_sheet():
    """A sheet whose material shows a red image."""
    return painted_sheet(Image.new("RGB", (4, 4), (230, 20, 20)))


def noisy_sheet():
    """A sheet with an image of about 200,000 bytes."""
    noise = np.random.default_rng(1).integers(0, 256, (260, 260, 3), np.uint8)
    return painted_sheet(Image.fromarray(noise))


def painted_sheet(picture):
    stored = io.BytesIO()
    picture.save(stored, "png")
    material = Material("paint", base_color_texture=Texture(0, "st"), double_sided=True)
    image = FileImage("paint.png", "image/png", stored.getvalue())
    return with_material(moving_sheet(10), material, (image,))


@pytest.fixture
def shown(new_page, files):
    """Opens a page with a body; `player` is its first player."""
    with showing(new_page, files) as show:
        yield show


def redness(page):
    red, green, _ = picture(page).transpose(2, 0, 1)
    return (red - green > 100).mean()


def until_red(page):
    end = time.monotonic() + PATIENCE_S
    while redness(page) <= 0.05:
        assert time.monotonic() < end, f"waited {PATIENCE_S} s for the red image"
        page.wait_for_timeout(50)


def test_images_of_the_file_are_drawn_when_the_player_is_paused(shown):
    page = shown('<reel-player src="/red.reel"></reel-player>', script=SLOW_IMAGES)
    settled(page)
    until_red(page)


LARGE_IMAGES = """
const given = window.fetch;
window.ranges = [];
window.gate = new Promise((resolve) => (window.release = resolve));
window.fetch = async (request, ...more) => {
  const [first, last] = (request.headers?.get("range") ?? "").match(/\\d+/g)?.map(Number) ?? [];
  if (last) ranges.push([first, last - first + 1]);
  if (last - first > 100000) await gate;
  return given(request, ...more);
};
"""
"""Delays requests of more than 100,000 bytes until `release` is called."""


def test_the_first_picture_does_not_wait_for_images(shown):
    page = shown('<reel-player src="/noise.reel"></reel-player>', script=LARGE_IMAGES)
    settled(page)
    assert 0.05 < (np.abs(picture(page) - 255).max(axis=2) > 12).mean() < 0.9
    hasImage = "[player.mesh.material].flat().some(({ map }) => map)"
    assert not page.evaluate(hasImage)
    page.evaluate("release()")
    until(page, hasImage)
    ranges = page.evaluate("ranges")
    assert len(ranges) <= 4
    assert min(size for _, size in ranges) > 1000


def test_time_runs_forward_when_loop_is_removed_while_it_runs_back(shown):
    page = shown('<reel-player src="/flag.reel" loop="pingpong" speed="3"></reel-player>')
    settled(page)
    page.evaluate("player.mesh.addEventListener('loop', () => (player.loop = false))")
    page.evaluate("player.play()")
    until(page, "player.paused")
    assert page.evaluate("player.currentTime === player.duration")


def test_error_is_cleared_when_the_context_is_restored(shown):
    page = shown('<reel-player src="/red.reel" controls></reel-player>')  # with an image
    settled(page)
    page.evaluate(
        """() => {
          const canvas = player.shadowRoot.querySelector("canvas");
          window.extension = canvas.getContext("webgl2").getExtension("WEBGL_lose_context");
          extension.loseContext();
        }"""
    )
    until(page, "player.error")
    assert "WebGL context" in text_of(page, "[role=alert]")
    page.evaluate("extension.restoreContext()")
    until(page, "player.error === null")
    assert text_of(page, "[role=alert]") == ""
    settled(page)
    until_red(page)
    page.evaluate("player.remove()")  # frees all resources
    page.wait_for_timeout(100)


def test_long_errors_can_be_read_in_narrow_players(shown):
    name = "a" * 60
    page = shown(f'<reel-player src="/{name}.reel" controls></reel-player>')
    page.evaluate("player.style.width = '320px'")
    until(page, "player.error")
    edges = page.evaluate(
        """() => {
          const edgesOf = (name) => {
            const { top, bottom } = player.shadowRoot.querySelector(name).getBoundingClientRect();
            return [top, bottom];
          };
          const alert = player.shadowRoot.querySelector("[role=alert]");
          const names = [".picture", "[role=alert]", "[role=alert] button", "[role=alert] p"];
          const atStart = names.map(edgesOf);
          alert.scrollTo(0, 1e6);
          return [...atStart, edgesOf("[role=alert] p")];
        }"""
    )
    picture, alert, button, text, text_at_end = edges
    assert text[1] <= button[0]
    assert picture[0] <= alert[0] <= text[0]
    assert text_at_end[1] <= alert[1] <= picture[1]
    assert button[1] <= alert[1]


def test_keys_work_while_a_button_of_the_bar_has_the_focus(shown):
    page = shown('<reel-player src="/flag.reel" controls></reel-player>')
    settled(page)
    frame = "player.mesh.frame"
    press(page, "[aria-label='Next frame']", "End")
    until(page, f"{frame} === 44")
    press(page, "[aria-label='Play']", "ArrowLeft", ",")
    until(page, f"{frame} === 42")
    press(page, "[aria-label='Time']", ",", "ArrowLeft", "Home", ".")
    until(page, f"{frame} === 1")
    press(page, "[aria-label='Next frame']", " ")  # pressed by the browser
    until(page, f"{frame} === 2")
    assert page.evaluate("player.paused")
    page.locator("reel-player").get_by_role("button", name="Next frame").click()
    page.keyboard.press(" ")
    until(page, "!player.paused")


def test_fields_of_the_page_in_the_player_keep_their_keys(shown):
    page = shown(
        '<reel-player src="/flag.reel"><input id="note" slot="overlay" value="a"></reel-player>'
    )
    settled(page)
    page.locator("#note").focus()
    for key in ("End", " ", ".", "Home", ","):
        page.keyboard.press(key)
    assert page.locator("#note").input_value() == ",a ."
    assert page.evaluate("[player.paused, player.mesh.frame]") == [True, 0]


@pytest.mark.parametrize("how", ["online", "button"])
def test_the_file_is_reopened_after_a_network_failure(shown, how):
    page = shown("<reel-player controls></reel-player>", script=NETWORK)
    page.evaluate("window.isCut = true; player.src = '/flag.reel'")
    until(page, "player.error")
    page.evaluate("window.isCut = false")
    if how == "online":
        page.evaluate("window.dispatchEvent(new Event('online'))")
    else:
        page.locator("reel-player").get_by_role("button", name="Try again").click()
    settled(page)
    assert page.evaluate("[player.error, player.paused]") == [None, True]
    assert text_of(page, "[role=alert]") == ""


@pytest.mark.parametrize("how", ["online", "button", "seek"])
def test_a_missing_block_is_loaded_after_a_network_failure(shown, how):
    page = shown('<reel-player src="/large.reel" controls></reel-player>', script=NETWORK)
    settled(page)
    page.evaluate("window.isCut = true; player.seek({ frame: 59 })")
    until(page, "player.error")
    assert text_of(page, "[role=alert] p").startswith("Frames ")
    assert text_of(page, ".waiting") == ""  # nothing is loading
    page.evaluate("window.isCut = false")
    if how == "online":
        page.evaluate("window.dispatchEvent(new Event('online'))")
    elif how == "button":
        page.locator("reel-player").get_by_role("button", name="Try again").click()
    else:
        page.evaluate("player.seek({ frame: 58 })")
    settled(page)
    until(page, "player.error === null")
    assert text_of(page, "[role=alert]") == ""


def test_error_of_an_attribute_offers_no_retry_and_stays(shown):
    page = shown('<reel-player src="/flag.reel" loop="no"></reel-player>')
    until(page, "player.error")
    assert page.locator("reel-player").get_by_role("button", name="Try again").count() == 0
    page.evaluate("window.dispatchEvent(new Event('online'))")
    page.wait_for_timeout(100)
    assert page.evaluate("player.error.name") == "InvalidInputError"


def test_empty_src_requests_nothing(shown):
    page = shown('<reel-player src="" poster=""></reel-player>', script=NETWORK)
    page.wait_for_timeout(300)
    assert page.evaluate("[player.error, window.nAsked]") == [None, 0]
    assert text_of(page, ".waiting") == ""


def test_dragging_the_thumb_stops_time(shown):
    page = shown('<reel-player src="/flag.reel" autoplay loop controls></reel-player>')
    page.evaluate("player.style.width = '600px'")  # keeps the bar in the window
    until(page, "player.mesh && player.mesh.frame > 2")
    page.evaluate("window.told = []; for (const type of ['play', 'pause'])"
                  "player.addEventListener(type, () => told.push(type))")  # fmt: skip
    box = page.locator("reel-player input").bounding_box()
    middle = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + box["width"] / 2, middle)
    page.mouse.down()
    until(page, "20 < player.mesh.frame && player.mesh.frame < 25")
    held = page.evaluate("player.mesh.frame")
    page.wait_for_timeout(300)
    assert page.evaluate("[player.mesh.frame, player.paused]") == [held, False]
    page.mouse.move(box["x"] + box["width"] / 4, middle + 200)
    until(page, f"player.mesh.frame < {held}")
    sought = page.evaluate("player.mesh.frame")
    page.wait_for_timeout(200)
    assert page.evaluate("player.mesh.frame") == sought
    page.mouse.up()
    until(page, f"player.mesh.frame > {sought} + 2")
    assert page.evaluate("told") == []


COLORS = """() => {
  const colorsOf = (part) => {
    const { color, backgroundColor } = getComputedStyle(part);
    return [color, backgroundColor].map((one) => one.match(/[\\d.]+/g).map(Number));
  };
  return [player, player.shadowRoot.querySelector(".bar")].map(colorsOf);
}"""
"""Text and background of the player and of its bar, as numbers."""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_colors_follow_the_color_scheme_of_the_system(shown, scheme):
    page = shown("")
    page.emulate_media(color_scheme=scheme)
    page.evaluate(
        "document.querySelector('main').innerHTML ="
        "  '<reel-player src=\"/flag.reel\" controls></reel-player>';"
        "player = document.querySelector('reel-player')"
    )
    settled(page)
    (_, ground), (ink, panel) = page.evaluate(COLORS)
    is_dark = scheme == "dark"
    assert (sum(ground) < 200) == (sum(panel) < 200) == (sum(ink) > 600) == is_dark
    assert "color-contrast" in checked_rules(page, "player")


def test_colors_of_the_page_take_precedence(shown):
    page = shown('<reel-player src="/flag.reel" controls></reel-player>')
    page.emulate_media(color_scheme="dark")
    settled(page)
    for name, value in {"background": "rgb(1 2 3)", "bar-background": "#040506"}.items():
        page.evaluate(f"player.style.setProperty('--reel-{name}', '{value}')")
    page.evaluate("player.style.setProperty('--reel-color', '#fafbfc')")
    (_, ground), (ink, panel) = page.evaluate(COLORS)
    assert [ground, ink, panel] == [[1, 2, 3], [250, 251, 252], [4, 5, 6]]
    page.evaluate("player.background = 'rgb(255 0 0)'")
    until(page, "player.background")
    page.wait_for_timeout(200)
    assert tuple(picture(page)[4, 4]) == (255, 0, 0)


def test_policy_that_forbids_webassembly_is_named(new_page, files):
    policy = {"Content-Security-Policy": "default-src 'self'; worker-src blob:; img-src data:"}
    with showing(new_page, files, policy) as show:
        page = show('<reel-player src="/flag.reel"></reel-player>')
        until(page, "player.error")
        assert page.evaluate("player.error.name") == "CompileError"
        assert "add 'wasm-unsafe-eval' to its script-src" in text_of(page, "[role=alert]")


def test_metals_have_something_to_reflect(shown):
    page = shown('<reel-player src="/gold.reel"></reel-player>')
    settled(page)
    page.wait_for_timeout(300)
    seen = picture(page)
    on_gold = seen[(np.abs(seen - 255) > 12).any(axis=2)]
    assert on_gold.mean() > 90  # 30 without an environment: black except for a highlight
    red, _, blue = on_gold.T
    assert (red - blue).mean() > 20


def test_models_have_a_soft_shadow_on_the_floor(shown):
    page = shown(
        '<reel-player src="/flag.reel" up="z" camera-orbit="0deg 70deg auto"></reel-player>'
    )
    settled(page)
    page.evaluate("player.mesh.material.color.set(0x2040ff); player.resetCamera()")
    page.wait_for_timeout(300)
    seen = picture(page)
    shadow = seen[(np.ptp(seen, axis=2) < 3) & (seen[..., 0] < 250)]  # the flag is blue
    assert 0.01 < len(shadow) / seen[..., 0].size < 0.3
    assert 60 < shadow.min() < 235
    levels = np.unique(shadow)
    assert len(levels) > (levels[-1] - levels[0]) / 2  # fades out


GUIDE = Path(__file__).parents[2] / "docs" / "guides" / "web.md"


def test_size_is_reserved_before_the_script_arrives(new_page):
    [rule] = re.findall(r"^reel-player:not\(:defined\) .*$", GUIDE.read_text("utf-8"), re.M)
    page = f"""<!doctype html><style>{rule}</style>
      <reel-player></reel-player><script type="module" src="/later/player.js"></script>"""
    player = (DIST / "player.js").read_bytes()
    with serving({"/page.html": page.encode(), "/player.js": player}) as (url, _):
        opened = new_page(f"{url}/page.html", is_shown=False)
        size = "(({ width, height }) => [width, height])"
        size += "(document.querySelector('reel-player').getBoundingClientRect())"
        before = opened.evaluate(size)
        opened.evaluate("import('/player.js')")
        until(opened, "customElements.get('reel-player')")
        assert opened.evaluate(size) == before
        assert before[1] == pytest.approx(before[0] * 9 / 16)
        opened.close()  # while the server is running


ALL = "[...document.querySelectorAll('reel-player')]"


def test_many_players_keep_snapshots_and_release_contexts_off_screen(shown):
    page = shown("")
    warnings = []
    page.on("console", lambda message: warnings.append(message.text))
    page.evaluate(
        """() => {
          const all = Array(20).fill('<reel-player src="/flag.reel"></reel-player>');
          document.querySelector("main").innerHTML = all.join("");
          for (const one of document.querySelectorAll("reel-player")) {
            Object.assign(one.style, { width: "300px", height: "240px" });
          }
          player = document.querySelector("reel-player");
        }"""
    )
    for number in [*range(0, 20, 2), 19, 0]:
        page.evaluate(f"{ALL}[{number}].scrollIntoView()")
        ready = "mesh && !mesh.isWaiting && mesh.geometry.drawRange.count > 0"
        until(page, f"(({{ mesh }}) => {ready})({ALL}[{number}])")
    until(page, "!player.shadowRoot.querySelector('.snapshot')")
    page.wait_for_timeout(300)
    assert (np.abs(picture(page) - 255).max(axis=2) > 12).mean() > 0.05
    snapshots = f"{ALL}.filter((one) => one.shadowRoot.querySelector('.snapshot'))"
    assert page.evaluate(f"{snapshots}.length") >= 5
    assert page.evaluate(f"{ALL}.every(({{ error }}) => error === null)")
    assert not [warning for warning in warnings if "Too many active WebGL contexts" in warning]


def test_players_of_one_address_request_its_bytes_once(files, new_page):
    tags = 18 * '<reel-player src="/large.reel" style="width: 90px"></reel-player>'
    with serving({**files, "/page.html": PAGE.format(body=tags).encode()}) as (url, requested):
        page = new_page(f"{url}/page.html", is_shown=False)
        until(page, f"{ALL}.every(({{ reel }}) => reel)")
        for frame in (0, 40, 20, 59, 20):
            page.evaluate(f"Promise.all({ALL}.map(({{ reel }}) => reel.frame({frame})))")
        page.close()  # while the server is running
    ranges = sorted(requested)
    assert len(ranges) > 3
    assert all(last < first for (_, last), (first, _) in pairwise(ranges)), ranges
