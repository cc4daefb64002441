"""Archive the result of a solver, with a guaranteed error of each quantity.

    python examples/archive_simulation.py --out plate.reel
    python examples/archive_simulation.py run.vtkhdf --max-error 0.1mm --unit m --track stress=500Pa

Without a file, it simulates a hot tool that circles over a metal plate, which swells where it is
warm: vertices have a temperature, triangles a heat flow and a phase that is stored exactly.
"""

import argparse
from pathlib import Path

import numpy as np
import numpy.typing as npt

import meshreel

Floats = npt.NDArray[np.float64]

FPS, SIDE_M, SPACING_M, SWELLING_M_PER_K = 25.0, 0.2, 0.0025, 3e-5
DIFFUSIVITY_M2_PER_S, COOLING_PER_S = 1.2e-4, 0.3
HEATING_K_PER_S, TOOL_M, ORBIT_M, TURN_S = 4000.0, 0.008, 0.055, 3.0
ROOM_K, MELTING_K = 293.0, 500.0
BOUNDS = ["temperature=0.5K", "heat flow=0.1%", "phase=exact"]


def frame_of(kelvin: Floats, x: Floats, z: Floats, faces: npt.NDArray[np.int32]) -> list[Floats]:
    """Return positions (V, 3), temperature (V,), heat flow (M, 3) and phase (M,) of a moment."""
    along_x, along_z = np.gradient(-DIFFUSIVITY_M2_PER_S * kelvin, SPACING_M)
    flow = np.stack([along_x, 0 * x, along_z], axis=-1).reshape(-1, 3)[faces].mean(axis=1)
    positions = np.stack([x, SWELLING_M_PER_K * (kelvin - ROOM_K), z], axis=-1).reshape(-1, 3)
    is_liquid = kelvin.ravel()[faces].mean(axis=1) > MELTING_K
    return [positions, kelvin.ravel(), flow, is_liquid]


def simulate(n_frames: int) -> meshreel.MeshSequence:
    """Return the plate in meters, y up, with its tracks. Deterministic."""
    x, z = np.meshgrid(*2 * [np.arange(0, SIDE_M, SPACING_M) - SIDE_M / 2], indexing="ij")
    corner = np.arange(x.size).reshape(x.shape)
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    faces = np.stack([a, c, b, a, d, c], axis=-1).reshape(-1, 3).astype(np.int32)
    kelvin, frames, n_steps = np.full(x.shape, ROOM_K), [], 5
    for step in range(n_frames * n_steps):
        if step % n_steps == 0:
            frames.append(frame_of(kelvin, x, z, faces))
        angle = 2 * np.pi * step / n_steps / FPS / TURN_S
        squared = (x - ORBIT_M * np.cos(angle)) ** 2 + (z - ORBIT_M * np.sin(angle)) ** 2
        around = np.pad(kelvin, 1, "edge")  # no heat leaves at the edges
        total = around[2:, 1:-1] + around[:-2, 1:-1] + around[1:-1, 2:] + around[1:-1, :-2]
        change = DIFFUSIVITY_M2_PER_S * (total - 4 * kelvin) / SPACING_M**2
        change += HEATING_K_PER_S * np.exp(-squared / TOOL_M**2) - COOLING_PER_S * (kelvin - ROOM_K)
        kelvin = kelvin + change / n_steps / FPS
    positions, temperature, flow, phase = map(np.array, zip(*frames, strict=True))
    tracks = {
        "temperature": meshreel.Track(temperature.astype(np.float32), unit="K"),
        "heat flow": meshreel.Track(flow.astype(np.float32), "face", unit="K m/s"),
        "phase": meshreel.Track(phase, "face"),
    }
    return meshreel.MeshSequence(positions.astype(np.float32), faces, FPS, "plate", tracks=tracks)


def main() -> None:
    """Encode within the bounds, and print the bytes and the errors of each track."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("result", nargs="?", help="a .vtkhdf, .pvd, .xdmf, .h5 or other file")
    parser.add_argument("--track", action="append", metavar="NAME=BOUND", help="repeatable")
    parser.add_argument("--max-error", default="0.01%", help="of positions")
    parser.add_argument("--unit", help="of positions, if their bound is a length")
    parser.add_argument("--out", type=Path, required=True, help="a .reel to write")
    arguments = parser.parse_args()
    result = meshreel.load(arguments.result) if arguments.result else simulate(75)
    given = arguments.track or ([] if arguments.result else BOUNDS)
    bounds = dict(item.rsplit("=", 1) for item in given)
    data = meshreel.encode(
        result, max_error=arguments.max_error, unit=arguments.unit, tracks=bounds
    )
    arguments.out.write_bytes(data)

    errors = meshreel.compare(result, data)
    print(f"{result}: {result.raw_size_bytes / 1e6:.1f} MB became {len(data) / 1e3:.1f} kB")
    print(f"positions: largest error {errors.max_error_percent:.2g} % of the diagonal")
    for track in meshreel.info(data).tracks:
        print(f"{track}: {track.raw_size_bytes / track.size_bytes:.0f} x smaller")
        print(f"    {errors.tracks[track.name]}")


if __name__ == "__main__":
    main()
