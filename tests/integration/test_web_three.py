"""`meshreel/three` in a browser with software rendering draws the expected values."""

from pathlib import Path

import pytest

from samples.browser import driven_browser
from samples.programs import output_of
from samples.tabs import Tab
from samples.web_package import built_package
from samples.webgl import COUNTING

ROOT = Path(__file__).parents[2]
MODULES = ROOT / "npm" / "node_modules"
PAGE = Path(__file__).parent / "three_in_browser" / "page.ts"
HTML = """<!doctype html><title>three</title>
<body><script type="module">{script}</script>"""

PLACES = [0, 2, 2.5, 4, 5, 5.25, 5.75, 6, 10.5, 11, 17, 0.5]
"""Times within and between blocks, forward and back; frames 2, 4 and 6 have corrections."""

WITHOUT_FLOAT_TARGETS = """
const given = WebGL2RenderingContext.prototype.getExtension;
WebGL2RenderingContext.prototype.getExtension = function (name) {
  return name === "EXT_color_buffer_float" ? null : given.call(this, name);
};
const names = WebGL2RenderingContext.prototype.getSupportedExtensions;
WebGL2RenderingContext.prototype.getSupportedExtensions = function () {
  return names.call(this).filter((name) => name !== "EXT_color_buffer_float");
};
"""

WITHOUT_FEEDBACK = """
const given = WebGL2RenderingContext.prototype.transformFeedbackVaryings;
WebGL2RenderingContext.prototype.transformFeedbackVaryings = function (program, names, mode) {
  given.call(this, program, ["nothing"], mode);
};
"""

FEW_LAYERS = """
const given = WebGL2RenderingContext.prototype.getParameter;
WebGL2RenderingContext.prototype.getParameter = function (name) {
  return name === this.MAX_ARRAY_TEXTURE_LAYERS ? 2 : given.call(this, name);
};
"""

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def script():
    built_package()
    command = [MODULES / ".bin" / "esbuild", PAGE, "--bundle", "--format=esm", "--target=es2022"]
    command += ["--define:WASM_MODULE=null"]  # nothing is decoded
    return output_of(*command, environment={"NODE_PATH": str(MODULES)})


@pytest.fixture(scope="module")
def browser():
    with driven_browser() as launched:
        yield launched


@pytest.fixture(scope="module")
def tabs():
    """Open tabs by the script that ran first in their page."""
    return {}


@pytest.fixture
def page_with(browser, script, tabs):
    """Open a page once for each initial script; script errors fail the test.

    Tests share pages, since each draws in a new canvas.
    """
    address = "http://page.test/"
    body = HTML.replace("{script}", script.replace("</script", "<\\/script"))
    used = []

    def page_with(before):
        tab = tabs.get(before)
        if tab is None or tab.is_gone or tab.errors:
            # A lost context complains.
            tab = tabs[before] = Tab(browser, before, {address: body}, is_webgl_watched=False)
            tab.page.goto(address)
            tab.page.wait_for_function("window.tests")
        used.append(tab)
        return tab.page

    yield page_with
    assert [error for tab in used for error in tab.errors] == []


@pytest.fixture
def ask(page_with):
    """Return the result of a test function of the page."""

    def answer(name, *given, before="", allowed=()):
        result = page_with(before).evaluate(
            "([name, given]) => tests[name](...given)", [name, list(given)]
        )
        if isinstance(result, dict):
            complaints = result.pop("complaints", [])
            assert [
                complaint
                for complaint in complaints
                if not any(map(complaint.__contains__, allowed))
            ] == []
        return result

    return answer


def assert_right(found, most=1e-4):
    for place, errors in zip(PLACES, found, strict=True):
        assert errors["position"] < most, place
        assert errors["read"] < most, place
        assert errors["normal"] < 10 * most, place


WAYS = {
    "GPU": ("", {}),
    "CPU": ("", {"gpu": False}),
    "no float render targets": (WITHOUT_FLOAT_TARGETS, {}),
    "driver error": (WITHOUT_FEEDBACK, {}),
    "too many modes": (FEW_LAYERS, {}),  # the second block has 9, and 8 have room
}


