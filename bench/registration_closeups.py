"""Close-ups of a registered capture: face, hand and cloth, raw and decoded.

    python bench/registration_closeups.py samba.npz

Registers 24 finely remeshed frames of samba (see bench/registration.py), codes them as `meshreel
register` does, and writes docs/images/registration-closeups.webp: a row per part of the body in the
last frame, the farthest from the key. The last column shows a key with all vertices, coded without
sliding vertices at quality 80. Prints what bench/registration.py prints. Needs Matplotlib.
"""

import argparse
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

import matplotlib.pyplot as plt
import numpy as np

import meshreel
from measuring import start_table
from meshreel import MeshFrame, MeshSequence
from meshreel.codec.error_bounds import bound_of
from meshreel.registration import growing
from meshreel.registration.register import register
from meshreel.rendering.camera import fit_camera
from meshreel.rendering.painting import Image
from meshreel.rendering.rasterizer import render
from registration import HEADER, as_segments, chosen, errors, frames_of, remeshed

ROOT = Path(__file__).parents[1]
N_FRAMES = 24
EDGES = 0.48, 0.52
"""Edges of raw frames, in mean edges of samba: 31,000 vertices, as many as captures have."""

QUALITIES = 60, 70, 80, 90
VIEW_PX = 300
WHITE = 255, 255, 255


@dataclass(frozen=True)
class CloseUp:
    """A part of the body, seen from one side."""

    name: str
    center: tuple[float, float, float]
    """In shares of the box of the frame."""
    radius: float
    """Of the part in the picture, in longest sides of the box."""
    azimuth_deg: float

    def draw(self, frame: MeshFrame, raw: MeshFrame) -> Image:
        """Draw a frame as seen by the camera for the raw frame."""
        low, high = raw.vertices.min(axis=0), raw.vertices.max(axis=0)
        center = low + np.array(self.center) * (high - low)
        corners = np.indices((2, 2, 2)).reshape(3, -1).T * 2 - 1
        box = center + self.radius * float((high - low).max()) * corners / np.sqrt(3)
        camera = fit_camera(
            box,
            azimuth_deg=self.azimuth_deg,
            elevation_deg=5,
            width=VIEW_PX,
            height=VIEW_PX,
            margin=0,
        )
        return render(frame.vertices, frame.faces, camera, background=WHITE, supersample=4)


CLOSE_UPS = (
    CloseUp("face", (0.45, 0.92, 0.5), 0.1, 45.0),
    CloseUp("hand", (0.9, 0.56, 0.04), 0.055, 10.0),
    CloseUp("cloth", (0.3, 0.4, 0.5), 0.17, 50.0),
)


def main() -> None:
    """Measure the columns, and draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("source", help="samba.npz")
    parser.add_argument("--out", type=Path, default=ROOT / "docs/images/registration-closeups.webp")
    arguments = parser.parse_args()
    raw = as_segments(remeshed(frames_of(arguments.source, slice(N_FRAMES)), EDGES))
    tolerance, measured = bound_of("0.2%"), range(0, N_FRAMES, 6)
    print_row, columns = start_table(*HEADER), {"raw frame": raw[-1]}

    def add(name: str, registered: MeshSequence, quality: int, tune: str) -> None:
        data = meshreel.encode(registered, quality=quality, order="drop", tune=tune)
        decoded, kilobits = meshreel.decode(data), len(data) * 8e-3 / N_FRAMES
        measures = errors(chosen(raw, measured), chosen(decoded, measured), raw.extent)
        rates = f"{kilobits:.2f}", f"{kilobits * 0.03:.3f}"
        print_row(name, *rates, *(f"{measure:.2f}" for measure in measures))
        columns[f"{name}\n{kilobits:.1f} kbit, {measures[0]:.1f} dB"] = decoded[-1]

    for quality in QUALITIES:
        registered = register(raw, tolerance, quality=quality).sequence
        add(f"quality {quality}", registered, quality, "surface")
    with patch.object(growing, "decimated_key", lambda whole, *_: whole):
        add("all vertices, quality 80", register(raw, tolerance).sequence, 80, "visual")

    plt.switch_backend("agg")
    size_in = VIEW_PX / 100
    figure, panels = plt.subplots(
        len(CLOSE_UPS), len(columns),
        figsize=(size_in * len(columns), size_in * len(CLOSE_UPS) + 0.6), dpi=100,
    )  # fmt: skip
    for row, close_up in zip(panels, CLOSE_UPS, strict=True):
        for panel, frame in zip(row, columns.values(), strict=True):
            panel.imshow(close_up.draw(frame, raw[-1]))
            panel.axis("off")
    for panel, name in zip(panels[0], columns, strict=True):
        panel.set_title(name, fontsize=13)
    figure.subplots_adjust(0, 0, 1, 0.94, wspace=0, hspace=0)
    figure.savefig(arguments.out, pil_kwargs={"quality": 90})


if __name__ == "__main__":
    main()
