"""Images and videos on a mesh, which shows the frame of the current picture."""

import io
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import meshreel
from samples.firefox import message_of
from samples.numbered_video import moving_sheet, numbered_video
from samples.web_package import THREE_PAGE, serving, three_files

PAGE = f'{THREE_PAGE}<script type="module" src="/page.js"></script>'
SCRIPT = Path(__file__).parent / "textured_sheet.js"

STEPS = """
  const frames = [];
  await stand.shown();
  for (const frame of [40, 7, 89, 0, 61, 62, 63, 15, 14]) {
    stand.mesh.seek({ frame });
    const { mesh, video } = await stand.shown();
    frames.push([frame, Math.round(mesh), video]);
  }
  stand.mesh.video.muted = true;
  stand.mesh.seek({ frame: 80 }); // near the end of the first loop: videos play in real time
  stand.mesh.play();
  const loops = () => stand.events.filter(({ type }) => type === "loop").length;
  await stand.until("two loops", () => loops() === 2);
  stand.mesh.seek({ frame: 70 });
  await stand.until("playing on", () => stand.mesh.frame > 72);
  const { wrong, seen, events } = stand;
  const bad = events.filter(({ type }) => type === "error" || type === "warning");
  const n = new Set(seen.map(({ video }) => video)).size;
  stand.dispose();
  return { frames, wrong, n, bad };
"""
"""Script that seeks, plays, loops, and seeks during playback."""


@pytest.fixture(scope="module")
def films(tmp_path_factory):
    folder = tmp_path_factory.mktemp("films")
    made = {
        "same": numbered_video(folder / "same.webm"),
        "short": numbered_video(folder / "short.webm", 45),
        "long": numbered_video(folder / "long.webm", 120),
    }
    return {f"/{name}.webm": data for name, data in made.items()}


@pytest.fixture(scope="module")
def files(films):
    sheet, plain = moving_sheet(), moving_sheet(has_uv=False)
    return {
        **three_files(PAGE),
        "/page.js": SCRIPT.read_bytes(),
        "/sheet.reel": meshreel.encode(sheet, max_error=0.01, effort=5, block_frames=15),
        "/plain.reel": meshreel.encode(plain, max_error=0.01, effort=5),
        "/flag.png": two_colors(),
        **films,
    }


@pytest.fixture(scope="module")
def site(files):
    with serving(files) as (url, _):
        yield url


@pytest.fixture
def ask(new_page, site):
    """Return the result of a script that receives a test scene: a file with a texture."""

    def answer(setting, body, **given):
        page = new_page(f"{site}/index.html", is_shown=False, **given)
        page.wait_for_function("!!window.made")
        return page.evaluate(f"async () => {{ const stand = await made({setting});\n{body} }}")

    return answer


def two_colors():
    """Return an orange image whose upper quarter is blue."""
    pixels = np.full((64, 64, 3), (200, 100, 50), np.uint8)
    pixels[:16] = (20, 40, 180)
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "png")
    return file.getvalue()


def assert_in_step(found):
    assert [[frame] * 3 for frame, _, _ in found["frames"]] == found["frames"]
    assert found["wrong"] == []
    assert found["bad"] == []
    assert found["n"] > 9


@pytest.mark.slow
def test_the_mesh_matches_each_video_frame_while_playing_seeking_and_looping(ask):
    assert_in_step(ask('{ texture: "/same.webm" }', STEPS))


@pytest.mark.slow
def test_the_mesh_follows_a_video_without_frame_callbacks(ask):
    script = "delete HTMLVideoElement.prototype.requestVideoFrameCallback"
    result = ask('{ texture: "/same.webm" }', STEPS, script=script)
    # The time of a video may already be that of another picture, so this test only shows that
    # the mesh follows.
    assert all(abs(mesh - video) <= 1 for _, mesh, video in result["frames"])
    assert result["bad"] == []
    assert result["n"] > 9


@pytest.mark.slow
def test_mesh_follows_the_video_in_firefox(files):
    script = f"""
      const text = (error) => error.name + ": " + error.message;
      while (!window.made) await new Promise((resolve) => setTimeout(resolve, 10));
      (async () => {{
        const stand = await made({{ texture: "/same.webm", isDrawn: false }});
        {STEPS}
      }})().then((found) => found, (error) => ({{ error: text(error) }}))
        .then((found) => fetch("/", {{ method: "POST", body: JSON.stringify(found) }}));
    """
    page = f"{PAGE}<script type=module>{script}</script>".encode()
    result = message_of({**files, "/all.html": page}, "/all.html", is_headless=True)
    assert "error" not in result, result
    assert [[frame] * 3 for frame, _, _ in result["frames"]] == result["frames"]
    assert result["bad"] == []
    # A busy Firefox reports times of other pictures than it draws: "wrong" may have some.
    assert result["n"] > 9


