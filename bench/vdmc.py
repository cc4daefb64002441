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
import resource
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

import meshreel
from meshreel import MeshFrame, MeshSequence
from meshreel.codec.error_bounds import bound_of
from meshreel.metrics.surface_distance import compare_surfaces
from meshreel.model.extent import Extent
from meshreel.registration.register import register
from registration import as_frame, as_segments, frames_of, remeshed

BITS = 12
"""Bits of the positions that the test model reads."""


def run(log: Path, *command: object) -> float:
    """Run a command, which writes to `log`, and return its processor seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with log.open("w") as output:
        subprocess.run([*map(str, command)], stdout=output, stderr=output, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return float(after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime)


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


def show(
    name: str, n_bytes: int, parts: str, raw: MeshSequence, other: MeshSequence, seconds: float
) -> None:
    """Print a row."""
    quality = compare_surfaces(raw, other)
    print(f"| {name} | {n_bytes * 8e-3 / raw.n_frames:.2f} | {parts} | {quality.psnr_db:.2f} | "
          f"{quality.d1_psnr_db:.2f} | {quality.d2_psnr_db:.2f} | {seconds / raw.n_frames:.2f} |",
          flush=True)  # fmt: skip


def code_vdmc(
    name: str, config: Path, raw: MeshSequence, arguments: argparse.Namespace, folder: Path
) -> None:
    """Code the frames in a folder with the test model, decode them, and print a row."""
    extent, stream, log = raw.extent, folder / f"{name}.vmesh", folder / f"{name}_encoder.txt"
    low, high = extent.low, extent.low + step_of(extent) * ((1 << BITS) - 1)
    seconds = run(
        log,
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
    )
    run(
        folder / f"{name}_decoder.txt",
        arguments.decoder,
        f"--compressed={stream}",
        f"--decMesh={folder}/{name}_%04d.obj",
        f"--decTex={folder}/{name}_%04d.png",
    )
    numbers = range(raw.n_frames)
    decoded = as_segments([read_obj(folder / f"{name}_{n:04d}.obj", extent) for n in numbers])
    sizes = re.findall(r"(?:Intra|Inter|V3C_GVD.*Video) = +(\d+) B", log.read_text())
    parts = ", ".join(f"{int(size) * 8e-3 / raw.n_frames:.2f}" for size in sizes)
    show(f"V-DMC, {name}", stream.stat().st_size, parts, raw, decoded, seconds)


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
    print("| | kbit/frame | intra base meshes, motion, displacements | surface PSNR, dB | D1, dB "
          "| D2, dB | processor s/frame |\n|---|---|---|---|---|---|---|")  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        write_raw(raw, extent, Path(folder))
        for name, _, config in (one.partition("=") for one in arguments.config):
            code_vdmc(name, Path(config), raw, arguments, Path(folder))
    begin = time.process_time()
    registered = register(raw, bound_of(arguments.tolerance)).sequence
    registering = time.process_time() - begin
    for quality in arguments.quality:
        begin = time.process_time()
        data = meshreel.encode(registered, quality=quality, order="drop")
        seconds = registering + time.process_time() - begin
        show(f"meshreel, quality {quality:g}", len(data), "", raw, meshreel.decode(data), seconds)


if __name__ == "__main__":
    main()
