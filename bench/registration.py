"""Register a raw capture; measure rate and surface distance against Draco per frame.

    python bench/registration.py liam/ --frames 40
    python bench/registration.py samba.npz --remesh --frames 24
    python bench/registration.py 'collision/*.obj' --tolerance 0.3%

Prints the segments, the processor seconds, and for each quality kilobits per frame with the surface
PSNR of evenly spaced frames; the same for Draco at several bits. Geometry only: attributes are left
out. `--remesh` gives each frame of a sequence another mesh (isotropic remeshing of pymeshlab, edges
of 0.87 to 0.93 of the mean length), so that the original is known; it is measured too.
"""

import argparse
import os
import time
from collections.abc import Sequence

os.environ.setdefault("MESHREEL_THREADS", "1")

import DracoPy
import numpy as np
import numpy.typing as npt

import meshreel
from meshreel import MeshFrame, MeshSequence, SegmentedSequence
from meshreel.codec.error_bounds import bound_of
from meshreel.formats.load import load_any
from meshreel.formats.options import ReadOptions
from meshreel.model.segments import segments_of
from meshreel.registration.register import register
from meshreel.registration.triangle_mesh import TriangleMesh
from meshreel.registration.verification import Tolerance, measure

LENGTHS = 0.87, 0.93


def as_segments(frames: Sequence[MeshFrame]) -> SegmentedSequence:
    """Return one segment per frame."""
    return SegmentedSequence(MeshSequence(one.vertices[None], one.faces, 30.0) for one in frames)


def remeshed(frames: Sequence[MeshFrame]) -> list[MeshFrame]:
    """Return each frame with a new mesh of the same surface."""
    import pymeshlab

    first, rng = frames[0], np.random.default_rng(1)
    corners = first.vertices[first.faces].astype(np.float64)
    mean = float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())
    result = []
    for one in frames:
        meshes = pymeshlab.MeshSet()
        meshes.add_mesh(pymeshlab.Mesh(one.vertices.astype(np.float64), one.faces))
        length = pymeshlab.PureValue(mean * rng.uniform(*LENGTHS))
        meshes.meshing_isotropic_explicit_remeshing(iterations=4, targetlen=length, featuredeg=60)
        mesh = meshes.current_mesh()
        result.append(as_frame(mesh.vertex_matrix(), mesh.face_matrix()))
    return result


def as_frame(vertices: npt.NDArray[np.floating], faces: npt.NDArray[np.integer]) -> MeshFrame:
    """Return a frame of the types of a sequence."""
    return MeshFrame(np.asarray(vertices, np.float32), np.asarray(faces, np.int32))


def psnr(raw: SegmentedSequence, other: SegmentedSequence, every: int) -> float:
    """Return the surface PSNR of evenly spaced frames, in dB."""
    low, high = raw.extent.low, raw.extent.high
    scale = float((high - low).max())
    squares = []
    for number in range(0, raw.n_frames, every):
        frames = raw.frame(number), other.frame(number)
        first, second = (TriangleMesh((one.vertices - low) / scale, one.faces) for one in frames)
        squares.append(measure(second, first, Tolerance(1.0)).mean_square)
    return float(10 * np.log10(3 / np.mean(squares)))


def draco(raw: SegmentedSequence, bits: int) -> tuple[int, SegmentedSequence]:
    """Return the bytes of all frames, coded by Draco on one grid, and the decoded frames."""
    low, high = raw.extent.low, raw.extent.high
    streams = [
        DracoPy.encode(
            one.vertices,
            one.faces,
            quantization_bits=bits,
            compression_level=10,
            quantization_range=float((high - low).max()),
            quantization_origin=low.tolist(),
        )
        for one in raw
    ]
    decoded = map(DracoPy.decode, streams)
    return sum(map(len, streams)), as_segments([as_frame(x.points, x.faces) for x in decoded])


def show(name: str, n_bytes: int, n_frames: int, db: float) -> None:
    """Print a row: kilobits per frame, megabits per second at 30 frames per second, PSNR."""
    kilobits = n_bytes * 8e-3 / n_frames
    print(f"| {name} | {kilobits:.2f} | {kilobits * 0.03:.3f} | {db:.2f} |", flush=True)


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("source", help="a raw capture, or a sequence with --remesh")
    parser.add_argument("--frames", type=int, help="number of frames [default: all]")
    parser.add_argument("--every", type=int, default=6, help="distance of measured frames")
    parser.add_argument("--tolerance", default="0.2%")
    parser.add_argument("--quality", type=float, nargs="*", default=[60, 70, 80])
    parser.add_argument("--bits", type=int, nargs="*", default=[9, 10])
    parser.add_argument("--remesh", action="store_true")
    arguments = parser.parse_args()
    options = ReadOptions(attributes="none", matches_frames=False)
    given = load_any(arguments.source, options)
    sequence = SegmentedSequence(segments_of(given))
    n_frames = arguments.frames or sequence.n_frames
    frames = [sequence.frame(number) for number in range(n_frames)]
    raw = as_segments(remeshed(frames) if arguments.remesh else frames)
    begin = time.process_time()
    found = register(raw, bound_of(arguments.tolerance))
    seconds = (time.process_time() - begin) / raw.n_frames
    n_verts = np.mean([one.n_verts for one in raw.segments])
    print(f"{raw.n_frames} frames of {n_verts:.0f} vertices: segments of "
          f"{[one.n_frames for one in found.sequence.segments]} frames, {seconds:.2f} processor "
          f"seconds per frame, {1e4 * seconds / n_verts:.2f} per 10,000 vertices; registered: "
          f"{found.distances}; {found.distances.n_folded} folded faces")  # fmt: skip
    print("| | kbit/frame | Mbit/s | surface PSNR, dB |\n|---|---|---|---|")
    show("registered, not coded", 0, 1, psnr(raw, found.sequence, arguments.every))
    for quality in arguments.quality:
        data = meshreel.encode(found.sequence, quality=quality, order="drop")
        db = psnr(raw, meshreel.decode_segments(data), arguments.every)
        show(f"quality {quality:g}", len(data), raw.n_frames, db)
        if arguments.remesh:
            positions = np.stack([one.vertices for one in frames]).astype(np.float32)
            original = MeshSequence(positions, frames[0].faces, 30.0)
            data = meshreel.encode(original, quality=quality, order="drop")
            db = psnr(as_segments(frames), meshreel.decode_segments(data), arguments.every)
            show(f"original at quality {quality:g}", len(data), raw.n_frames, db)
    for bits in arguments.bits:
        n_bytes, decoded = draco(raw, bits)
        show(f"Draco, {bits} bits", n_bytes, raw.n_frames, psnr(raw, decoded, arguments.every))


if __name__ == "__main__":
    main()
