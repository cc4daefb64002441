"""The player of `meshreel view` in a browser."""

import re
import subprocess
from itertools import pairwise, product

import numpy as np
import pytest
from PIL import Image

import meshreel
from meshreel.kernel.mp4 import reel_box
from meshreel.metrics.heat import heat_field
from meshreel.rendering.colormap import HEAT
from samples.browser import checked_rules
from samples.meshes import waving_grid
from samples.numbered_video import moving_sheet, numbered_video
from samples.player_pages import (
    COMMAND,
    covered,
    picture_of,
    positions_of,
    put_to_rest,
    show,
    state_of,
    values_of,
    viewing,
    wait_until,
)

LAST = 35
FILLED = 2 / 3
FRAMES = (0, 5, 11, 12, 23, 24, LAST)
"""Frames on both sides of each block boundary."""


def diagonal_of(vertices):
    return np.linalg.norm(np.ptp(vertices.reshape(-1, 3), axis=0))


def distance_percent(flag, decoded, frame):
    original = meshreel.load(flag / "original.npz")
    diagonal = diagonal_of(original.vertices)
    field = heat_field("distance", original.faces, original.n_verts, diagonal)
    return field(original.vertices[frame], decoded[frame])


@pytest.fixture
def page(shared_page, url):
    """The player, shared by tests that change only its frame and heat map."""
    return shared_page(url)


@pytest.fixture
def own_page(new_page, url):
    """A separate player, which a test may change in any way."""
    return new_page(url)


@pytest.fixture
def compared(shared_page, compared_url):
    """The player with an original; tests change only its frame and heat map."""
    return when_measured(shared_page(compared_url))


@pytest.fixture
def own_compared(new_page, compared_url):
    """A separate player with an original, which a test may change."""
    return when_measured(new_page(compared_url))


def when_measured(page):
    """Open the page and wait until all frames are measured."""
    page.locator("#plots figure").first.wait_for()
    return page


def test_page_opens_at_the_largest_error_when_there_is_an_original(
    new_page, compared_url, flag, decoded
):
    page = new_page(compared_url, is_at_rest=False)
    page.locator("#plots figure").first.wait_for()  # all frames are measured
    largest = [distance_percent(flag, decoded, frame).max() for frame in range(LAST + 1)]
    wait_until(page, f"player.state().frame === {int(np.argmax(largest))}")
    assert state_of(page)["heat"] == "distance"
    assert not state_of(page)["playing"]


def test_page_does_not_seek_when_the_user_has_interacted(new_page, compared_url):
    page = new_page(compared_url, is_at_rest=False)
    page.keyboard.press("Home")
    page.locator("#plots figure").first.wait_for()
    page.wait_for_timeout(300)
    assert state_of(page)["frame"] == 0


def test_sought_frames_match_decode(page, decoded):
    for frame in FRAMES:
        show(page, frame)
        assert state_of(page)["frame"] == frame
        errors = np.abs(positions_of(page) - decoded[frame])
        assert errors.max() < 1e-4 * diagonal_of(decoded), frame


def test_page_stops_at_the_end_without_loop(own_page):
    own_page.get_by_role("button", name="Loop").click()
    own_page.get_by_label("Speed").select_option("4")
    own_page.get_by_role("button", name="Play").click()
    wait_until(own_page, "!player.state().playing")
    assert state_of(own_page)["frame"] == LAST


def test_filling_in_interpolates_positions(own_page, decoded):
    own_page.get_by_label("Fill in between frames").check()
    own_page.get_by_label("Speed").select_option("0.25")
    own_page.get_by_role("button", name="Play").click()
    distances = []
    for _ in range(8):
        own_page.wait_for_timeout(50)
        distances.append(np.abs(decoded - positions_of(own_page)).max(axis=(1, 2)).min())
    assert max(distances) > 1e-4 * diagonal_of(decoded)
    own_page.get_by_role("button", name="Pause").click()
    frame = state_of(own_page)["frame"]
    show(own_page, frame)
    assert np.abs(positions_of(own_page) - decoded[frame]).max() < 1e-4 * diagonal_of(decoded)


