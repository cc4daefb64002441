"""Large meshes: seconds and peak memory of commands by number of vertices.

    python bench/large.py                           # sheets of 10,000 to 1,000,000 vertices
    python bench/large.py --vertices 1000000 --frames 200 --folder FOLDER
    python bench/large.py --subdivided jumping.npz 3      # faces cut in four, three times

A sheet is a square of sqrt(V) x sqrt(V) vertices with 60 traveling waves over static hills; every
vertex moves on circles. Wavelengths range from a third to a thirtieth of the side, and heights
decrease with their power of 1.5. The file, an uncompressed `.npz`, is generated once and stays in
the folder. Every command runs in a separate process.
"""

import argparse
import math
import sys
import tempfile
import zipfile
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt

import meshreel
from inputs import quartered
from measuring import print_table, run_process

Floats = npt.NDArray[np.float32]

N_WAVES = 60
LONGEST, SHORTEST = 1 / 3, 1 / 30
"""Wavelengths, in sides of the sheet."""

LONGEST_PERIOD_S = 2.0
HEIGHT = 0.02
"""Height of the longest wave, in sides."""

FPS = 25.0


def sheet(n_verts: int, n_frames: int, path: Path) -> None:
    """Write a sheet with this number of vertices, rounded to a square, as an `.npz`."""
    side = round(math.sqrt(n_verts))
    rng = np.random.default_rng(1)
    lengths = LONGEST * (SHORTEST / LONGEST) ** np.linspace(0, 1, N_WAVES)
    angles = rng.random(N_WAVES) * 2 * np.pi
    directions = np.stack([np.cos(angles), np.sin(angles)])
    heights = HEIGHT * (lengths / LONGEST) ** 1.5
    frequencies = np.sqrt(LONGEST / lengths) / LONGEST_PERIOD_S  # deep-water dispersion
    times = 2 * np.pi * np.outer(np.arange(n_frames) / FPS, frequencies) + rng.random(N_WAVES) * 7
    swing = np.concatenate([np.cos(times), np.sin(times)], axis=1)

    ticks = np.linspace(0, 1, side)
    flat = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 2)
    phases = 2 * np.pi * (flat @ (directions / lengths))
    cosines, sines = np.cos(phases), np.sin(phases)
    hills = 0.1 * np.sin(5 * flat[:, 0]) * np.cos(4 * flat[:, 1]) + 0.002 * np.sin(97 * flat[:, 0])
    fields = [  # factors of cos and sin of the time, and rest position, of each coordinate
        (sines * (heights * directions[0]), -cosines * (heights * directions[0]), flat[:, 0]),
        (sines * (heights * directions[1]), -cosines * (heights * directions[1]), flat[:, 1]),
        (cosines * heights, sines * heights, hills),
    ]
    moving = [np.concatenate(pair[:2], axis=1).astype(np.float32) for pair in fields]
    still = [rest.astype(np.float32) for *_, rest in fields]

    def frames() -> Iterator[Floats]:
        for weights in swing.astype(np.float32):
            axes = [field @ weights + rest for field, rest in zip(moving, still, strict=True)]
            yield np.stack(axes, axis=-1)

    write_npz(path, frames(), (n_frames, side * side, 3), grid_faces(side))


def subdivided(source: str, n_times: int, n_frames: int, path: Path) -> None:
    """Write a performance, forwards and backwards, with `n_times` subdivided faces."""
    coarse = meshreel.load(source)
    faces, n_verts, cuts = coarse.faces.astype(np.int64), coarse.n_verts, []
    for _ in range(n_times):
        ends, faces = quartered(faces, n_verts)
        cuts.append(ends)
        n_verts += len(ends)

    def frames() -> Iterator[Floats]:
        period = max(1, 2 * (coarse.n_frames - 1))
        for number in range(n_frames):
            phase = number % period
            frame = coarse.vertices[min(phase, period - phase)]
            for ends in cuts:
                frame = np.concatenate([frame, frame[ends].mean(axis=1)])
            yield frame

    write_npz(path, frames(), (n_frames, n_verts, 3), faces.astype(np.int32))


def write_npz(
    path: Path,
    frames: Iterable[Floats],
    shape: tuple[int, ...],
    faces: npt.NDArray[np.int32],
) -> None:
    """Write frames sequentially to an uncompressed `.npz`."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        with archive.open("vertices.npy", "w", force_zip64=True) as out:
            header = {"descr": "<f4", "fortran_order": False, "shape": shape}
            np.lib.format.write_array_header_1_0(out, header)
            for frame in frames:
                out.write(np.ascontiguousarray(frame, "<f4").tobytes())
        with archive.open("faces.npy", "w") as out:
            np.lib.format.write_array(out, faces)
        with archive.open("fps.npy", "w") as out:
            np.lib.format.write_array(out, np.array(FPS))


def grid_faces(side: int) -> npt.NDArray[np.int32]:
    """Two triangles for each square of a sheet."""
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).reshape(-1)
    squares = [corner, corner + side, corner + 1, corner + 1, corner + side, corner + side + 1]
    return np.stack(squares, axis=1).reshape(-1, 3).astype(np.int32)


def measure(path: Path, folder: Path) -> list[str]:
    """Measure a file, and return its row of the table."""
    with np.load(path) as arrays:
        n_frames, n_verts, _ = arrays["vertices"].shape
    run = partial(run_process, sys.executable, "-m", "meshreel")
    out, back = folder / "large.reel", folder / "back.npz"
    encoding = run("encode", path, "-o", out, "--force")
    decoding = run("decode", out, "-o", back, "--force")
    preview = folder / "preview.npz"
    first = run("decode", out, "-o", preview, "--modes", "8", "--frames", "0:1", "--force")
    millions = n_frames * n_verts / 1e6
    info = meshreel.info(out)
    row = [
        f"{n_verts:,} x {n_frames}", f"{max(info.n_modes)}", f"{out.stat().st_size:,}",
        f"{encoding.seconds:.1f}, {decoding.seconds:.1f}",
        f"{encoding.processor_s:.1f}, {decoding.processor_s:.1f}",
        f"{millions / encoding.seconds:.1f}, {millions / decoding.seconds:.1f}",
        f"{encoding.peak_mib:,.0f}, {decoding.peak_mib:,.0f}", f"{first.seconds:.1f}",
    ]  # fmt: skip
    for output in (back, preview):
        output.unlink()
    return row


def main() -> None:
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--vertices", type=lambda text: [int(part) for part in text.split(",")],
                        default=[10_000, 100_000, 1_000_000])  # fmt: skip
    parser.add_argument("--frames", type=int, default=200)
    parser.add_argument("--subdivided", nargs=2, metavar=("FILE", "TIMES"))
    parser.add_argument("--folder", type=Path, help="folder for the files; default: temporary")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        folder.mkdir(exist_ok=True, parents=True)
        rows = []
        for n_verts in options.vertices if not options.subdivided else [0]:
            if options.subdivided:
                source, times = options.subdivided
                path = folder / f"{Path(source).stem}-{times}-{options.frames}.npz"
                if not path.exists():
                    subdivided(source, int(times), options.frames, path)
            else:
                path = folder / f"sheet-{n_verts}-{options.frames}.npz"
                if not path.exists():
                    sheet(n_verts, options.frames, path)
            rows.append(measure(path, folder))
            print(rows[-1], flush=True)
    heads = ["vertices x frames", "modes", "bytes", "encode, decode: s", "processor s",
             "million positions per second", "peak MB", "first frame of 8 modes, s"]  # fmt: skip
    print_table("", heads, rows)


if __name__ == "__main__":
    main()