@pytest.mark.slow
def test_video_controls_drive_the_mesh(ask):
    result = ask(
        '{ texture: "/same.webm" }',
        """
          const { mesh } = stand;
          const { video } = mesh;
          video.muted = true;
          await stand.shown();
          video.play();
          await stand.until("the mesh plays", () => mesh.isPlaying && mesh.frame > 2);
          video.playbackRate = 0.5;
          await stand.until("the speed of the video", () => mesh.speed === 0.5);
          video.pause();
          await stand.until("the mesh stands", () => !mesh.isPlaying);
          video.currentTime = 2.01;
          await stand.until("frame 60", () => mesh.frame === 60 && !mesh.isWaiting);
          const last = await stand.shown();
          mesh.speed = 2;
          return { last, rate: video.playbackRate, wrong: stand.wrong };
        """,
    )
    assert result["last"]["video"] == 60
    assert result["rate"] == 2
    assert result["wrong"] == []


@pytest.mark.slow
def test_the_video_waits_for_missing_blocks(ask):
    result = ask(
        '{ texture: "/same.webm" }',
        """
          const { mesh } = stand;
          const { video, reel } = mesh;
          video.muted = true;
          await stand.shown();
          let release;
          const gate = new Promise((resolve) => (release = resolve));
          const fields = reel.fields.bind(reel);
          reel.fields = async (block, options) => {
            if (block === 3) await gate;
            return fields(block, options);
          };
          mesh.play();
          await stand.until("waiting", () => mesh.isWaiting && mesh.frame >= 45);
          await stand.until("a video that stands", () => video.paused);
          const time = video.currentTime;
          await new Promise((resolve) => setTimeout(resolve, 300));
          const waiting = { ...stand.seen.at(-1), isPlaying: mesh.isPlaying };
          const isStill = video.currentTime === time;
          release();
          await stand.until("playing on", () => mesh.frame >= 60);
          return { waiting, isStill, wrong: stand.wrong, isPlaying: !video.paused };
        """,
    )
    assert result["waiting"]["isPlaying"]
    assert result["waiting"]["video"] < 45
    assert result["isStill"]
    assert result["wrong"] == []
    assert result["isPlaying"]


@pytest.mark.slow
def test_the_video_frame_stays_with_its_mesh_at_damaged_blocks(ask):
    result = ask(
        '{ texture: "/same.webm" }',
        """
          const { mesh } = stand;
          const { video, reel } = mesh;
          video.muted = true;
          await stand.shown();
          const fields = reel.fields.bind(reel);
          reel.fields = async (block, options) => {
            if (block !== 3) return fields(block, options);
            throw Object.assign(new Error("damaged"), { name: "CorruptStreamError" });
          };
          mesh.play();
          await stand.until("the block after", () => stand.seen.some(({ video }) => video >= 62));
          return { frames: stand.seen.map(({ video }) => video), wrong: stand.wrong };
        """,
    )
    assert not {*range(45, 60)} & {*result["frames"]}
    assert result["wrong"] == []


@pytest.mark.slow
@pytest.mark.parametrize(("film", "last"), [("short", 44), ("long", 89)])
def test_playback_covers_the_common_duration(ask, film, last):
    result = ask(
        f'{{ texture: "/{film}.webm", loop: false }}',
        """
          const { mesh } = stand;
          mesh.video.muted = true;
          await stand.shown();
          mesh.play();
          const has = (wanted) => stand.events.some(({ type }) => type === wanted);
          await stand.until("the end", () => has("ended"));
          const { frame, duration, isPlaying } = mesh;
          mesh.play();
          await stand.until("playing again", () => mesh.frame > 3 && mesh.frame < 30);
          mesh.pause();
          mesh.seek(100);
          const end = await stand.shown();
          return { frame, duration, isPlaying, end, events: stand.events, wrong: stand.wrong };
        """,
    )
    assert (result["frame"], result["isPlaying"]) == (last, False)
    assert result["duration"] == pytest.approx((last + 1) / 30)
    assert result["end"]["video"] == last
    assert result["wrong"] == []
    warnings = [one["message"] for one in result["events"] if one["type"] == "warning"]
    assert len(warnings) == 1
    assert "are played, without the end of the" in warnings[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    "source",
    [
        '"/flag.png"',
        'Object.assign(new Image(), { src: "/flag.png" })',
        'await createImageBitmap(await (await fetch("/flag.png")).blob())',
        'await new (await import("three")).TextureLoader().loadAsync("/flag.png")',
    ],
)
def test_image_is_shown_upright_in_its_colors(ask, source):
    result = ask(
        "{}",
        f"""
          const texture = {source};
          if (texture.isTexture) texture.colorSpace = "srgb";
          await stand.until("a mesh", () => !stand.mesh.isWaiting);
          await stand.mesh.setTexture(texture);
          stand.screen.renderer.render(stand.screen.scene, stand.screen.camera);
          const gl = stand.screen.renderer.getContext();
          const colorAt = (x, y) => {{
            const color = new Uint8Array(4);
            gl.readPixels(x, y, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, color);
            return [...color.slice(0, 3)];
          }};
          const found = [colorAt(100, 270), colorAt(100, 60)];
          stand.mesh.setTexture(null);
          const colors = stand.mesh.material.color.getHex();
          return {{ found, map: stand.mesh.material.map, colors }};
        """,
    )
    wanted = [[20, 40, 180], [200, 100, 50]]
    assert np.abs(np.array(result["found"]) - wanted).max() <= 4
    assert result["map"] is None
    assert result["colors"] == 0xB4B4B4


