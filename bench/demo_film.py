"""The film at the top of README: the demo's flag, original and decoded, split by a moving line.

    python bench/demo_film.py

Simulates and encodes the flag, draws both meshes, and writes docs/images/demo.webp. The labels
count the bytes of float32 positions up to the frame shown, and the bytes of the .reel file.
"""

import math
from pathlib import Path

from PIL import Image, ImageDraw

import meshreel
from meshreel.rendering.lettering import FAINT_INK, INK, font_of_size
from meshreel.rendering.scenes import ChosenFrames, Scene
from meshreel.rendering.shots import ASPECT_FRAMES, draw_shots, framing_of, spread_frames
from meshreel.rendering.views import View

OUTPUT = Path(__file__).parents[1] / "docs" / "images" / "demo.webp"
WIDTH, HEIGHT, FOOT = 640, 400, 64
N_FRAMES, STRIDE = 150, 2
WIPE_CENTER, WIPE_SWING = 0.44, 0.2
"""Position of the dividing line and its amplitude, as fractions of the width."""


def kilobytes(n_bytes: int) -> str:
    """Bytes as text, such as "1,234 kB"."""
    return f"{n_bytes / 1000:,.0f} kB"


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
    right = WIDTH - 20
    canvas.text((20, HEIGHT + 4), "original, float32", font=title, fill=FAINT_INK)
    canvas.text((20, HEIGHT + 28), kilobytes(raw_bytes), font=numbers, fill=INK)
    canvas.text((right, HEIGHT + 4), "decoded from .reel", font=title, fill=FAINT_INK, anchor="ra")
    canvas.text((right, HEIGHT + 28), kilobytes(reel_bytes), font=numbers, fill=INK, anchor="ra")


def main() -> None:
    """Draw the film and write it."""
    sequence = meshreel.simulate_flag(N_FRAMES)
    data = meshreel.encode(sequence)
    scene = Scene(meshreel.decode(data), sequence)
    numbers = range(0, N_FRAMES, STRIDE)
    sample = ChosenFrames(sequence, spread_frames(numbers, ASPECT_FRAMES))
    framing = framing_of(View(), sample, is_followed=False)
    cameras = framing.cameras(ChosenFrames(sequence, numbers), WIDTH, HEIGHT)
    pictures = []
    shots = list(zip(numbers, cameras, strict=True))
    for step, views in enumerate(draw_shots(scene, shots)):
        phase = math.sin(2 * math.pi * step / len(shots))
        wipe = round(WIDTH * (WIPE_CENTER + WIPE_SWING * phase))
        original, decoded = (Image.fromarray(view) for view in views)
        picture = compose(original, decoded, wipe)
        frame_bytes = 12 * sequence.n_verts
        draw_labels(picture, frame_bytes * (numbers[step] + STRIDE), len(data))
        pictures.append(picture)
    duration_ms = round(1000 * STRIDE / sequence.fps)
    first, *others = pictures
    first.save(
        OUTPUT,
        save_all=True,
        append_images=others,
        duration=duration_ms,
        loop=0,
        quality=88,
        method=6,
    )
    print(f"{OUTPUT}: {len(pictures)} pictures, {OUTPUT.stat().st_size} bytes")


if __name__ == "__main__":
    main()