def test_dragging_the_bar_shows_its_frame(page, decoded):
    page.locator(".bar input").fill("29")
    wait_until(page, "player.state().frame === 29")
    show(page, 29)
    assert np.abs(positions_of(page) - decoded[29]).max() < 1e-4 * diagonal_of(decoded)
    assert page.locator(".bar .text").inner_text().split()[:3] == ["29", "/", str(LAST)]


def test_measured_frame_rate_exceeds_1(page, record_property):
    rate = page.evaluate("player.measureFps(1)")
    record_property("frames_per_second", rate)
    assert rate > 1


def test_player_plays_in_the_frame_of_a_notebook_when_a_file_shows_itself(new_page, flag, tmp_path):
    with meshreel.open(flag / "flag.reel") as reel:
        (tmp_path / "cell.html").write_text(f"<body>{reel._repr_html_()}</body>")
    page = new_page((tmp_path / "cell.html").as_uri(), is_shown=False)
    page.locator("iframe").wait_for()
    frame = page.frames[1]
    wait_until(frame, "window.player?.state?.().playing === true")
    wait_until(frame, "player.state().frame > 3")
    assert not frame.locator("#panel").is_visible()
    assert 0.05 < covered(picture_of(frame, "canvas")).mean() < 0.9


def test_page_sends_no_external_requests(browser, new_page, compared_url):
    page = new_page(compared_url)
    asked = []
    page.on("request", lambda request: asked.append(request.url))
    page.reload()
    page.evaluate("player.ready")
    show(page, LAST)
    assert asked
    assert [address for address in asked if not address.startswith((compared_url, "blob:"))] == []


def test_fixed_range_heat_map_shows_vertex_errors(compared, flag, decoded):
    compared.locator("#heat").select_option("distance")
    wait_until(compared, "player.state().heat === 'distance'")
    for frame in (3, 30):
        show(compared, frame)
        compared.evaluate("player.setHeat('distance')")
        expected = distance_percent(flag, decoded, frame)
        np.testing.assert_allclose(values_of(compared), expected, atol=1e-4)
        assert 0.5 < state_of(compared)["hottest"] / expected.max() < 3, frame
    compared.evaluate("player.setHeat(null)")
    assert compared.evaluate("player.heatValues()") is None


