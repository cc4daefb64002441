"""The element <reel-player> in a real browser."""

from itertools import pairwise

import numpy as np
import pytest

import meshreel
from meshreel.kernel.mp4 import reel_box
from samples.browser import checked_rules
from samples.element_pages import drawn_fraction, picture, press, settled, showing, text_of, until
from samples.numbered_video import moving_sheet, numbered_video
from samples.webgl import COUNTING

pytestmark = pytest.mark.slow

GATE = """
window.gate = new Promise((resolve) => (window.release = resolve));
const given = window.fetch;
window.fetch = async (address, ...more) => {
  if ((address.url ?? address).includes("slow")) await window.gate;
  return given(address, ...more);
};
"""
"""Delays files named "slow" until `release` is called."""

DRAWING = """
window.drawn = 0;
for (const name of ["drawElements", "drawArrays"]) {
  const given = WebGL2RenderingContext.prototype[name];
  WebGL2RenderingContext.prototype[name] = function (...values) {
    window.drawn++;
    return given.apply(this, values);
  };
}
"""

HOLDING = """
window.contexts = [];
const given = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
  const made = given.call(this, kind, ...more);
  if (kind === "webgl2" && made && !contexts.includes(made)) contexts.push(made);
  return made;
};
window.workers = 0;
const Given = window.Worker;
window.Worker = class extends Given {
  constructor(...given) { super(...given); window.workers++; }
  terminate() { super.terminate(); window.workers--; }
};
"""


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    flag = meshreel.simulate_flag(45, n_rows=20, n_columns=30)
    data = meshreel.encode(flag, max_error=0.02, effort=5, block_frames=15)
    damaged = bytearray(data)
    damaged[len(data) // 2] ^= 1
    sheet = meshreel.encode(moving_sheet(), max_error=0.01, effort=5, block_frames=15)
    film = numbered_video(tmp_path_factory.mktemp("film") / "walk.webm")
    return {
        "/page.css": b"body { margin: 0; font: 16px sans-serif; background: #fff }",
        "/flag.reel": data,
        "/slow.reel": data,
        "/damaged.reel": bytes(damaged),
        "/sheet.reel": sheet,
        "/walk.webm": film,
        "/sheet.mp4": numbered_video(tmp_path_factory.mktemp("film") / "a.mp4") + reel_box(sheet),
        "/stress.reel": meshreel.encode(stressed_flag(), max_error=0.02, effort=5),
        "/walk.reel": meshreel.encode(walking_post(), max_error=0.02, effort=5),
        "/run.reel": meshreel.encode(walking_post(heights=6), max_error=0.02, effort=5),
        "/stray.reel": meshreel.encode(with_stray_vertex(walking_post()), step=1e-6),
    }


def stressed_flag():
    """Return a flag with stress, exact part numbers, and colors."""
    flag = meshreel.simulate_flag(20, n_rows=20, n_columns=30)
    x = flag.vertices[..., 0]
    tracks = {
        "stress": meshreel.Track((400 * np.sin(3 * x)).astype(np.float32), unit="Pa"),
        "part": meshreel.Track((5 * x).astype(np.int16)),
        "paint": meshreel.Track(np.stack([0 * x + 1, 0 * x, 0 * x], -1), kind="color"),
    }
    return meshreel.MeshSequence(flag.vertices, flag.faces, fps=24, tracks=tracks)


def walking_post(heights=0.5):
    """Return a thin post far from the origin, which moves sideways by some of its heights."""
    post = meshreel.simulate_flag(45, n_rows=20, n_columns=30)
    vertices = np.array(post.vertices) * [0.3, 3, 1] + [700, 0, -300]
    vertices[..., 0] += np.linspace(0, heights * np.ptp(vertices[..., 1]), 45)[:, None]
    return meshreel.MeshSequence(vertices, post.faces, fps=post.fps)


def with_stray_vertex(sequence):
    """Return a sequence with a vertex without faces far from the others."""
    far = sequence.vertices[:, :1] + 50
    return meshreel.MeshSequence(np.hstack([sequence.vertices, far]), sequence.faces, sequence.fps)


@pytest.fixture
def shown(new_page, files):
    """Return a function that opens a page with a body; `player` is its first player."""
    with showing(new_page, files) as show:
        yield show


def test_one_script_and_one_element_play_a_file_under_a_strict_policy(shown):
    page = shown('<reel-player src="/flag.reel" autoplay></reel-player>')
    until(page, "player.mesh && player.mesh.frame > 3")
    assert page.evaluate("[player.paused, player.mesh.isOnGpu]") == [False, True]
    assert 0.05 < drawn_fraction(page) < 0.9
    width, height = page.evaluate("[player.clientWidth, player.clientHeight]")
    assert height == width * 9 // 16
    until(page, "player.paused && player.currentTime === player.duration")


def test_events_report_the_playback_state(shown):
    page = shown('<reel-player speed="2"></reel-player>')
    page.evaluate(
        """() => {
          window.told = [];
          for (const type of ["load", "play", "pause", "timeupdate", "playing", "ended", "error"]) {
            player.addEventListener(type, () => {
              if (told.at(-1) !== type) told.push(type);
            });
          }
          player.src = "/flag.reel";
          player.addEventListener("load", () => player.play());
        }"""
    )
    until(page, "told.includes('ended')")
    told = page.evaluate("told")
    assert told[:2] == ["load", "play"]
    assert told.index("play") < told.index("timeupdate") < told.index("ended")
    assert "pause" in told
    assert "error" not in told


def test_methods_and_properties_control_the_player(shown):
    page = shown('<reel-player src="/flag.reel" start-frame="12"></reel-player>')
    settled(page)
    assert page.evaluate("player.mesh.frame") == 12
    result = page.evaluate(
        """() => {
          player.seek({ frame: 20 });
          const frame = player.mesh.frame;
          player.currentTime = 0.5;
          const { currentTime, duration, reel, paused } = player;
          Object.assign(player, { loop: true, speed: 0.5 });
          Object.assign(player, { cameraControls: true, interpolate: false });
          const names = player.getAttributeNames().sort();
          return { frame, currentTime, duration, paused, n: reel.info.nFrames, names };
        }"""
    )
    assert result["frame"] == 20
    assert result["currentTime"] == pytest.approx(0.5)
    assert result["duration"] == pytest.approx(45 / 30)
    assert (result["paused"], result["n"]) == (True, 45)
    names = ["camera-controls", "interpolate", "loop", "speed", "src", "start-frame"]
    assert result["names"] == names
    until(page, "player.mesh.loop === true && player.mesh.speed === 0.5")
    assert page.evaluate("[player.mesh.interpolate, player.loop]") == [False, True]


def test_properties_set_before_the_definition_are_applied(shown):
    page = shown("")
    page.evaluate(
        """() => {
          const name = document.createElement("reel-player");
          Object.defineProperty(name, "src", { value: "/flag.reel", configurable: true });
          window.player = name;
          document.querySelector("main").append(name);
        }"""
    )
    settled(page)
    assert page.evaluate("player.getAttribute('src')") == "/flag.reel"


STATES = {
    "playing": '<reel-player src="/flag.reel" autoplay loop controls camera-controls alt="A flag">',
    "bare": '<reel-player src="/flag.reel">',
    "missing": '<reel-player src="/missing.reel" controls>',
    "refused": '<reel-player src="/flag.reel" loop="no" controls>',
    "damaged": '<reel-player src="/damaged.reel" controls autoplay loop background="#123">',
    "waiting": '<reel-player src="/slow.reel" controls>',
    "textured": '<reel-player src="/sheet.reel" controls texture="/walk.webm">',
    "track": '<reel-player src="/stress.reel" track="stress" controls>',
}


@pytest.mark.parametrize("state", STATES)
def test_axe_finds_no_violations(shown, state):
    page = shown(f"{STATES[state]}</reel-player>", script=GATE)
    if state in ("missing", "refused"):
        until(page, "player.error")
    elif state == "damaged":
        until(page, "player.error && player.mesh")
    elif state == "waiting":
        page.wait_for_timeout(500)
    else:
        settled(page)
    rules = checked_rules(page)
    assert {"role-img-alt", "button-name"} & rules
    if state == "playing":
        assert {"label", "color-contrast"} <= rules


def test_keys_play_seek_and_turn(shown):
    page = shown(
        '<reel-player src="/flag.reel" controls camera-controls background="white"></reel-player>'
    )
    settled(page)
    frame = "player.mesh.frame"
    press(page, "input", "End")
    until(page, f"{frame} === 44")
    press(page, "input", "Home", "ArrowRight", "ArrowRight")
    until(page, f"{frame} === 2")
    words = page.evaluate("player.shadowRoot.querySelector('input').ariaValueText")
    name = page.evaluate("player.shadowRoot.querySelector('input').getAttribute('aria-valuetext')")
    assert words == name == "0.1 of 1.5 seconds, frame 2"
    press(page, "canvas", "End")
    until(page, f"{frame} === 44")
    press(page, "canvas", "Home", ".", ".", ".", ",")
    until(page, f"{frame} === 2")
    press(page, "canvas", "Space")
    until(page, "!player.paused")
    press(page, "canvas", "Space")
    until(page, "player.paused")
    press(page, "canvas", "Home")
    page.wait_for_timeout(300)
    before = picture(page)
    radius = "player.getCameraOrbit().radius"
    framed = page.evaluate(radius)
    press(page, "canvas", "ArrowLeft", "ArrowLeft", "+")
    assert page.evaluate(radius) < 0.9 * framed  # plus zooms in
    page.wait_for_timeout(300)
    turned = picture(page)
    press(page, "canvas", "0")
    page.wait_for_timeout(300)
    assert page.evaluate(frame) == 0
    assert np.abs(turned - before).max(axis=2).mean() > 1
    assert np.abs(picture(page) - before).max(axis=2).mean() < 0.1


def test_arrow_keys_step_frames_unless_they_move_the_camera(shown):
    page = shown('<reel-player src="/flag.reel"></reel-player>')
    settled(page)
    press(page, "canvas", "ArrowRight", "ArrowRight", "ArrowRight", "ArrowLeft")
    until(page, "player.mesh.frame === 2")


def test_every_control_is_focusable_with_a_visible_focus(shown):
    page = shown('<reel-player src="/sheet.reel" controls texture="/walk.webm"></reel-player>')
    settled(page)
    until(page, "player.mesh.video")
    page.wait_for_timeout(200)
    reached = []
    for _ in range(9):
        page.keyboard.press("Tab")
        reached.append(
            page.evaluate(
                """() => {
                  const part = player.shadowRoot.activeElement;
                  if (!part) return null;
                  const { outlineStyle, boxShadow } = getComputedStyle(part);
                  const isMarked = outlineStyle !== "none" || boxShadow !== "none";
                  return [part.getAttribute("aria-label"), isMarked];
                }"""
            )
        )
    names = ["Animated 3D model", "Previous frame", "Play", "Next frame", "Time", "Speed", "Mute"]
    names.append("Full screen")
    assert [one for one in reached if one] == [[name, True] for name in names]


EVENTS = """(types) => {
  window.told = [];
  for (const type of types) player.addEventListener(type, () => told.push(type));
}"""


def test_play_waits_for_the_file(shown):
    page = shown('<reel-player src="/slow.reel" loop></reel-player>', script=GATE)
    page.evaluate(
        """() => {
          window.state = "pending";
          player.play().then(() => (state = "playing"), ({ name }) => (state = name));
        }"""
    )
    page.wait_for_timeout(200)
    assert page.evaluate("[state, player.paused, player.mesh]") == ["pending", False, None]
    page.evaluate("release()")
    until(page, "state === 'playing'")
    assert page.evaluate("!player.mesh.isWaiting && player.mesh.isPlaying")
    assert page.evaluate("player.play().then(() => 'playing')") == "playing"


@pytest.mark.parametrize(
    ("action", "name"),
    [
        ("player.pause()", "AbortError"),
        ("player.src = '/flag.reel'", "AbortError"),
        ("player.remove()", "AbortError"),
        ("release()", "SourceError"),
    ],
)
def test_play_is_rejected_when_it_cannot_start(shown, action, name):
    page = shown('<reel-player src="/slow-missing.reel"></reel-player>', script=GATE)
    page.evaluate("player.play().catch(({ name }) => (window.rejected = name)); 0")
    page.wait_for_timeout(100)
    page.evaluate(f"{action}; 0")
    until(page, f"window.rejected === '{name}'")
    assert page.evaluate("player.paused")


def test_a_new_source_plays_when_play_follows_at_once(shown):
    page = shown('<reel-player src="/flag.reel"></reel-player>')
    settled(page)
    page.evaluate("player.src = '/sheet.reel'; window.playing = player.play(); 0")
    page.evaluate("playing")
    assert page.evaluate("[player.file.info.nFrames, player.paused]") == [90, False]


def test_bytes_are_played_in_place_of_an_address(shown):
    page = shown('<reel-player src="/sheet.reel"></reel-player>')
    settled(page)
    page.evaluate("fetch('/flag.reel').then(async (one) => (player.srcObject = await one.blob()))")
    until(page, "player.file && player.file.info.nFrames === 45")
    page.evaluate("player.srcObject = null")
    until(page, "player.file && player.file.info.nFrames === 90")


def test_seeks_and_rates_are_reported_like_those_of_a_video(shown):
    page = shown('<reel-player src="/flag.reel" loop></reel-player>')
    settled(page)
    page.evaluate(EVENTS, ["seeking", "seeked", "ratechange"])
    page.evaluate("player.currentTime = 0.2")
    until(page, "told.length === 2")
    page.evaluate("player.seek({ frame: 44 })")  # in another block, unless it was loaded
    until(page, "told.length === 4 && !player.seeking")
    assert page.evaluate("told") == ["seeking", "seeked"] * 2
    page.evaluate("player.playbackRate = 2")
    until(page, "told.at(-1) === 'ratechange'")
    result = page.evaluate("[player.playbackRate, player.speed, player.mesh.speed]")
    assert result == [2, 2, 2]
    assert "finite" in page.evaluate("(() => { try { player.playbackRate = NaN } catch (error) "
                                     "{ return error.message } })()")  # fmt: skip


def test_the_end_is_reported_until_playback_continues(shown):
    page = shown('<reel-player src="/flag.reel" speed="4" autoplay></reel-player>')
    until(page, "player.ended && player.paused")
    page.evaluate("player.currentTime = 0")
    assert page.evaluate("player.ended") is False


def test_a_lazy_player_opens_its_file_near_the_viewport(shown):
    body = '<div class="far"></div><reel-player src="/flag.reel" loading="lazy"></reel-player>'
    page = shown("")
    page.evaluate(
        """(body) => {
          const main = document.querySelector("main");
          main.innerHTML = body;
          main.firstChild.style.height = "5000px";
          window.player = document.querySelector("reel-player");
        }""",
        body,
    )
    page.wait_for_timeout(400)
    assert page.evaluate("player.mesh") is None
    page.evaluate("scrollTo(0, 4300)")  # the player is below the viewport, but near
    until(page, "player.mesh?.isWaiting")
    page.evaluate("player.scrollIntoView()")
    settled(page)


def test_the_bar_steps_frames_and_sets_the_speed(shown):
    page = shown('<reel-player src="/flag.reel" controls loop autoplay></reel-player>')
    until(page, "player.mesh && player.mesh.frame > 2")
    player = page.locator("reel-player")
    player.get_by_label("Next frame").click()
    frame = page.evaluate("player.mesh.frame")
    assert page.evaluate("player.paused")
    player.get_by_label("Previous frame").click()
    assert page.evaluate("player.mesh.frame") == frame - 1
    page.evaluate("player.seek({ frame: 0 })")
    player.get_by_label("Previous frame").click()
    assert page.evaluate("player.mesh.frame") == 44
    player.get_by_label("Speed").select_option("0.5")
    assert page.evaluate("player.playbackRate") == 0.5
    page.evaluate("player.playbackRate = 3")
    until(page, "player.shadowRoot.querySelector('select').value === '3'")
    page.evaluate("player.style.width = '400px'")
    page.wait_for_timeout(200)
    assert player.get_by_label("Next frame").is_hidden()
    assert player.get_by_label("Time").bounding_box()["width"] > 100


ORBIT = "Object.values(player.getCameraOrbit())"


def test_the_camera_starts_where_its_attributes_say(shown):
    page = shown(
        '<reel-player src="/walk.reel" camera-orbit="90deg 60deg 20m" field-of-view="40deg"'
        ' camera-target="701 auto auto" camera-controls></reel-player>'
    )
    settled(page)
    assert page.evaluate(ORBIT) == pytest.approx([np.pi / 2, np.pi / 3, 20], rel=1e-4)
    target = page.evaluate("[player.getCameraTarget(), player.getFieldOfView()]")
    center = page.evaluate("player.file.info.center")
    assert list(target[0].values()) == pytest.approx([701, *center[1:]], rel=1e-6)
    assert target[1] == pytest.approx(40)
    page.evaluate(EVENTS, ["camera-change"])
    press(page, "canvas", "ArrowLeft")
    until(page, "told.length")
    assert page.evaluate(ORBIT)[0] != pytest.approx(np.pi / 2, abs=0.01)
    page.evaluate("player.cameraOrbit = 'auto auto 200%'")
    until(page, f"Math.abs({ORBIT}[0]) < 1e-6")
    far = page.evaluate(ORBIT)[2]
    page.evaluate("player.cameraOrbit = null")
    until(page, f"{ORBIT}[2] < 0.51 * {far}")


def test_the_camera_rotates_unless_motion_is_reduced(shown):
    page = shown('<reel-player src="/flag.reel" auto-rotate></reel-player>')
    settled(page)
    until(page, f"{ORBIT}[0] > 0.1")
    page.emulate_media(reduced_motion="reduce")
    page.wait_for_timeout(200)
    before = page.evaluate(ORBIT)
    page.wait_for_timeout(300)
    assert page.evaluate(ORBIT) == before


def test_reduced_motion_disables_autoplay(shown):
    page = shown("")
    page.emulate_media(reduced_motion="reduce")
    page.evaluate(
        """() => {
          window.player = document.createElement("reel-player");
          Object.assign(player, { src: "/flag.reel", autoplay: true });
          document.querySelector("main").append(player);
        }"""
    )
    settled(page)
    assert page.evaluate("[player.paused, player.currentTime]") == [True, 0]
    page.locator("reel-player button.start").click()
    until(page, "!player.paused && player.mesh.frame > 2")
    assert page.locator("reel-player button.start").is_hidden()


def test_waiting_for_data_is_visible(shown):
    page = shown('<reel-player src="/slow.reel" autoplay></reel-player>', script=GATE)
    page.wait_for_timeout(400)
    assert text_of(page, ".waiting") == "Loading…"
    assert page.locator("reel-player .waiting").is_visible()
    page.evaluate("release()")
    until(page, "player.mesh && player.mesh.frame > 1")
    # A frame later it may wait again, for the next block.
    until(page, "!player.shadowRoot.querySelector('.waiting').textContent")


ERRORS = {
    'src="/missing.reel"': ("SourceError", "HTTP 404"),
    'src="/page.css"': ("CorruptStreamError", ""),
    'src="/flag.reel" speed="fast"': ("InvalidInputError", 'got speed="fast"'),
    'src="/flag.reel" background="no color"': ("InvalidInputError", "must be a CSS color"),
    'src="/flag.reel" texture="/walk.webm"': ("InvalidInputError", "no UVs"),
    'src="/stress.reel" track="strain"': (
        "InvalidInputError",
        'available: "stress", "part", "paint"',
    ),
    'src="/sheet.reel" texture="/missing.png"': ("SourceError", "cannot load the image"),
    'src="/sheet.reel" texture="/missing.webm"': ("SourceError", "cannot play the video"),
    'src="/sheet.reel" texture="/walk.webm" loop="pingpong"': ("InvalidInputError", "forwards"),
}


@pytest.mark.parametrize("attributes", ERRORS)
def test_errors_are_shown_and_reported(shown, attributes):
    name, words = ERRORS[attributes]
    page = shown("")
    page.evaluate(
        """(attributes) => {
          document.querySelector("main").innerHTML = `<reel-player ${attributes}></reel-player>`;
          window.player = document.querySelector("reel-player");
          player.addEventListener("error", ({ error }) => (window.told = error));
        }""",
        attributes,
    )
    until(page, "player.error")
    assert page.evaluate("player.error.name") == name
    assert words in text_of(page, "[role=alert]")
    assert page.locator("reel-player [role=alert]").is_visible()
    assert page.evaluate("window.told === player.error")


def test_a_corrected_attribute_clears_the_error(shown):
    page = shown('<reel-player src="/flag.reel" loop="no"></reel-player>')
    until(page, "player.error")
    page.evaluate("player.loop = true")
    settled(page)
    assert page.evaluate("[player.error, player.mesh.loop]") == [None, True]
    assert text_of(page, "[role=alert]") == ""
    page.evaluate("player.src = '/missing.reel'")
    until(page, "player.error && player.mesh === null")
    page.evaluate("player.src = '/flag.reel'")
    settled(page)
    assert text_of(page, "[role=alert]") == ""


def test_playback_skips_a_damaged_block(shown):
    page = shown('<reel-player src="/damaged.reel" autoplay loop></reel-player>')
    page.evaluate("player.addEventListener('timeupdate', () => (window.seen ??= new Set())"
                  ".add(player.mesh.frame))")  # fmt: skip
    until(page, "window.seen && [...seen].some((frame) => frame >= 30) && player.error")
    assert page.evaluate("player.error.name") == "CorruptStreamError"
    assert text_of(page, "[role=alert] p").startswith("Frames 15 to 29 are missing: ")
    assert not {*range(15, 30)} & {*page.evaluate("[...seen]")}
    page.locator("reel-player [role=alert] button").click()
    assert text_of(page, "[role=alert]") == ""


def test_only_the_last_source_is_loaded(shown):
    page = shown('<reel-player src="/slow.reel"></reel-player>', script=GATE + COUNTING)
    page.evaluate(
        "window.loads = 0; player.addEventListener('load', () => loads++);"
        "player.src = '/sheet.reel'"
    )
    settled(page)
    page.evaluate("release()")
    page.wait_for_timeout(300)
    assert page.evaluate("[loads, player.reel.info.name]") == [1, "sheet"]
    counts = []
    for name in ["flag", "sheet"] * 4:
        page.evaluate(f"player.src = '/{name}.reel'")
        until(page, f"player.reel && player.reel.info.nFrames === {45 if name == 'flag' else 90}")
        settled(page)
        counts.append(page.evaluate("({ ...alive })"))
    assert counts[2:4] == counts[4:6] == counts[6:8]
    page.evaluate("player.removeAttribute('src')")
    until(page, "player.mesh === null")
    assert page.evaluate("player.paused")


LEGEND = "player.shadowRoot.querySelector('.legend')"


def test_a_track_colors_the_mesh_with_a_legend(shown):
    page = shown(
        '<reel-player src="/stress.reel" track="stress" track-range="-400:400"></reel-player>'
    )
    settled(page)
    until(page, f"!{LEGEND}.hidden")
    label = f"{LEGEND}.getAttribute('aria-label')"
    assert page.evaluate(label) == "Colors: stress from -400 Pa to 400 Pa"
    colors = picture(page)
    red, blue = colors[..., 0] - colors[..., 2], colors[..., 2] - colors[..., 0]
    assert (red > 60).mean() > 0.02
    assert (blue > 60).mean() > 0.02
    page.evaluate("Object.assign(player, { track: 'part', trackRange: '0%:100%' })")
    until(page, f"{label}.includes('part')")
    assert page.evaluate(label).startswith("Colors: part from 0 to ")
    page.evaluate("Object.assign(player, { track: 'paint', trackComponent: 'x' })")
    until(page, f"{label}.startsWith('Colors: paint, x from ')")
    page.evaluate("Object.assign(player, { trackComponent: null, trackRange: null })")
    until(page, f"{label} === 'Colors: paint'")
    page.wait_for_timeout(300)
    colors = picture(page)
    assert ((colors[..., 0] > 100) & (colors[..., 1:].max(axis=2) < 60)).mean() > 0.1
    page.evaluate("player.track = null")
    until(page, f"{LEGEND}.hidden")
    assert page.evaluate("player.error") is None


CONTROL_NAMES = ("Play", "Time", "Unmute", "Full screen")
CONTROLS = """[...player.shadowRoot.querySelectorAll(".bar > *")].filter((one) => one.offsetWidth)
    .map((one) => [one, one.getBoundingClientRect(), player.getBoundingClientRect()])"""


@pytest.mark.parametrize(("width", "n_controls"), [(200, 4), (120, 3), (320, 4)])
def test_every_control_of_a_small_player_works(shown, width, n_controls):
    attributes = 'src="/sheet.reel" texture="/walk.webm" muted controls'
    page = shown(f"<reel-player {attributes}></reel-player>")
    size = f"{{ width: '{width}px', height: '180px', aspectRatio: 'auto' }}"
    page.evaluate(f"Object.assign(player.style, {size})")
    settled(page)
    until(page, "player.mesh.video")
    is_inside = "box.left >= all.left && box.right <= all.right && box.bottom <= all.bottom"
    assert page.evaluate(f"{CONTROLS}.every(([, box, all]) => {is_inside})")
    bar = page.locator(".bar")
    controls = [one for one in CONTROL_NAMES if bar.get_by_label(one, exact=True).is_visible()]
    assert len(controls) == n_controls
    bar.get_by_label("Play", exact=True).click()
    until(page, "!player.paused")
    bar.get_by_label("Unmute", exact=True).click()
    assert page.evaluate("!player.muted")
    if "Time" in controls:
        page.evaluate("player.pause()")
        bar.get_by_label("Time", exact=True).click()
        until(page, "Math.abs(player.mesh.frame / player.mesh.nFrames - 0.5) < 0.25")
    bar.get_by_label("Full screen", exact=True).click()
    until(page, "document.fullscreenElement === player")


@pytest.mark.parametrize("width", [200, 390])
def test_legend_of_a_small_player_covers_nothing_and_has_one_line(shown, width):
    attributes = 'src="/stress.reel" track="stress" track-range="-0.00123:400" controls'
    page = shown(f"<reel-player {attributes}></reel-player>")
    page.evaluate(f"player.style.width = '{width}px'")
    settled(page)
    until(page, f"!{LEGEND}.hidden")
    part = "player.shadowRoot.querySelector('{}').getBoundingClientRect().toJSON()".format
    legend, canvas, bar = (page.evaluate(part(name)) for name in (".legend", "canvas", ".bar"))
    assert canvas["bottom"] <= legend["top"] <= legend["bottom"] <= bar["top"]
    assert legend["height"] < 32
    assert canvas["height"] > 32
    first, last = (f".values :nth-child({i})" for i in (1, 2))
    assert text_of(page, last) == "400 Pa"
    places = [page.evaluate(part(name)) for name in (first, ".colors", last)]
    assert all(left["right"] < right["left"] for left, right in pairwise(places))
    assert places[-1]["right"] <= legend["right"] - 8


def test_removed_players_release_everything(shown):
    page = shown("", script=HOLDING, width=480, height=320)
    warnings = []
    page.on("console", lambda message: warnings.append(message.text))
    n_players = 17  # Chromium loses the first of 17 contexts
    for _ in range(n_players):
        page.evaluate(
            """() => {
              window.player = document.createElement("reel-player");
              Object.assign(player, { src: "/sheet.reel", controls: true, texture: "/walk.webm" });
              document.querySelector("main").append(player);
            }"""
        )
        until(page, "player.mesh && player.mesh.geometry.drawRange.count > 0 && player.mesh.video")
        page.evaluate("player.remove()")
        until(page, "player.mesh === null")
    result = page.evaluate(
        "[contexts.length, contexts.every((one) => one.isContextLost()), workers]"
    )
    assert result == [n_players, True, 0]
    assert page.evaluate("player.shadowRoot.querySelector('canvas')") is None
    assert not [warning for warning in warnings if "Too many active WebGL contexts" in warning]
    page.evaluate("document.querySelector('main').append(player)")
    settled(page)


def test_player_moved_in_the_page_continues(shown):
    page = shown('<reel-player src="/flag.reel" autoplay loop></reel-player><section></section>')
    settled(page)
    page.evaluate("window.before = player.mesh; document.querySelector('section').append(player)")
    page.wait_for_timeout(300)
    assert page.evaluate("player.mesh === before && !player.paused")


def test_nothing_is_drawn_without_changes_or_off_screen(shown):
    body = '<reel-player src="/flag.reel" loop></reel-player><div class="far"></div>'
    page = shown(body, script=DRAWING)
    page.evaluate("document.querySelector('.far').style.height = '4000px'")
    settled(page)
    before = page.evaluate("drawn")
    page.wait_for_timeout(400)
    assert page.evaluate("drawn") == before > 0
    page.evaluate("player.play()")
    until(page, f"drawn > {before} + 5")
    page.evaluate("scrollTo(0, 3000)")
    until(page, "!player.mesh.isPlaying")
    page.wait_for_timeout(300)  # for a picture that was requested before
    drawn, time = page.evaluate("[drawn, player.currentTime]")
    page.wait_for_timeout(400)
    assert page.evaluate("[drawn, player.currentTime]") == [drawn, time]
    assert page.evaluate("[player.paused, player.mesh.isPlaying]") == [False, False]
    page.evaluate("scrollTo(0, 0)")
    until(page, f"drawn > {drawn} && player.mesh.isPlaying")


@pytest.mark.parametrize("is_chosen", [False, True])
def test_wheel_scrolls_the_page_until_the_picture_has_focus(shown, is_chosen):
    body = '<reel-player src="/flag.reel" camera-controls></reel-player><div class="far"></div>'
    page = shown(body)
    page.evaluate("document.querySelector('.far').style.height = '4000px'")
    settled(page)
    before = drawn_fraction(page)  # focus scrolls the whole player into view
    top = page.evaluate("scrollY")
    page.mouse.move(320, 200)
    if is_chosen:
        page.mouse.click(320, 200)
    page.mouse.wheel(0, 300)
    page.wait_for_timeout(500)
    assert (page.evaluate("scrollY") == top) == is_chosen
    assert (drawn_fraction(page) < 0.9 * before) == is_chosen


def test_the_canvas_has_the_pixels_of_the_screen_and_no_more_than_twice(shown):
    page = shown('<reel-player src="/flag.reel"></reel-player>')
    settled(page)
    page.evaluate("player.style.width = '400px'")
    until(page, "player.shadowRoot.querySelector('canvas').width === 400")
    page.evaluate("Object.defineProperty(window, 'devicePixelRatio', { value: 3 })")
    page.evaluate("player.style.width = '500px'")
    until(page, "player.shadowRoot.querySelector('canvas').width === 1000")
    assert page.evaluate("player.shadowRoot.querySelector('canvas').height") == 562


@pytest.mark.parametrize("size", [(1280, 720), (390, 844)])
@pytest.mark.parametrize(
    ("file", "up", "least"),
    [("walk", "y", 0.7), ("walk", "z", 0.5), ("stray", "y", 0.7)],  # z: the post points at us
)
def test_whole_motion_is_visible_and_fills_the_picture(shown, size, file, up, least):
    page = shown(f'<reel-player src="/{file}.reel" up="{up}"></reel-player>')
    page.set_viewport_size(dict(zip(("width", "height"), size, strict=True)))
    page.evaluate("Object.assign(player.style, { display: 'block', height: '60vh' })")
    settled(page)
    seen = np.zeros(picture(page).shape[:2], bool)
    for frame in range(0, 45, 11):
        page.evaluate(f"player.mesh.seek({{ frame: {frame} }})")
        settled(page)
        seen |= (np.abs(picture(page) - 255) > 12).any(axis=2)
    assert not seen[[0, -1]].any()
    assert not seen[:, [0, -1]].any()
    rows, columns = (np.flatnonzero(seen.any(axis=axis)) for axis in (1, 0))
    assert max(np.ptp(rows) / len(seen), np.ptp(columns) / len(seen[0])) > least


@pytest.mark.parametrize("attributes", ["", "auto-rotate"])
def test_the_camera_follows_a_model_that_moves_far(shown, attributes):
    page = shown(f'<reel-player src="/run.reel" {attributes}></reel-player>')
    page.emulate_media(reduced_motion="reduce")
    settled(page)
    targets = []
    for frame in (0, 20, 44):
        page.evaluate(f"player.mesh.seek({{ frame: {frame} }})")
        settled(page)
        drawn = (np.abs(picture(page) - 255) > 12).any(axis=2)
        rows, columns = (np.flatnonzero(drawn.any(axis=axis)) for axis in (1, 0))
        assert 0.6 * len(drawn) < np.ptp(rows) < len(drawn) - 2
        assert abs(columns.mean() / len(drawn[0]) - 0.5) < 0.1
        targets.append(page.evaluate("player.getCameraTarget().x"))
    height = page.evaluate("player.file.info.diagonal") / 6
    assert targets[2] - targets[1] > height
    page.evaluate("player.cameraTarget = '700 auto auto'")
    settled(page)
    assert page.evaluate("player.getCameraTarget().x") == pytest.approx(700)
    page.evaluate("player.mesh.seek({ frame: 0 })")
    settled(page)
    assert page.evaluate("player.getCameraTarget().x") == pytest.approx(700)


@pytest.mark.parametrize("files_of", ['src="/sheet.reel" texture="/walk.webm"', 'src="/sheet.mp4"'])
def test_a_video_is_synchronized_and_pauses_off_screen(shown, files_of):
    page = shown(
        f'<reel-player {files_of} autoplay loop controls muted interpolate="false">'
        '</reel-player><div class="far"></div>'
    )
    page.evaluate("document.querySelector('.far').style.height = '4000px'")
    page.evaluate(
        """() => {
          window.pairs = [];
          player.addEventListener("timeupdate", () => {
            const { texture, frame } = player.mesh;
            if (!texture || texture.image.width < 256) return;
            const pen = new OffscreenCanvas(208, 16).getContext("2d");
            pen.drawImage(texture.image, 0, 0);
            const { data } = pen.getImageData(0, 8, 208, 1);
            let number = 0;
            for (let i = 0; i < 12; i++) number = 2 * number + (data[4 * (16 * i + 8)] > 127);
            pairs.push([frame, number]);
          });
        }"""
    )
    until(page, "pairs.length > 20")
    pairs = page.evaluate("pairs")
    assert [frame for frame, _ in pairs] == [number for _, number in pairs]
    assert page.evaluate("player.mesh.video.muted")
    page.locator("reel-player").get_by_label("Unmute").click()
    until(page, "!player.mesh.video.muted && !player.muted")
    until(page, "player.mesh.video.webkitAudioDecodedByteCount > 0")
    page.evaluate("scrollTo(0, 3000)")
    until(page, "player.mesh.video.paused && !player.paused")
    page.evaluate("scrollTo(0, 0)")
    until(page, "!player.mesh.video.paused")