@pytest.mark.parametrize("way", WAYS)
def test_positions_and_normals_match_at_any_time(ask, way):
    before, options = WAYS[way]
    allowed = ["EXT_color_buffer_float extension not supported"]
    answer = ask("errors", PLACES, options, before=before, allowed=allowed)
    assert answer["isOnGpu"] == (way == "GPU")
    assert_right(answer["found"], 1e-6)


def test_positions_far_from_the_origin_are_accurate(ask):
    center = [4e6, -3e6, 1e5]
    answer = ask("errors", PLACES, {"origin": center}, {"center": center})
    assert_right(answer["found"], 1e-6)


@pytest.mark.parametrize("is_point", [False, True])
def test_the_mesh_casts_its_shadow(ask, is_point):
    answer = ask("shadow", is_point)
    assert sum(answer["shaded"]) < 0.8 * sum(answer["lit"])


def test_replaced_materials_show_the_frame(ask):
    answer = ask("otherMaterials")
    assert answer == {"overridden": [255, 0, 0], "own": [0, 255, 0]}


@pytest.mark.parametrize("is_given", [True, False])
def test_renderer_for_webgpu_shows_the_frame(ask, is_given):
    answer = ask("otherRenderer", is_given)
    assert answer == {"isOnGpu": False, "color": [255, 0, 0]}


def test_images_of_the_file_are_shown_upright(ask):
    answer = ask("picture", 8.5)
    assert strongest(answer["top"]) == 1
    assert strongest(answer["left"]) == 0
    assert strongest(answer["hem"]) == 2
    assert len(set(answer["plain"])) == 1
    assert min(answer["plain"]) > min(answer["hem"]) + 40


def strongest(values):
    return max(range(len(values)), key=values.__getitem__)


@pytest.mark.parametrize("options", [{}, {"gpu": False}])
def test_rays_hit_the_frame_that_is_shown(ask, options):
    answer = ask("pick", 6.5, options)
    assert answer["missed"] == 0
    for hit in answer["found"]:
        assert hit["count"] == 1
        assert hit["off"] < 1e-5
        assert hit["faceIndex"] == hit["triangle"]
        assert hit["corners"] == hit["expected"]
        assert hit["isMesh"]
        assert hit["hasUv"]


def test_dispose_releases_all_gpu_resources(ask):
    answer = ask("disposal", 3, before=COUNTING)  # the second mesh moves on the CPU
    after = [one["after"] for one in answer["counts"]]
    assert after[1:] == after[:1] * 2
    assert after[0]["geometries"] == 1
    during = answer["counts"][-1]["during"]
    assert during["textures"] > after[-1]["textures"]
    assert during["programs"] > after[-1]["programs"]
    assert during["TransformFeedback"] > after[-1]["TransformFeedback"] == 0


def test_a_lost_context_is_restored(ask):
    answer = ask("contextLoss")
    assert max(answer["before"].values()) < 1e-5
    assert max(answer["after"].values()) < 1e-5


FRAMES = [0, 2.5, 5.5, 11, 17]
"""Times within three blocks, and between two of them."""


def assert_colored(answer, *, is_on_gpu=True, n_missing=1, most=5):
    """Colors at the centers of triangles match up to half a pixel and 8 bits."""
    assert answer["isOnGpu"] == is_on_gpu
    assert answer["errors"] == []
    for result in answer["found"]:
        assert result["n"] > 300
        assert result["off"] < most
        assert result["nMissing"] >= n_missing
        assert result["areGray"]
        assert result["nGray"] <= 2
    assert answer["unit"] == "Pa"
    assert answer["bare"] == [0x30, 0x50, 0x70]
    assert not answer["hasMap"]
    assert answer["nBare"] == answer["nVertices"] == 24 * 16


@pytest.mark.parametrize("gpu", [True, False])
def test_colors_match_a_track_of_vertices(ask, gpu):
    answer = ask("colors", "scalar", FRAMES, {}, {"gpu": gpu})
    assert_colored(answer, is_on_gpu=gpu, n_missing=6)
    low, high = answer["range"]
    assert low == -high < 0
    assert answer["component"] == 0
    assert answer["nSplit"] == 24 * 16


