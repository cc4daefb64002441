"""Tracks in the player: colors, legend, plots, and errors compared to the original."""

import re
import subprocess

import numpy as np
import pytest

import meshreel
from meshreel.model.tracks import Track
from meshreel.rendering.colormap import HEAT
from samples.browser import checked_rules
from samples.player_pages import COMMAND, picture_of, show, values_of, viewing, wait_until

N_FRAMES = 24
RED, GRAY, BLUE = (141, 27, 23), (238, 238, 238), (6, 72, 156)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A flag with tracks, and its original."""
    folder = tmp_path_factory.mktemp("tracks")
    flag = meshreel.simulate_flag(N_FRAMES, n_rows=16, n_columns=18)
    x = flag.vertices[..., 0].astype(np.float64)
    middles = flag.vertices[:, flag.faces].mean(axis=2)
    times = np.arange(N_FRAMES)[:, None]
    velocity = np.gradient(flag.vertices.astype(np.float64), axis=0)
    tracks = {
        "stress": Track((500 * np.sin(2 * x + 0.3 * times)).astype(np.float32), unit="Pa"),
        "velocity": Track(velocity.astype(np.float32), kind="velocity", unit="m/s"),
        "heat": Track((300 + 9 * middles[..., 0]).astype(np.float32), domain="face", unit="K"),
        "part": Track((4 * x).astype(np.int64)),
        "paint": Track((100 + 50 * np.stack([x, x, x], -1)).astype(np.uint8), kind="color"),
    }
    sequence = meshreel.MeshSequence(flag.vertices, flag.faces, fps=24, tracks=tracks)
    meshreel.save(sequence, folder / "original.npz")
    data = meshreel.encode(sequence, quality=90, block_frames=12, tracks={"stress": "2%"})
    (folder / "flag.reel").write_bytes(data)
    stress, heat = tracks["stress"], tracks["heat"]
    others = {
        "stress": Track(-stress.values, unit="Pa"),
        "heat": Track(600 - heat.values, domain="face", unit="K"),
        "paint": Track(255 - tracks["paint"].values, kind="color"),
    }
    meshreel.save(sequence.replace(tracks=others), folder / "mirrored.npz")
    return folder


@pytest.fixture(scope="module")
def decoded(folder):
    """Values of each track, of shape (T, N, C)."""
    sequence = meshreel.decode((folder / "flag.reel").read_bytes())
    return {name: track.values for name, track in sequence.tracks.items()}


@pytest.fixture(scope="module")
def stress_url(browser, folder):
    """Address of a page that colors the flag by its stress."""
    options = "--track", "stress", "--range", "-400:400"
    with viewing(folder / "flag.reel", *options) as (_, address):
        yield address


@pytest.fixture(scope="module")
def original_url(browser, folder):
    """Address of a page that compares the flag with its original."""
    options = "--original", folder / "original.npz"
    with viewing(folder / "flag.reel", *options) as (_, address):
        yield address


LEGEND = "document.querySelector('reel-player').shadowRoot.querySelector('.legend')"


def legend_of(page):
    return page.locator(".legend").get_attribute("aria-label")


def chosen(page, selector, value):
    """Select an option, and wait until the legend is updated."""
    before = legend_of(page)
    page.select_option(selector, value)
    wait_until(page, f"{LEGEND}.ariaLabel !== {before!r}")


def probe(page, item):
    """Enter an item; return its values over time."""
    page.locator("#probe-item").fill(str(item))
    page.locator("#probe-item").press("Enter")
    wait_until(page, "player.probed() !== null")
    return page.evaluate("player.probed()")


def limits(page):
    return [float(end) for end in re.findall(r"(\S+) m/s", legend_of(page))]


def show_track(page, track):
    """Select a track, unless it is selected."""
    if page.locator("#track").input_value() != track:
        chosen(page, "#track", track)


def test_page_opens_with_the_requested_track(new_page, stress_url, decoded):
    page = new_page(stress_url)
    assert page.locator("#track").input_value() == "stress"
    assert legend_of(page).startswith("Colors: stress from -400 Pa to 400 Pa")
    assert page.locator("#range").input_value() == "typed"
    assert page.locator("#range-low").input_value() == "-400"
    page.locator("#panel-button").click()
    values = decoded["stress"][6]
    show(page, 6)
    picture = picture_of(page, "canvas")
    assert values.min() < -400
    assert values.max() > 400
    for color in (RED, GRAY, BLUE):  # approximately, because of the lighting
        assert np.abs(picture - np.array(color)).max(axis=2).min() < 24


def test_colors_are_loaded_again_when_the_user_retries_after_an_error(new_page, stress_url):
    page = new_page(stress_url)
    page.evaluate(
        """() => {
          const error = Object.assign(new Error("no connection"), { name: "SourceError" });
          const { mesh } = document.querySelector("reel-player");
          mesh.dispatchEvent({ type: "error", error, block: 0, track: "stress" });
        }"""
    )
    assert "no connection" in page.get_by_role("alert").inner_text()
    page.get_by_role("button", name="Try again").click()
    show(page, 6)
    assert not page.get_by_role("alert").is_visible()
    assert legend_of(page).startswith("Colors: stress from -400 Pa to 400 Pa")
    assert count_pixels(picture_of(page, "canvas"), RED) > 500


def test_legend_follows_track_component_and_range(new_page, stress_url, decoded):
    page = new_page(stress_url)
    chosen(page, "#track", "velocity")
    speed = np.linalg.norm(decoded["velocity"].astype(float), axis=2)
    low, high = np.percentile(speed[np.rint(np.arange(8) * 23 / 7).astype(int)], [2, 98])
    assert limits(page) == pytest.approx([low, high], rel=6e-3)
    assert "2nd and 98th percentile" in page.locator(".legend .title").inner_text()
    chosen(page, "#component", "z")
    assert "velocity, z" in legend_of(page)
    chosen(page, "#range", "0%:100%")
    most = np.abs(decoded["velocity"][..., 2]).max()
    assert limits(page) == pytest.approx([-most, most], rel=6e-3)
    chosen(page, "#track", "paint")
    assert legend_of(page) == "Colors: paint"
    assert page.locator("#range-row").is_hidden()
    page.select_option("#track", "")
    wait_until(page, f"{LEGEND}.hidden")
    assert page.locator("#track-options").is_hidden()


def test_invalid_custom_range_is_rejected(new_page, stress_url):
    page = new_page(stress_url)
    page.locator("#range-low").fill("500")
    page.locator("#range-low").press("Enter")
    assert page.evaluate("document.getElementById('range-high').validationMessage")
    assert "from -400 Pa to 400 Pa" in legend_of(page)
    page.locator("#range-high").fill("600")
    page.locator("#range-high").press("Enter")
    wait_until(page, f"{LEGEND}.ariaLabel.includes('500 Pa to 600 Pa')")


@pytest.mark.parametrize("track", ["stress", "heat", "part"])
def test_values_are_plotted_over_time_at_an_entered_index(shared_page, stress_url, decoded, track):
    page = shared_page(stress_url)
    show_track(page, track)
    item = 123
    np.testing.assert_allclose(probe(page, item), decoded[track][:, item, 0], rtol=1e-6)
    place = "face" if track == "heat" else "vertex"
    assert page.locator("#probe-title").inner_text() == f"{track} at {place} {item}"
    show(page, 7)
    told = page.locator("#probe output").inner_text()
    assert float(told) == pytest.approx(decoded[track][7, item, 0], rel=1e-3)
    page.locator("#probe-close").click()
    assert page.locator("#probe").is_hidden()


def test_invalid_index_shows_an_error(new_page, stress_url):
    page = new_page(stress_url)
    page.locator("#probe-item").fill("999999")
    page.locator("#probe-item").press("Enter")
    page.get_by_role("alert").wait_for()
    assert "got 999999" in page.get_by_role("alert").inner_text()


@pytest.mark.parametrize("track", ["stress", "heat"])
def test_double_click_plots_the_picked_item(new_page, stress_url, decoded, track):
    page = new_page(stress_url)
    if track != "stress":
        chosen(page, "#track", track)
    box = page.locator("canvas").bounding_box()
    page.mouse.dblclick(box["x"] + box["width"] * 0.4, box["y"] + box["height"] * 0.25)
    wait_until(page, "player.probed() !== null")
    item = int(page.locator("#probe-item").input_value())
    result = page.evaluate("player.probed()")
    np.testing.assert_allclose(result, decoded[track][:, item, 0], rtol=1e-6)
    # The marked place is where the click was: its color is in the middle of the mark's.
    picture = picture_of(page, "canvas")
    x, y = int(box["width"] * 0.4), int(box["height"] * 0.25)
    near = picture[y - 40 : y + 40, x - 40 : x + 40]
    assert (np.abs(near - [255, 89, 203]).max(axis=2) < 12).sum() > 50
    page.keyboard.press("t")  # the next track
    wait_until(page, f"document.getElementById('track').value !== '{track}'")


def test_page_without_tracks_hides_their_controls(new_page, url):
    page = new_page(url)
    assert page.locator("#tracks").is_hidden()
    page.keyboard.press("t")
    assert page.locator(".legend").is_hidden()


def test_errors_of_tracks_are_those_of_the_original(new_page, original_url, folder, decoded):
    page = new_page(original_url)
    original = meshreel.load(folder / "original.npz").tracks
    labels = page.locator("#heat option").all_inner_texts()
    assert labels[-3:] == ["error of stress", "error of velocity", "error of heat"]
    page.evaluate("player.seek(9)")
    page.evaluate("player.setHeat('track 0')")
    wanted = np.abs(original["stress"].values - decoded["stress"])[9, :, 0]
    np.testing.assert_allclose(values_of(page), wanted, rtol=1e-4, atol=1e-4)
    caption = page.locator(".legend .title").inner_text()
    assert re.fullmatch(r"error of stress, up to [\d.]+ Pa", caption)
    page.evaluate("player.setHeat('track 2')")
    faces = meshreel.decode((folder / "flag.reel").read_bytes()).faces
    off = np.abs(original["heat"].values - decoded["heat"])[9, :, 0].astype(np.float64)
    most = np.zeros(16 * 18)
    np.maximum.at(most, faces, off[:, None])
    assert "error of heat" in page.locator(".legend .title").inner_text()
    np.testing.assert_allclose(values_of(page), most, rtol=1e-4, atol=1e-6)


def test_heat_map_and_track_replace_each_other(new_page, original_url):
    page = new_page(original_url)
    page.select_option("#track", "heat")  # splits vertices
    wait_until(page, f"!{LEGEND}.hidden")
    page.locator("#wire").check()
    page.select_option("#heat", "distance")
    wait_until(page, "player.heatValues() !== null")
    wait_until(page, "document.getElementById('track').value === ''")
    assert legend_of(page).startswith("Colors: vertex distance")
    assert len(values_of(page)) == 16 * 18
    page.select_option("#track", "stress")
    wait_until(page, "player.heatValues() === null")
    assert page.locator("#heat").input_value() == ""


@pytest.fixture(scope="module")
def exported_tracks(browser, folder):
    """Address of an exported page with the flag and its original, colored by a track."""
    path = folder / "flag.html"
    command = [*COMMAND, "export", str(folder / "flag.reel"), "-o", str(path)]
    command += ["--original", str(folder / "original.npz"), "--track", "part", "--range", "0:8"]
    subprocess.run(command, check=True, capture_output=True)
    return path.as_uri()


def test_exported_page_opens_with_an_exact_track(new_page, exported_tracks, decoded):
    page = new_page(exported_tracks)
    assert legend_of(page) == "Colors: part from 0 to 8"
    assert probe(page, 77) == decoded["part"][:, 77, 0].tolist()


def halves(page):
    """Return the pixels of the decoded and of the original view, below their labels."""
    picture = picture_of(page, "canvas")[60:]
    middle = picture.shape[1] // 2
    return picture[:, :middle], picture[:, middle:]


def count_pixels(picture, color):
    """Return the number of pixels close to a color, apart from lighting."""
    return (np.abs(picture - np.array(color)).max(axis=2) < 30).sum()


@pytest.fixture(scope="module")
def mirrored(browser, folder):
    """Addresses of a served and an exported page with an original of mirrored values."""
    options = "--original", folder / "mirrored.npz", "--track", "stress", "--range", "-400:400"
    page = folder / "mirrored.html"
    command = [*COMMAND, "export", str(folder / "flag.reel"), "-o", str(page)]
    subprocess.run([*command, *map(str, options)], check=True, capture_output=True)
    with viewing(folder / "flag.reel", *options) as (_, address):
        yield {"view": address, "export": page.as_uri()}


@pytest.mark.parametrize("command", ["view", "export"])
def test_original_is_colored_by_its_own_values(new_page, mirrored, command):
    page = new_page(mirrored[command])
    page.locator("#panel-button").click()
    show(page, 6)
    decoded, original = halves(page)
    assert count_pixels(decoded, RED) > 500
    for color, other in ((RED, BLUE), (BLUE, RED), (GRAY, GRAY)):
        assert count_pixels(original, color) == pytest.approx(count_pixels(decoded, other), rel=0.1)
    page.evaluate("player.setTrack({track: 'heat', component: null, range: null, colormap: null})")
    decoded, original = halves(page)  # a track of faces
    assert count_pixels(decoded, HEAT[0]) > 100
    assert count_pixels(original, HEAT[0]) > 100
    warm = decoded[..., 1] > 150  # green to yellow; the original is violet to blue there
    covered = np.abs(decoded - original).max(axis=2) > 60
    assert (original[warm & covered][:, 1] < decoded[warm & covered][:, 1]).mean() > 0.9
    page.evaluate("player.setTrack(null)")
    decoded, original = halves(page)
    assert (np.abs(decoded - original).max(axis=2) > 30).mean() < 0.005
    assert not page.get_by_text("which lacks").is_visible()


@pytest.mark.parametrize("track", ["velocity", "part"])
def test_a_missing_track_of_the_original_is_reported(shared_page, mirrored, track):
    page = shared_page(mirrored["view"])
    show_track(page, track)
    assert page.get_by_text("original, which lacks these values").is_visible()
    assert "error of velocity" not in page.locator("#heat option").all_inner_texts()


@pytest.mark.slow
@pytest.mark.parametrize(("width", "height"), [(1280, 720), (390, 844)])
def test_axe_finds_no_violations_in_the_controls_of_tracks(new_page, stress_url, width, height):
    page = new_page(stress_url, width=width, height=height)
    box = page.locator("canvas").bounding_box()
    page.mouse.dblclick(box["x"] + box["width"] * 0.4, box["y"] + box["height"] * 0.5)
    wait_until(page, "player.probed() !== null")
    if width < 720:
        page.locator("#panel-button").click()
    checked_rules(page)
    assert page.evaluate("document.documentElement.scrollWidth") == width
