"""Compress a raw capture, which has a new mesh in every frame.

    python examples/register_capture.py --out walk.reel
    python examples/register_capture.py capture/ --fps 25 --out walk.reel    # a file per frame

Without a folder, a simulated studio captures a walking figure: it measures the distance from the
body on a grid, with noise, and libigl extracts a mesh from each frame. Needs the extra [register],
and libigl.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
import numpy.typing as npt

import meshreel

try:
    import igl
except ModuleNotFoundError as error:
    sys.exit(f"this example needs libigl: pip install 'meshreel[register]' libigl ({error})")

Floats = npt.NDArray[np.float64]

FPS, STEP_S, CELL_M, NOISE_M = 25.0, 1.0, 0.03, 0.001


def bones(phase: float) -> list[tuple[Floats, Floats, float]]:
    """Return begin, end and radius of bones, in meters; y is up, the figure walks along x."""

    def at(x: float, y: float, z: float) -> Floats:
        return np.array([x, y + 0.02 * np.cos(2 * phase), z])

    hip, neck, nape, crown = at(0, 0.95, 0), at(0.04, 1.42, 0), at(0.07, 1.66, 0), at(0.08, 1.72, 0)
    found = [(hip, neck, 0.14), (neck, nape, 0.07), (nape, crown, 0.11)]
    for side in (-1, 1):
        swing, lift = side * np.sin(phase), 0.5 * (1 + side * np.cos(phase))
        shoulder, spread = at(0.04, 1.36, 0.22 * side), np.array([0, 0, side])
        found.append((neck, shoulder, 0.07))
        limbs = (  # of each bone: length, angle from straight down, radius
            (at(0, 0.92, 0.12 * side), 0.04, [0.42, 0.42, 0.15],
             [0.45 * swing, 0.45 * swing - lift, 1.5], [0.085, 0.06, 0.045]),
            (shoulder, 0.5, [0.28, 0.3], [-0.5 * swing, 0.4 - 0.5 * swing], [0.055, 0.045]),
        )  # fmt: skip
        for begin, outward, *joints in limbs:
            for length, angle, radius in zip(*joints, strict=True):
                direction = np.array([np.sin(angle), -np.cos(angle), 0]) + outward * spread
                end = begin + length * direction
                found.append((begin, end, radius))
                begin = end
    return found


def captured_frame(time_s: float, rng: np.random.Generator) -> meshreel.MeshSequence:
    """Return the mesh of one moment: the zero set of a noisy distance from the body."""
    box = ((-0.6, 0.7), (-0.1, 1.95), (-0.65, 0.65))
    axes = [np.arange(low, high, CELL_M) for low, high in box]
    z, y, x = np.meshgrid(*axes[::-1], indexing="ij")
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    nearness = np.full(len(points), 1e-300)
    for begin, end, radius in bones(2 * np.pi * time_s / STEP_S):
        along = np.clip((points - begin) @ (end - begin) / np.sum((end - begin) ** 2), 0, 1)
        distance = np.linalg.norm(points - begin - np.outer(along, end - begin), axis=1) - radius
        nearness += np.exp(-distance / 0.015)  # a smooth union of all bones
    field = rng.normal(0, NOISE_M, len(points)) - 0.015 * np.log(nearness)
    vertices, faces, _ = igl.marching_cubes(field, points, *map(len, axes), 0.0)
    return meshreel.MeshSequence(vertices[None].astype(np.float32), faces, fps=FPS)


def capture(n_frames: int) -> meshreel.MeshSequence:
    """Return the frames of the simulated studio, each with its own mesh. Deterministic."""
    rng = np.random.default_rng(0)
    return meshreel.concatenate(captured_frame(number / FPS, rng) for number in range(n_frames))


def main() -> None:
    """Register the capture, encode it, and print sizes and distances."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("capture", nargs="?", help="a folder of frames")
    parser.add_argument("--fps", type=float, default=FPS)
    parser.add_argument("--tolerance", default="0.5%", help="between registered and raw surface")
    parser.add_argument("--frames", type=int, default=25, help="of the simulated capture")
    parser.add_argument("--out", type=Path, required=True, help="a .reel to write")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as studio:
        if arguments.capture is None:
            meshreel.save(capture(arguments.frames), f"{studio}/frame_%04d.ply")
        raw = meshreel.load(arguments.capture or studio, fps=arguments.fps)
        registered = meshreel.register(raw, tolerance=arguments.tolerance)
        data = meshreel.encode(registered)
        # All frames would take longer than the registration.
        errors = meshreel.compare(raw[:1], meshreel.decode(data)[:1], surface=True)
    arguments.out.write_bytes(data)
    print(f"raw: frames {raw.n_frames}, meshes {raw.n_segments}, {raw.raw_size_bytes / 1e6:.1f} MB")
    print(f"registered: meshes {registered.n_segments}, {len(data) / 1e3:.0f} kB as a .reel file")
    print(f"first frame: {errors}")


if __name__ == "__main__":
    main()
