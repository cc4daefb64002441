"""Measure what a film of a registered capture shows: noise, popping at cuts, sliding.

    python bench/registration_motion.py samba.npz --remesh --frames 24
    python bench/registration_motion.py liam/ --first 50 --frames 24 --cut

Prints, of the raw, registered and decoded frames, within segments and at cuts: the root mean square
of the motion along normals from frame to frame, the same of its difference from the motion of the
raw surface, and the mean change of the smooth normals, which shading shows. `--cut` registers both
halves apart, so that there is a cut. With `--remesh`, as of bench/registration.py, it prints the
distances of vertices along the surface from the points of the original that they are at in the key.
"""

import argparse
from typing import NamedTuple

import numpy as np

import meshreel
from measuring import start_table
from meshreel import MeshFrame, MeshSequence
from meshreel.arrays import Floats
from meshreel.codec.error_bounds import bound_of
from meshreel.kernel.closest import Closest
from meshreel.registration.register import Registration, register
from meshreel.registration.triangle_mesh import TriangleMesh
from registration import as_segments, frames_of, remeshed


def mesh_of(frame: MeshFrame) -> TriangleMesh:
    """Return a frame as a mesh."""
    return TriangleMesh(frame.vertices.astype(np.float64), frame.faces)


class Heights(NamedTuple):
    """Points above a surface: their heights, and the smooth normals of the surface below them."""

    heights: Floats
    normals: Floats


def heights_above(mesh: TriangleMesh, points: Floats) -> tuple[Heights, Closest]:
    """Return the signed distances of points of shape (N, 3) from a mesh."""
    result = mesh.closest(points)
    offsets = points - result.points
    signs = np.sign(np.einsum("nc,nc->n", offsets, mesh.face_normals[result.faces]))
    corners = mesh.vertex_normals[mesh.faces[result.faces]]
    normals = np.einsum("nk,nkc->nc", result.weights, corners)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return Heights(signs * result.distances, normals), result


def degrees_between(first: Floats, second: Floats) -> Floats:
    """Return the angles of unit vectors of shape (N, 3)."""
    cosines = np.einsum("nc,nc->n", first, second)
    return np.asarray(np.degrees(np.arccos(np.clip(cosines, -1, 1))))


def motion(raw: MeshSequence, other: MeshSequence) -> Floats:
    """Return motion, its difference from that of `raw`, and change of normals of each step.

    Vertices of a raw frame are compared with the raw frame before it, and the closest points of the
    other frame with the other frame before it; an array of shape (T - 1, 3), in model units and
    degrees.
    """
    rows = []
    before, other_before = mesh_of(raw[0]), mesh_of(other[0])
    for number in range(1, raw.n_frames):
        mesh, other_mesh = mesh_of(raw[number]), mesh_of(other[number])
        raw_step, _ = heights_above(before, mesh.vertices)
        here, result = heights_above(other_mesh, mesh.vertices)
        step, _ = heights_above(other_before, result.points)
        change = degrees_between(here.normals, step.normals).mean()
        squares = (np.square(x).mean() for x in (step.heights, step.heights - raw_step.heights))
        rows.append([*map(np.sqrt, squares), change])
        before, other_before = mesh, other_mesh
    return np.array(rows)


def sliding(
    found: Registration, other: MeshSequence, original: list[TriangleMesh], first: int
) -> Floats:
    """Return mean and 95 % of the distances along the surface, at all frames but keys.

    An array of shape (N, 4): frames from the key, the distances from the original points, and the
    mean change of the offset since the frame before.
    """
    rows = []
    for segment in found.segments:
        start = original[first + segment.key]
        frames = [other[first + number].vertices for number in segment.numbers]
        places = start.closest(frames[segment.key - segment.first].astype(np.float64))
        last = None
        for number, positions in zip(segment.numbers, frames, strict=True):
            mesh = original[first + number]
            points = np.einsum(
                "nk,nkc->nc", places.weights, mesh.vertices[mesh.faces[places.faces]]
            )
            offsets, normals = positions - points, mesh.face_normals[places.faces]
            offsets -= np.einsum("nc,nc->n", offsets, normals)[:, None] * normals
            lengths = np.linalg.norm(offsets, axis=1)
            step = 0.0 if last is None else np.linalg.norm(offsets - last, axis=1).mean()
            distance = abs(number - segment.key)
            rows.append([distance, lengths.mean(), np.quantile(lengths, 0.95), step])
            last = offsets
    return np.array(rows)


def main() -> None:
    """Measure, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("source", help="a raw capture, or a sequence with --remesh")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--frames", type=int, default=24)
    parser.add_argument("--tolerance", default="0.2%")
    parser.add_argument("--quality", type=float, default=80)
    parser.add_argument("--cut", action="store_true")
    parser.add_argument("--remesh", action="store_true")
    arguments = parser.parse_args()
    numbers = slice(arguments.first, arguments.first + arguments.frames)
    frames = frames_of(arguments.source, numbers)
    raw = as_segments(remeshed(frames) if arguments.remesh else frames)
    diagonal = float(np.linalg.norm(raw.extent.high - raw.extent.low))
    parts = [raw]
    if arguments.cut:
        parts = [raw[: raw.n_frames // 2], raw[raw.n_frames // 2 :]]
    tolerance = bound_of(arguments.tolerance)
    results = [register(part, tolerance, quality=arguments.quality) for part in parts]
    registered = meshreel.concatenate([result.sequence for result in results])
    stream = meshreel.encode(registered, quality=arguments.quality, order="keep")
    decoded = meshreel.decode(stream)
    cuts = np.isin(np.arange(1, raw.n_frames), registered.starts)
    header = ["motion, %", "difference from raw, %", "change of normals, degrees"]
    print_row = start_table("", *header)
    for name, other in (("raw", raw), ("registered", registered), ("decoded", decoded)):
        rows = motion(raw, other) * [100 / diagonal, 100 / diagonal, 1]
        for place, mask in (("within segments", ~cuts), ("at cuts", cuts)):
            if mask.any():
                print_row(f"{name}, {place}", *(f"{x:.3f}" for x in rows[mask].mean(axis=0)))
    if not arguments.remesh:
        return
    original, first = [mesh_of(frame) for frame in frames], 0
    print()
    header = ["along the surface, %", "95 %, %", "per frame, %"]
    print_row = start_table("frames from the key", *header)
    for result in results:
        for distance, *lengths in sliding(result, decoded, original, first):
            cells = (f"{100 * length / diagonal:.3f}" for length in lengths)
            print_row(f"{distance:.0f}", *cells)
        first += result.sequence.n_frames


if __name__ == "__main__":
    main()
