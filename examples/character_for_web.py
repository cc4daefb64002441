"""Turn the cache of an animated character into a small file and the pages that play it.

    python examples/character_for_web.py --out site/
    python examples/character_for_web.py walk.abc --size 200kB --out site/

Reads Alembic, USD, glTF and other caches (`meshreel formats` lists them and their extras). Without
one, it makes a swimming fish with colors and saves it as `fish.glb`.
"""

import argparse
import subprocess
import sys
from pathlib import Path

import numpy as np

import meshreel

PAGE = """<!doctype html>
<meta charset="utf-8" />
<meta name="viewport" content="width=device-width" />
<title>{name}</title>
<style>
  reel-player:not(:defined) {{ display: block; aspect-ratio: 16 / 9; }}
</style>
<!-- Put the files in dist/ of the npm package meshreel next to this page. -->
<script type="module" src="player.js"></script>
<reel-player src="{name}.reel" alt="{name}" autoplay loop camera-controls controls></reel-player>
"""


def fish(n_frames: int = 48) -> meshreel.MeshSequence:
    """Return two strokes of a fish 1 m long; y is up, it swims along x. Deterministic."""
    n_along, n_around = 96, 48
    u, v = np.meshgrid(np.linspace(0, 1, n_along), np.arange(n_around) / n_around)
    body = np.sin(np.pi * np.minimum(1, u / 0.95) ** 0.6) ** 0.8
    fin = 0.12 * np.exp(-(((v - 0.25) / 0.05) ** 2) - ((u - 0.45) / 0.13) ** 2)
    tail = 0.18 * np.clip((u - 0.78) / 0.22, 0, 1) ** 1.5
    height = (0.14 * body + tail + 0.012) * np.sin(2 * np.pi * v) + fin
    width = (0.08 * body + 0.006) * np.cos(2 * np.pi * v)
    phase = np.arange(n_frames)[:, None, None] * 2 / n_frames - 0.8 * u
    sway = (0.01 + 0.1 * u**2) * np.sin(2 * np.pi * phase)
    still = np.broadcast_to([[0.5 - u], [height]], (2, n_frames, *u.shape))
    vertices = np.stack([*still, width + sway], axis=-1).reshape(n_frames, -1, 3)

    a = np.arange(n_around)[:, None] * n_along + np.arange(n_along - 1)
    b = (a + n_along) % (n_around * n_along)
    sides = np.stack([a, b, a + 1, b, b + 1, a + 1], axis=-1).reshape(-1, 3)
    ring = np.arange(1, n_around - 1) * n_along
    mouth = np.stack([0 * ring, ring + n_along, ring], axis=-1)
    faces = np.concatenate([sides, mouth, mouth[:, ::-1] + n_along - 1]).astype(np.int32)

    is_white = 0.5 + 0.5 * np.tanh(4 * np.sin(20 * u + np.cos(2 * np.pi * v)) - 2)
    colors = np.array([0.9, 0.35, 0.05]) + np.multiply.outer(is_white, [0.05, 0.6, 0.85])
    color = meshreel.Attribute(
        "color", meshreel.Kind.COLOR, meshreel.Domain.VERTEX,
        colors.reshape(-1, 3).astype(np.float32),
    )  # fmt: skip
    surface = meshreel.Surface(attributes=(color,))
    return meshreel.MeshSequence(vertices.astype(np.float32), faces, 24.0, "fish", surface=surface)


def main() -> None:
    """Compress the cache, and write the pages."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cache", nargs="?", type=Path, help="an .abc, .usd, .glb or other file")
    parser.add_argument("--size", help="such as 200kB; default: quality 80")
    parser.add_argument("--out", type=Path, required=True, help="a folder")
    arguments = parser.parse_args()
    site, cache = arguments.out, arguments.cache
    site.mkdir(parents=True, exist_ok=True)
    if cache is None:
        cache = site / "fish.glb"
        meshreel.save(fish(), cache, overwrite=True)
    notes: list[str] = []
    character = meshreel.load(cache, merge=True, notes=notes)
    print(character, *notes, sep="\n")

    data = meshreel.encode(character, size=arguments.size)
    reel = site / f"{cache.stem}.reel"
    reel.write_bytes(data)
    print(f"{cache.stat().st_size / 1e3:.0f} kB became {len(data) / 1e3:.1f} kB")
    print(meshreel.compare(character, data))

    # One HTML file with the player: to mail, and to look at.
    page = site / f"{cache.stem}.html"
    subprocess.run([sys.executable, "-m", "meshreel", "export", reel, "-o", page, "-f"], check=True)
    (site / "index.html").write_text(PAGE.format(name=cache.stem), encoding="utf-8")
    print(f"index.html shows {reel.name} with <reel-player>, whose scripts are in the npm package")


if __name__ == "__main__":
    main()