def test_per_frame_heat_map_colors_the_mesh_up_to_the_largest_error(own_compared, flag, decoded):
    show(own_compared, 20)
    own_compared.locator("[name=arrangement][value=decoded]").check()
    own_compared.evaluate("player.setHeat('distance')")
    own_compared.get_by_label(re.compile("Colou?rs span the shown frame only")).check()
    wait_until(own_compared, "player.state().perFrameRange")
    own_compared.evaluate("player.setHeat('distance')")
    picture = picture_of(own_compared, "canvas")[60:]
    painted = picture[covered(picture)]
    steps = np.linspace(0, len(HEAT) - 1, 200)
    ramp = np.array([np.interp(steps, range(len(HEAT)), channel) for channel in HEAT.T]).T
    off = np.abs(painted[::7, None] - ramp[None]).max(axis=2).min(axis=1)
    assert np.median(off) < 20  # heat is lit weakly
    assert len(np.unique(painted // 16, axis=0)) > 20
    values = distance_percent(flag, decoded, 20)
    assert state_of(own_compared)["hottest"] == pytest.approx(values.max(), rel=1e-4)
    assert values_of(own_compared).argmax() == values.argmax()


def test_heat_map_of_a_paused_player_is_of_the_shown_frame(compared, flag, decoded):
    compared.evaluate("player.setHeat('distance')")
    compared.evaluate("player.play()")
    compared.wait_for_timeout(600)
    compared.evaluate("player.pause()")
    frame = state_of(compared)["frame"]
    show(compared, frame)
    expected = distance_percent(flag, decoded, frame)
    np.testing.assert_allclose(values_of(compared), expected, atol=1e-4)


def test_legend_shows_ends_and_ticks(compared):
    bar = compared.locator(".legend")
    assert not bar.is_visible()
    compared.evaluate("player.setHeat('distance')")
    shown = picture_of(compared, ".legend")
    for color in (HEAT[0], HEAT[-1]):
        assert (np.abs(shown - color).max(axis=2) < 12).sum() > 5
    assert "% of the diagonal" in bar.inner_text()
    first, last, *ticks = bar.locator(".values span").all_inner_texts()
    assert first == "0"
    label = bar.get_attribute("aria-label")
    assert re.search(rf"from 0 % to {last}$", label)
    largest = float(re.fullmatch(r"(?:≥ )?([\d.]+) %", last)[1])
    assert all(0 < float(tick) < largest for tick in ticks)
    assert ticks
    edges = bar.locator(".values span").evaluate_all(
        "spans => spans.map((span) => span.getBoundingClientRect()).map((b) => [b.x, b.right])"
    )
    edges.sort()
    assert all(right < left for (_, right), (left, _) in pairwise(edges))


@pytest.mark.parametrize(("width", "height"), [(1280, 720), (390, 844)])
def test_legend_covers_nothing(new_page, compared_url, width, height):
    page = new_page(compared_url, width=width, height=height)
    page.evaluate("player.setHeat('distance')")
    legend, canvas = (page.locator(part).bounding_box() for part in (".legend", "canvas"))
    assert legend["y"] >= canvas["y"] + canvas["height"]
    for inner in (page.locator(f".legend {part}") for part in (".title", ".colors", ".values")):
        box = inner.bounding_box()
        assert box["x"] >= legend["x"] + 8
        assert box["x"] + box["width"] <= legend["x"] + legend["width"] - 8
        assert box["y"] >= legend["y"] + 6
        assert box["y"] + box["height"] <= legend["y"] + legend["height"] - 6


@pytest.mark.parametrize("size", [(700, 500), (820, 420), (390, 844), (1100, 900)])
def test_arrangement_of_the_views_does_not_depend_on_the_legend(new_page, compared_url, size):
    width, height = size
    page = new_page(compared_url, width=width, height=height)
    places = []
    for kind in ("distance", None, "angle"):
        page.evaluate("kind => player.setHeat(kind)", kind)
        page.wait_for_timeout(100)
        boxes = [page.locator("#labels span").nth(i).bounding_box() for i in (0, 1)]
        places.append(boxes[0]["y"] == boxes[1]["y"])
    assert len(set(places)) == 1


@pytest.mark.parametrize("width", [1000, 700, 390, 320])
def test_labels_do_not_cover_the_title(new_page, compared_url, width):
    page = new_page(compared_url, width=width, height=600)
    title = page.locator("#name").bounding_box()
    assert all(
        label.bounding_box()["y"] >= title["y"] + title["height"] - 1
        for label in page.locator("#labels span").all()
    )


@pytest.mark.parametrize("width", [1000, 390, 320])
def test_labels_of_an_overlay_do_not_overlap(new_page, compared_url, width):
    page = new_page(compared_url, width=width, height=600)
    page.locator("#arrangement label:has([value=over])").click()
    wait_until(page, "document.querySelectorAll('#labels span')[1].textContent.endsWith('lines')")
    decoded, original = (label.bounding_box() for label in page.locator("#labels span").all())
    assert decoded["x"] > 0
    assert decoded["x"] + decoded["width"] < original["x"]
    assert original["x"] + original["width"] < page.locator("canvas").bounding_box()["width"]


def test_page_follows_the_color_scheme_until_the_user_chooses(new_page, url):
    page = new_page(url)
    background = "getComputedStyle(document.body).backgroundColor"
    light = page.evaluate(background)
    page.emulate_media(color_scheme="dark")
    wait_until(page, "document.querySelector('[name=background][value=dark]').checked")
    dark = page.evaluate(background)
    assert light == "rgb(255, 255, 255)"
    assert dark == "rgb(29, 33, 39)"
    assert picture_of(page, "canvas")[-20, 20].max() < 40
    page.get_by_label("Wireframe").check()  # no choice of a background
    page.emulate_media(color_scheme="light")
    wait_until(page, "document.querySelector('[name=background][value=light]').checked")
    assert page.evaluate(background) == light
    page.keyboard.press("b")
    page.emulate_media(color_scheme="dark")
    page.emulate_media(color_scheme="light")
    page.wait_for_timeout(100)
    assert page.evaluate(background) == dark


def test_legend_says_which_frames_the_colors_span(own_compared):
    own_compared.evaluate("player.setHeat('distance')")
    title = own_compared.locator(".legend .title")
    assert "span" not in title.text_content()
    own_compared.get_by_label("Colors span the shown frame only").check()
    wait_until(own_compared, "player.state().perFrameRange")
    assert "colors span this frame" in title.text_content()


def test_each_error_takes_one_line(compared):
    error = compared.locator("#original-rows dd", has_text="% of the diagonal").first
    title = compared.locator("#compare h2")
    assert error.bounding_box()["height"] < 1.5 * title.bounding_box()["height"]


def test_clicking_the_plot_seeks(compared):
    plot = compared.locator("#plots svg").first
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    compared.mouse.click(box["x"] + box["width"] * 0.97, box["y"] + box["height"] / 2)
    wait_until(compared, f"player.state().frame > {LAST - 2}")


def test_panel_shows_ratio_errors_and_sizes(compared):
    panel = compared.locator("#panel").inner_text()
    for figure in ("ratio", "KG error", "STED", "Where the bytes are"):
        assert figure in panel


@pytest.mark.parametrize(("width", "height"), [(1280, 720), (390, 844)])
def test_mesh_fills_two_thirds_in_the_middle_of_the_canvas_at_first(new_page, url, width, height):
    page = new_page(url, width=width, height=height, is_at_rest=False)
    assert state_of(page)["playing"]
    assert state_of(page)["heat"] is None
    put_to_rest(page)
    page.evaluate("document.getElementById('name').hidden = true")
    mask = covered(picture_of(page, "canvas"))
    shares = [np.ptp(np.flatnonzero(mask.any(axis=axis))) / mask.shape[1 - axis] for axis in (0, 1)]
    assert FILLED < max(shares) < 1
    assert np.abs(np.argwhere(mask).mean(axis=0) / mask.shape - 0.5).max() < 0.25


def test_followed_mesh_stays_centered(new_page, url):
    page = new_page(url, width=1280, height=720)  # of lower ones, the cut below is a large part
    page.get_by_label("Keep the mesh in the middle").check()
    for frame in (0, LAST):
        show(page, frame)
        page.wait_for_timeout(200)
        mask = covered(picture_of(page, "canvas"))[60:]
        assert 0.1 < mask.mean() < 0.8, frame
        assert np.abs(np.argwhere(mask).mean(axis=0) / mask.shape - 0.5).max() < 0.12, frame


def test_meshes_side_by_side_have_the_same_size(new_page, compared_url):
    compared = new_page(compared_url, width=1400)
    left, right = np.array_split(covered(picture_of(compared, "canvas"))[60:-120], 2, axis=1)
    assert left.mean() > 0.05
    assert left.mean() == pytest.approx(right.mean(), rel=0.02)


def test_views_of_a_tall_figure_that_walks_are_side_by_side(new_page, tmp_path):
    flag = meshreel.simulate_flag(20, n_rows=8, n_columns=6)
    path = np.linspace(0, 4, 20)[:, None, None] * [1, 0, 0]
    walk = flag.replace(vertices=flag.vertices * [1, 4, 1] + path)
    meshreel.save(walk, tmp_path / "walk.npz")
    (tmp_path / "walk.reel").write_bytes(meshreel.encode(walk))
    with viewing(tmp_path / "walk.reel", "--original", tmp_path / "walk.npz") as (_, address):
        page = new_page(address, width=1000, height=700)
        assert page.get_by_label("Keep the mesh in the middle").is_checked()
        decoded, original = (label.bounding_box() for label in page.locator("#labels span").all())
        assert decoded["y"] == original["y"]
        assert decoded["y"] + decoded["height"] <= page.locator("canvas").bounding_box()["y"]


def test_views_share_a_camera(own_compared):
    before = picture_of(own_compared, "canvas")
    box = own_compared.locator("canvas").bounding_box()
    own_compared.mouse.move(box["x"] + box["width"] * 0.25, box["y"] + box["height"] / 2)
    own_compared.mouse.down()
    own_compared.mouse.move(box["x"] + box["width"] * 0.35, box["y"] + box["height"] * 0.6, steps=4)
    own_compared.mouse.up()
    own_compared.wait_for_timeout(300)
    after = picture_of(own_compared, "canvas")
    changed = np.abs(after - before).max(axis=2) > 12
    left, right = np.array_split(changed[60:], 2, axis=1)
    assert min(left.mean(), right.mean()) > 0.03


def test_overlay_is_not_hidden_when_the_original_lies_just_behind(new_page, flag, tmp_path):
    original = meshreel.load(flag / "original.npz")
    behind = original.vertices - np.float32([0, 0, 0.005 * diagonal_of(original.vertices)])
    meshreel.save(original.replace(vertices=behind), tmp_path / "behind.npz")
    with viewing(flag / "flag.reel", "--original", tmp_path / "behind.npz") as (_, address):
        page = new_page(address)
        page.locator("[name=arrangement][value=over]").check()
        page.wait_for_timeout(300)
        red, _, blue = picture_of(page, "canvas")[60:].transpose(2, 0, 1)
    assert (red - blue > 40).mean() > 0.02


def test_keys_act_like_their_controls(own_page):
    before = picture_of(own_page, "canvas")
    for key, changed in (
        ("w", "#wire"),
        ("f", "[name=shading][value=flat]"),
        ("u", "[name=up][value=z]"),
    ):
        own_page.keyboard.press(key)
        assert own_page.locator(changed).is_checked(), key
        own_page.wait_for_timeout(300)
        after = picture_of(own_page, "canvas")
        assert (after != before).any(), key
        before = after


def test_keys_step_and_jump(own_page):
    for key, frame in [
        ("ArrowRight", 1),
        ("Shift+ArrowRight", 11),
        ("ArrowLeft", 10),
        ("End", LAST),
        ("ArrowRight", 0),
        ("End", LAST),
        ("Home", 0),
    ]:
        own_page.keyboard.press(key)
        assert state_of(own_page)["frame"] == frame
    own_page.keyboard.press(" ")
    assert state_of(own_page)["playing"]


def test_help_lists_the_keys(page):
    page.keyboard.press("?")
    assert "play or pause" in page.get_by_role("dialog").inner_text()
    page.keyboard.press("Escape")
    assert not page.get_by_role("dialog").is_visible()


def test_screenshot_contains_the_legend(compared):
    compared.evaluate("player.setHeat('distance')")
    with compared.expect_download() as download:
        compared.get_by_role("button", name="Screenshot").click()
    assert download.value.suggested_filename == "flag-0.png"
    with Image.open(download.value.path()) as image:
        assert image.format == "PNG"
        saved = np.asarray(image.convert("RGB")).astype(int)
    lower_left = saved[-80:, :360]
    ramp = np.array(HEAT)
    assert all(np.abs(lower_left - color).max(axis=2).min() < 12 for color in ramp)
    corner = saved[-16, 16]
    assert (np.abs(lower_left - corner).max(axis=2) > 150).sum() > 50  # text


@pytest.mark.parametrize("width", [1280, 390])
def test_axe_finds_no_violations(new_page, compared_url, width):
    page = new_page(compared_url, width=width)
    page.locator("#plots figure").first.wait_for()
    page.evaluate("player.setHeat('distance')")
    assert len(checked_rules(page)) > 10
    page.locator("[name=background][value=dark]").check()
    checked_rules(page)
    page.locator("[name=background][value=light]").check()
    page.keyboard.press("?")
    checked_rules(page)


def test_nothing_overflows_on_a_phone(new_page, compared_url):
    page = new_page(compared_url, width=390, height=844)
    for height in (844, 600):
        page.set_viewport_size({"width": 390, "height": height})
        wait_until(page, f"innerHeight === {height}")
        assert page.evaluate("document.documentElement.scrollWidth") == 390
        for control in page.locator("#viewer button:visible").all():
            box = control.bounding_box()
            assert min(box["width"], box["height"]) >= 40
            assert box["x"] + box["width"] <= 390
        assert page.locator("canvas").bounding_box()["height"] > 0.25 * height


def test_bar_of_a_phone_has_two_rows_at_every_frame(new_page, tmp_path):
    (tmp_path / "long.reel").write_bytes(meshreel.encode(waving_grid(1001)))
    with viewing(tmp_path / "long.reel") as (_, address):
        page = new_page(address)
        for width, frame in product((360, 390, 700), (0, 1000)):
            page.set_viewport_size({"width": width, "height": 700})
            wait_until(page, f"innerWidth === {width}")
            show(page, frame)
            timeline = page.locator(".bar input").bounding_box()
            text = page.locator(".bar .text").bounding_box()
            buttons = page.locator("#viewer button:visible").all()
            assert text["y"] < timeline["y"] + timeline["height"]
            assert len({button.bounding_box()["y"] for button in buttons}) == 1


@pytest.mark.parametrize("width", [800, 900, 1040, 1280])
def test_all_controls_of_the_bar_are_visible_next_to_the_panel(new_page, url, width):
    page = new_page(url, width=width, height=600)
    right = page.locator("#viewer").bounding_box()["width"]
    assert page.locator(".bar input").bounding_box()["width"] > 120
    for control in page.locator("#viewer button:visible").all():
        box = control.bounding_box()
        assert box["x"] + box["width"] <= right


def test_panel_describes_truncated_and_damaged_files(new_page, flag, tmp_path):
    data = bytearray((flag / "flag.reel").read_bytes())
    (tmp_path / "truncated.reel").write_bytes(data[: len(data) * 4 // 5])
    data[len(data) * 4 // 5] ^= 1
    (tmp_path / "damaged.reel").write_bytes(data)
    for name, n_truncated, has_sizes in (("truncated", 1, True), ("damaged", 0, False)):
        with viewing(tmp_path / f"{name}.reel") as (_, address):
            page = new_page(address)
            assert page.locator("#rows").inner_text().count("truncated") == n_truncated
            assert page.get_by_text("Where the bytes are").is_visible() == has_sizes


def test_a_lost_server_is_an_error(new_page, flag):
    with viewing(flag / "flag.reel", "--original", flag / "original.npz") as (_, address):
        page = new_page(address)
        page.locator("#plots figure").first.wait_for()  # no other request is automatic
    page.keyboard.press("End")
    page.get_by_role("alert").wait_for()
    assert "server does not" in page.get_by_role("alert").inner_text()


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("method", "options", "percent"),
    [
        ("reel", {"max_error": 0.02}, 0.01),
        ("lossless", {}, 0.002),
        ("grid", {"max_error": 0.02}, 0.002),
    ],
    ids=["reel", "lossless", "grid"],
)
def test_exported_page_draws_decoded_positions(new_page, tmp_path, method, options, percent):
    flag = meshreel.simulate_flag(40, n_rows=9, n_columns=11)
    data = meshreel.encode(flag, method, **options)
    (tmp_path / "flag.reel").write_bytes(data)
    command = [*COMMAND, "export", "flag.reel", "-o", "flag.html"]
    done = subprocess.run(command, check=True, capture_output=True, text=True, cwd=tmp_path)
    assert "re-encoded" not in done.stderr
    page = new_page((tmp_path / "flag.html").as_uri())
    vertices = meshreel.decode(data).vertices
    for frame in (0, 31, 32, 39):
        show(page, frame)
        off = np.abs(positions_of(page) - vertices[frame]).max()
        assert off < percent / 100 * diagonal_of(vertices)


@pytest.fixture
def textured(tmp_path):
    """Function that exports a textured sheet and returns the address of its page."""

    def export(texture):
        sheet = tmp_path / "sheet.reel"
        sheet.write_bytes(meshreel.encode(moving_sheet()))
        page = tmp_path / "sheet.html"
        command = [*COMMAND, "export", sheet, "-o", page, "--texture", texture]
        subprocess.run(list(map(str, command)), check=True, capture_output=True)
        return page.as_uri()

    return export


def test_exported_page_shows_an_image_when_it_has_one(new_page, textured, tmp_path):
    Image.new("RGB", (16, 16), (220, 30, 30)).save(tmp_path / "red.png")
    page = new_page(textured(tmp_path / "red.png"))
    red, green, blue = picture_of(page, "canvas")[60:].transpose(2, 0, 1)
    assert ((red - green > 100) & (red - blue > 100)).mean() > 0.05
    page.get_by_label(re.compile("Colou?rs of the file")).uncheck()
    page.wait_for_timeout(300)
    red, green, _ = picture_of(page, "canvas")[60:].transpose(2, 0, 1)
    assert (red - green > 100).mean() < 0.001


def test_served_page_starts_a_video_with_sound_muted(new_page, tmp_path):
    numbered_video(tmp_path / "moving.webm")
    (tmp_path / "sheet.reel").write_bytes(meshreel.encode(moving_sheet()))
    options = "--texture", tmp_path / "moving.webm"
    with viewing(tmp_path / "sheet.reel", *options) as (_, address):
        page = new_page(address, is_at_rest=False)
        wait_until(page, "player.state().frame > 5")
        wait_until(page, "document.querySelector('reel-player').mesh.video")
        assert page.evaluate("document.querySelector('reel-player').mesh.video.muted")
        red, _, blue = picture_of(page, "canvas")[60:].transpose(2, 0, 1)
        assert (np.abs(red - blue) > 40).mean() > 0.02
        assert not page.get_by_role("alert").is_visible()


def test_exported_page_plays_a_capture_in_one_file(new_page, tmp_path):
    film = numbered_video(tmp_path / "moving.mp4") + reel_box(meshreel.encode(moving_sheet()))
    (tmp_path / "scan.mp4").write_bytes(film)
    command = [*COMMAND, "export", "scan.mp4", "-o", "scan.html"]
    subprocess.run(command, check=True, capture_output=True, cwd=tmp_path)
    page = new_page((tmp_path / "scan.html").as_uri(), is_at_rest=False)
    wait_until(page, "document.querySelector('reel-player').mesh.video?.currentTime > 0.2")
    wait_until(page, "player.state().frame > 5")
    red, _, blue = picture_of(page, "canvas")[60:].transpose(2, 0, 1)
    assert (np.abs(red - blue) > 40).mean() > 0.02
    assert not page.get_by_role("alert").is_visible()


def test_page_shows_an_error_when_webgl_is_missing(new_page, url):
    script = "HTMLCanvasElement.prototype.getContext = () => null;"
    page = new_page(url, script=script, is_shown=False)
    page.get_by_role("alert").wait_for()
    assert "WebGL 2" in page.get_by_role("alert").inner_text()
