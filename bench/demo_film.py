"""The film at the top of README: a character, original and decoded, split by a moving line.

    (cd npm && npm ci && npm run build)
    python bench/demo_film.py

Downloads the "Knight" of KayKit Adventurers by Kay Lousberg (CC0), or reads a copy given as the
argument; encodes one of its animations at the defaults, and losslessly as the original; draws
both with the player in Chromium; and writes docs/images/demo.webp. The sizes include texture
coordinates and the image.
"""

import argparse
import hashlib
import io
import json
import math
import shutil
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import urlsplit

from PIL import Image, ImageDraw
from playwright.sync_api import Page, Route, sync_playwright

import meshreel
from meshreel.rendering.lettering import INK, font_of_size

FAINT_INK = (92, 99, 112)
REPOSITORY = "KayKit-Game-Assets/KayKit-Character-Pack-Adventures-1.0"
COMMIT = "672074b73ba276876a19e8816ecdc5241817ab47"
MODEL = "addons/kaykit_character_pack_adventures/Characters/gltf/Knight.glb"
SHA256 = "60428e3abc09ba83e595d256e3af8c5c976b46cdae599f0802fc82b4a3445168"

ANIMATION = "2H_Melee_Attack_Spin"
UNUSED = {"1H_Sword", "1H_Sword_Offhand"} | {
    f"{shape}_Shield" for shape in ("Badge", "Rectangle", "Round", "Spike")
}
"""Nodes of the weapons that this animation does not use: the file shows all at once."""

ROOT = Path(__file__).parents[1]
DIST = ROOT / "npm" / "dist"
OUTPUT = ROOT / "docs" / "images" / "demo.webp"
WIDTH, HEIGHT, FOOT = 640, 400, 64
WIPE_SWING = 0.2
"""Amplitude of the dividing line, as a fraction of the width."""

PAGE = """<!doctype html><link rel=icon href="data:,"><style>
body {{ margin: 0 }} reel-player {{ width: {width}px; height: {height}px; background: white }}
</style>{players}<script type=module src=/player.js></script><script type=module>
const players = [...document.querySelectorAll("reel-player")];
const ready = (player) => new Promise((resolve) => player.addEventListener("load", resolve));
await Promise.all(players.map(ready));
const isDrawn = ({{ mesh }}, frame) => mesh.material.map && !mesh.isWaiting && mesh.frame === frame;
const drawn = () => new Promise((resolve) => requestAnimationFrame(() => setTimeout(resolve)));
window.bench = {{
  async show(frame) {{
    for (const player of players) player.seek({{ frame }});
    do await drawn(); while (!players.every((player) => isDrawn(player, frame)));
    await drawn();
  }},
}};
</script>"""
PLAYER = '<reel-player src="/{name}.reel" camera-orbit="25deg 75deg auto"></reel-player>'


def model_bytes(path: Path | None) -> bytes:
    """Return the character as glTF, from a copy or the network."""
    url = f"https://raw.githubusercontent.com/{REPOSITORY}/{COMMIT}/{MODEL}"
    if path is not None:
        data = path.read_bytes()
    else:
        with urllib.request.urlopen(url) as answer:
            data = answer.read()
    if hashlib.sha256(data).hexdigest() != SHA256:
        raise SystemExit(f"{path or url} is not the file that this film shows")
    return data


def without_unused_nodes(data: bytes) -> bytes:
    """Remove the meshes of unused nodes from binary glTF."""
    length = int.from_bytes(data[12:16], "little")
    scene = json.loads(data[20 : 20 + length])
    for node in scene["nodes"]:
        if node["name"] in UNUSED:
            del node["mesh"]
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    rest = text + data[20 + length :]
    sizes = [n.to_bytes(4, "little") for n in (20 + len(rest), len(text))]
    return data[:8] + sizes[0] + sizes[1] + data[16:20] + rest


def load_knight(path: Path | None) -> meshreel.MeshSequence:
    """Load the animation of the film."""
    with TemporaryDirectory() as folder:
        copy = Path(folder) / "knight.glb"
        copy.write_bytes(without_unused_nodes(model_bytes(path)))
        return meshreel.load(copy, animation=ANIMATION, merge=True)


