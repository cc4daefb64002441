"""Code the same raw frames with MPEG's V-DMC test model and with meshreel: rate, distances, time.

    python bench/vdmc.py liam/ --frames 10 --encoder build/bin/encode --decoder build/bin/decode \
        --config r1=s2c2r1_sold/encoder.cfg --config r3=s2c2r3_sold/encoder.cfg
    python bench/vdmc.py samba.npz --remesh --frames 10 ...

The configurations are those that the test model's `scripts/gen-cfg.sh` writes for one of its
sequences, such as soldier; only what depends on the capture is replaced. As MPEG does with its own
sequences, positions are rounded to 12 bits for the test model. Geometry only: no texture is coded.
The encoder makes and codes texture coordinates for each intra base mesh all the same.

Prints kilobits per frame (for the test model also those of its parts), surface PSNR, D1 and D2 of
all frames as `meshreel compare` defines them, and processor seconds of the encoder per frame.
"""

import argparse
import re
import tempfile
from functools import partial
from pathlib import Path

import numpy as np

import meshreel
from measuring import run_process, start_table
from meshreel import MeshFrame, MeshSequence
from meshreel.codec.error_bounds import bound_of
from meshreel.metrics.surface_distance import compare_surfaces
from meshreel.model.extent import Extent
from meshreel.registration.register import register
from meshreel.studies.timing import timed_once
from registration import as_frame, as_segments, frames_of, remeshed

BITS = 12
"""Bits of the positions that the test model reads."""


PARTS = "intra base meshes, motion, displacements"
HEADER = ["kbit/frame", PARTS, "surface PSNR, dB", "D1, dB", "D2, dB", "processor s/frame"]


def step_of(extent: Extent) -> float:
    """Return the distance of positions of `BITS` bits along the longest side."""
    return float((extent.high - extent.low).max()) / ((1 << BITS) - 1)


def write_raw(raw: MeshSequence, extent: Extent, folder: Path) -> None:
    """Write the frames as OBJ files of integers, and a texture, which the encoder wants to read."""
    from PIL import Image

    for number, frame in enumerate(raw):
        points = np.rint((frame.vertices - extent.low) / step_of(extent))
        write_obj(folder / f"raw_{number:04d}.obj", points, frame.faces)
        Image.new("RGB", (16, 16)).save(folder / f"raw_{number:04d}.png")


def write_obj(path: Path, points: np.ndarray, faces: np.ndarray) -> None:
    """Write a mesh of integer positions."""
    with path.open("w") as file:
        np.savetxt(file, points, "v %d %d %d")
        np.savetxt(file, faces + 1, "f %d %d %d")


def read_obj(path: Path, extent: Extent) -> MeshFrame:
    """Read a decoded frame, in model units."""
    lines = [line.split() for line in path.read_text().splitlines()]
    points = np.array([line[1:4] for line in lines if line[:1] == ["v"]], float)
    faces = [[int(x.split("/")[0]) for x in line[1:4]] for line in lines if line[:1] == ["f"]]
    return as_frame(extent.low + points * step_of(extent), np.array(faces) - 1)


def cells(
    n_bytes: int, parts: str, raw: MeshSequence, other: MeshSequence, seconds: float
) -> list[str]:
    """The cells of a row below `HEADER`."""
    quality = compare_surfaces(raw, other)
    decibels = (quality.psnr_db, quality.d1_psnr_db, quality.d2_psnr_db)
    figures = (f"{figure:.2f}" for figure in (*decibels, seconds / raw.n_frames))
    return [f"{n_bytes * 8e-3 / raw.n_frames:.2f}", parts, *figures]


def code_vdmc(
    name: str, config: Path, raw: MeshSequence, arguments: argparse.Namespace, folder: Path
) -> list[str]:
    """Code the frames in a folder with the test model, decode them, and return their cells."""
    extent, stream, log = raw.extent, folder / f"{name}.vmesh", folder / f"{name}_encoder.txt"
    low, high = extent.low, extent.low + step_of(extent) * ((1 << BITS) - 1)
    usage = run_process(
        arguments.encoder,
        f"--config={config}",
        f"--srcMesh={folder}/raw_%04d.obj",
        f"--srcTex={folder}/raw_%04d.png",
        "--startFrameIndex=0",
        f"--frameCount={raw.n_frames}",
        f"--positionBitDepth={BITS}",
        f"--minPosition={' '.join(map(str, low))}",
        f"--maxPosition={' '.join(map(str, high))}",
        "--encodeTextureVideo=0",
        f"--compressed={stream}",
        log=log,
    )
    run_process(
        arguments.decoder,
        f"--compressed={stream}",
        f"--decMesh={folder}/{name}_%04d.obj",
        f"--decTex={folder}/{name}_%04d.png",
        log=folder / f"{name}_decoder.txt",
    )
    numbers = range(raw.n_frames)
    decoded = as_segments([read_obj(folder / f"{name}_{n:04d}.obj", extent) for n in numbers])
    sizes = re.findall(r"(?:Intra|Inter|V3C_GVD.*Video) = +(\d+) B", log.read_text())
    parts = ", ".join(f"{int(size) * 8e-3 / raw.n_frames:.2f}" for size in sizes)
    return cells(stream.stat().st_size, parts, raw, decoded, usage.processor_s)


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("source", help="a raw capture, or a sequence with --remesh")
    parser.add_argument("--frames", type=int, default=10)
    parser.add_argument("--remesh", action="store_true")
    parser.add_argument("--encoder", type=Path, help="the test model's `encode`")
    parser.add_argument("--decoder", type=Path, help="the test model's `decode`")
    parser.add_argument("--config", action="append", default=[], help="NAME=PATH, many times")
    parser.add_argument("--tolerance", default="0.2%")
    parser.add_argument("--quality", type=float, nargs="*", default=[60, 70, 80])
    arguments = parser.parse_args()
    frames = frames_of(arguments.source, slice(arguments.frames))
    raw = as_segments(remeshed(frames) if arguments.remesh else frames)
    extent = raw.extent
    print_row = start_table("", *HEADER)
    with tempfile.TemporaryDirectory() as folder:
        write_raw(raw, extent, Path(folder))
        for name, _, config in (text.partition("=") for text in arguments.config):
            figures = code_vdmc(name, Path(config), raw, arguments, Path(folder))
            print_row(f"V-DMC, {name}", *figures)
    tolerance = bound_of(arguments.tolerance)
    for quality in arguments.quality:
        registration, registering = timed_once(partial(register, raw, tolerance, quality=quality))
        encode = partial(meshreel.encode, registration.sequence, order="drop", tune="surface")
        data, encoding = timed_once(partial(encode, quality=quality))
        seconds = registering.processor + encoding.processor
        figures = cells(len(data), "", raw, meshreel.decode(data), seconds)
        print_row(f"meshreel, quality {quality:g}", *figures)


if __name__ == "__main__":
    main()