ERRORS = {
    '"/same.webm"|reel: "/plain.reel"': "InvalidInputError: the file has no UVs",
    '"/missing.webm"': "SourceError: cannot play the video .*missing.webm: the video does not",
    '"/sheet.reel", { kind: "video" }': "SourceError: cannot play the video",
    '"/missing.png"': "SourceError: cannot load the image",
    '"/walk"': "InvalidInputError: cannot tell from /walk whether it is an image or a video",
    '"/flag.png", { offset: 1 }': "InvalidInputError: offset applies only to videos",
    '"/flag.png", { uv: "map2" }': "InvalidInputError: the file has no UV attribute map2",
    'new Image(), { kind: "image" }': "InvalidInputError: kind applies only to addresses",
    '"/same.webm"|loop: "pingpong"': "InvalidInputError: videos play only forwards",
    '"/same.webm"|speed: -1': "InvalidInputError: videos play only forwards",
    '"/same.webm"|speed: 1000': "InvalidInputError: this browser does not play videos at speed",
}


@pytest.mark.slow
def test_invalid_textures_are_rejected_with_a_message(ask):
    """One page tries all of them, because a dozen pages would keep drawing."""
    tried = []
    for call in ERRORS:
        given, _, setting = call.partition("|")
        tried.append(f"[{{ {setting} }}, (mesh) => mesh.setTexture({given})]")
    result = ask(
        "{}",
        f"""
          stand.dispose();
          const found = [];
          for (const [setting, setTexture] of [{", ".join(tried)}]) {{
            const stand = await made(setting);
            found.push(await setTexture(stand.mesh).then(() => "fine", String));
            stand.dispose();
          }}
          return found;
        """,
    )
    for text, words in zip(result, ERRORS.values(), strict=True):
        assert re.search(words, text), text


@pytest.mark.slow
def test_an_unreadable_cross_origin_video_is_an_error(ask, films):
    with serving(films) as (elsewhere, _):
        result = ask(
            "{}",
            f"""
              const video = document.createElement("video");
              video.src = "{elsewhere}/same.webm";
              await stand.mesh.setTexture(video);
              const error = () => stand.events.find(({{ type }}) => type === "error");
              await stand.until("an error", error);
              const own = await stand.mesh.setTexture("{elsewhere}/same.webm")
                .then(() => "fine", String);
              return [error().error, own];
            """,
        )
    assert re.match("SourceError: this page must not read the video .*same.webm", result[0])
    assert re.match("SourceError: cannot play the video .*same.webm", result[1])


@pytest.mark.slow
def test_changed_and_disposed_textures_are_released(ask):
    result = ask(
        "{}",
        """
          const { mesh, screen } = stand;
          await stand.until("a mesh", () => !mesh.isWaiting);
          const counts = [];
          const count = () => {
            screen.read();
            counts.push(screen.renderer.info.memory.textures);
          };
          count();
          const videos = [];
          for (let round = 0; round < 3; round++) {
            await mesh.setTexture("/same.webm");
            videos.push(mesh.video);
            await stand.shown();
            count();
            const aborted = mesh.setTexture("/long.webm").then(() => "fine", ({ name }) => name);
            await mesh.setTexture("/flag.png");
            videos.push(await aborted);
            count();
            mesh.setTexture(null);
            count();
          }
          const given = document.createElement("video");
          given.src = "/short.webm";
          await mesh.setTexture(given);
          stand.dispose();
          return {
            counts,
            videos: videos.map((one) => (one.getAttribute ? one.getAttribute("src") : one)),
            given: given.getAttribute("src"),
          };
        """,
    )
    counts = result["counts"][1:]  # three.js creates some initially
    assert counts == [counts[2] + 1, counts[2] + 1, counts[2]] * 3
    assert result["videos"] == [None, "AbortError"] * 3
    assert result["given"] == "/short.webm"