@pytest.mark.parametrize("gpu", [True, False])
@pytest.mark.parametrize("name", ["faces", "corners"])
@pytest.mark.parametrize("has_quads", [False, True])
def test_colors_match_a_track_of_faces(ask, name, has_quads, gpu):
    options = {"component": 0, "range": [-1.5, 2]}
    answer = ask("colors", name, FRAMES, options, {"gpu": gpu}, {"hasQuads": has_quads})
    assert_colored(answer, is_on_gpu=gpu)
    assert answer["range"] == [-1.5, 2]
    n_quads = 23 * 15
    of_quads = 4 * n_quads if has_quads else 6 * n_quads
    assert answer["nSplit"] == of_quads


@pytest.mark.parametrize("gpu", [True, False])
def test_colors_match_magnitude_or_component_of_vectors(ask, gpu):
    answer = ask("colors", "vector", FRAMES, {}, {"gpu": gpu})
    assert answer["component"] == "magnitude"
    assert answer["range"][0] >= 0
    assert_colored(answer, is_on_gpu=gpu, n_missing=6)
    answer = ask("colors", "vector", FRAMES, {"component": 2}, {"gpu": gpu})
    assert answer["component"] == 2
    assert_colored(answer, is_on_gpu=gpu, n_missing=6)


def test_colors_match_for_offset_and_out_of_range_values(ask):
    assert_colored(ask("colors", "high", FRAMES, {}), n_missing=6, most=7)
    options = {"range": [-0.2, 0.1], "map": ["#000000", "#ff0000", "#ffffff"]}
    answer = ask("colors", "scalar", [0, 11], options)
    assert answer["range"] == [-0.2, 0.1]
    assert all(found["nGray"] <= 2 for found in answer["found"])


def test_colors_are_restored_after_a_lost_context(ask):
    assert_colored(ask("colors", "scalar", FRAMES, {}, {}, {}, True), n_missing=6)
    assert_colored(ask("colors", "faces", FRAMES, {}, {}, {}, True))


def test_a_damaged_block_of_a_track_is_gray(ask):
    answer = ask("colors", "scalar", [2, 7, 12], {}, {}, {"damagedTracks": [1]})
    assert set(answer["errors"]) == {1}
    sound, damaged, behind = answer["found"]
    assert max(sound["off"], behind["off"]) < 5
    assert damaged["nGray"] == damaged["n"] - damaged["nMissing"] > 300


def test_invalid_colors_are_refused_with_the_valid_ones(ask):
    answer = ask(
        "refusedColors",
        [
            ["many", {}],
            ["many", {"component": "magnitude"}],
            ["vector", {"component": 3}],
            ["scalar", {"range": [1, 1]}],
            ["scalar", {"map": "rainbow"}],
            ["scalar", {"map": ["#fff"]}],
        ],
    )
    many, length, column, span, name, short = answer["words"]
    assert "has 5 columns: component must be one of 0 to 4; got" in many
    assert "must be one of 0 to 4; got" in length
    assert 'must be one of 0 to 2, "x", "y", "z", "magnitude"; got 3' in column
    assert "range must be two finite numbers, low < high, or a string LOW:HIGH" in span
    assert span.endswith("got 1,1")
    assert 'map must be "sequential", "diverging" or a list' in name
    assert "two or more colors" in short
    assert answer["last"] == ["AbortError", "high"]
    assert "none has a map" in answer["other"]


def test_any_renderer_plays_the_mesh(ask):
    answer = ask("events", [])
    types = [event["type"] for event in answer["events"]]
    assert answer["early"] == {"isOnGpu": False, "isWaiting": True, "hits": 0}
    assert answer["hits"] == 1
    assert answer["last"] == 17
    assert answer["isClosed"]
    assert types[:2] == ["playing", "frame"]
    assert types[-1] == "ended"
    assert "error" not in types


def test_bounds_hold_all_frames(ask):
    answer = ask("bounds")
    assert answer["isInside"]
    assert answer["off"] < 1e-5
    assert answer["duration"] == pytest.approx(1.8)