@contextmanager
def opened(files: dict[str, bytes]) -> Iterator[Page]:
    """Open the page in Chromium, which draws by software; the files answer all requests."""

    def answer(route: Route) -> None:
        name = urlsplit(route.request.url).path
        kind = {".js": "text/javascript", ".html": "text/html"}.get(Path(name).suffix, "")
        route.fulfill(body=files[name], content_type=kind or "application/octet-stream")

    with sync_playwright() as driver:
        browser = driver.chromium.launch(
            executable_path=shutil.which("chromium"),
            args=["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
        )
        page = browser.new_page(viewport={"width": WIDTH, "height": 2 * HEIGHT})
        page.route("**", answer)
        page.goto("http://localhost/index.html")
        page.wait_for_function("window.bench", timeout=10_000)
        yield page
        browser.close()


def draw(page: Page, frame: int) -> list[Image.Image]:
    """Draw a frame in all players."""
    page.evaluate("frame => bench.show(frame)", frame)
    players = page.locator("reel-player").all()
    return [Image.open(io.BytesIO(player.screenshot())).convert("RGB") for player in players]


def compose(original: Image.Image, decoded: Image.Image, wipe: int) -> Image.Image:
    """Combine the original to the left of a vertical line and the decoded mesh to the right."""
    picture = Image.new("RGB", (WIDTH, HEIGHT + FOOT), "white")
    picture.paste(decoded, (0, 0))
    picture.paste(original.crop((0, 0, wipe, HEIGHT)), (0, 0))
    ImageDraw.Draw(picture).line([(wipe, 0), (wipe, HEIGHT)], fill=INK, width=2)
    return picture


def draw_labels(picture: Image.Image, raw_bytes: int, reel_bytes: int) -> None:
    """Write the name and size of each side below the meshes."""
    canvas = ImageDraw.Draw(picture)
    title, numbers = font_of_size(17), font_of_size(24)
    middle, right = WIDTH / 2, WIDTH - 20
    ratio = f"{raw_bytes / reel_bytes:.1f} x smaller"
    canvas.text((20, HEIGHT + 4), "original, raw values", font=title, fill=FAINT_INK)
    canvas.text((20, HEIGHT + 28), f"{raw_bytes / 1000:,.0f} kB", font=numbers, fill=INK)
    canvas.text((middle, HEIGHT + 28), ratio, font=numbers, fill=INK, anchor="ma")
    canvas.text((right, HEIGHT + 4), "decoded from .reel", font=title, fill=FAINT_INK, anchor="ra")
    reel = f"{reel_bytes / 1000:,.1f} kB"
    canvas.text((right, HEIGHT + 28), reel, font=numbers, fill=INK, anchor="ra")


def main() -> None:
    """Draw the film and write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("model", nargs="?", type=Path, help="a copy of the character (.glb)")
    knight = load_knight(parser.parse_args().model)
    streams = {
        "original": meshreel.encode(knight, lossless=True),
        "decoded": meshreel.encode(knight),
    }
    info = meshreel.info(streams["decoded"])
    page = PAGE.format(
        width=WIDTH, height=HEIGHT, players="".join(PLAYER.format(name=name) for name in streams)
    )
    scripts = ("player.js", "reel.wasm", "reel_full.wasm")
    files = {"/index.html": page.encode()}
    files |= {f"/{name}": (DIST / name).read_bytes() for name in scripts}
    files |= {f"/{name}.reel": data for name, data in streams.items()}
    n_frames = knight.n_frames - 1  # the last repeats the first
    pictures = []
    with opened(files) as browser:
        for frame in range(n_frames):
            phase = math.sin(2 * math.pi * frame / n_frames)
            original, decoded = draw(browser, frame)
            picture = compose(original, decoded, round(WIDTH * (0.5 + WIPE_SWING * phase)))
            draw_labels(picture, info.raw_size_bytes, len(streams["decoded"]))
            pictures.append(picture)
    first, *others = pictures
    first.save(
        OUTPUT,
        save_all=True,
        append_images=others,
        duration=round(1000 / knight.fps),
        loop=0,
        quality=80,
        method=6,
    )
    print(f"{OUTPUT}: {len(pictures)} pictures, {OUTPUT.stat().st_size} bytes")


if __name__ == "__main__":
    main()
