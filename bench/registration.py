"""Register a raw capture; measure rate and surface distance against Draco per frame.

    python bench/registration.py liam/ --frames 40
    python bench/registration.py samba.npz --remesh --frames 24
    python bench/registration.py samba.npz --remesh --frames 24 --holes 33 --noise 0.3 --limbs
    python bench/registration.py 'collision/*.obj' --tolerance 0.3%
    python bench/registration.py dancer/ --quality 70 80 90 --bits --decimate
    python bench/registration.py dancer/ --quality 50 60 70 80 90 --tune visual surface --bits

Prints the segments, the processor seconds, and for each quality kilobits per frame with the
surface PSNR of evenly spaced frames; the same for Draco at several bits. Geometry only:
attributes are left out. `--remesh` gives each frame of a sequence another mesh (isotropic
remeshing of pymeshlab, edges of 0.87 to 0.93 of the mean length), so that the original is known;
it is measured too. `--holes` cuts six holes of a width in tolerances out of each of these frames,
which move along the surface by three edges per frame; `--limbs` also cuts off one end of the
body, 80 tolerances wide, another one in each frame; `--noise` moves vertices by a standard
deviation in tolerances. `--decimate` gives shares of the faces to which quadric edge collapses
(pymeshlab) reduce the measured frames before Draco codes them at every number of bits; printed is
the least rate, on the envelope of all of them, at the surface PSNR of each quality.

The angle between smooth normals is that at the face centroids of the raw frame. With several
tunes, the bits of each relative to the first are printed, at equal surface PSNR and equal angle
(BD-rate).

D2 is that of TVMC (evaluation.py of its repository): distances from the
vertices of the original to the closest decoded vertices, along their normals; the peak is the
diagonal of the frame's box. It is no metric of MPEG, and its samples are the vertices.
"""

import argparse
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial

import DracoPy
import numpy as np
import numpy.typing as npt

import meshreel
from measuring import start_table
from meshreel import MeshFrame, MeshSequence
from meshreel.codec.error_bounds import bound_of
from meshreel.formats.load import load_any
from meshreel.formats.options import Reading
from meshreel.metrics.closest_points import k_d_tree
from meshreel.model.extent import Extent
from meshreel.model.geometry.normals import unit
from meshreel.registration.register import Registration, register
from meshreel.registration.triangle_mesh import TriangleMesh
from meshreel.registration.verification import Tolerance, measure
from meshreel.studies.rate_distortion import bd_rate, rate_at_error
from meshreel.studies.timing import timed_once

LENGTHS = 0.87, 0.93
N_HOLES, EDGES_PER_FRAME, LIMB_WIDTH = 6, 3.0, 80.0
DECIMATION = "meshing_decimation_quadric_edge_collapse"


def as_segments(frames: Sequence[MeshFrame]) -> MeshSequence:
    """Return one segment per frame."""
    return MeshSequence.of_segments(
        MeshSequence(frame.vertices[None], frame.faces, 30.0) for frame in frames
    )


def frames_of(source: str, numbers: slice) -> list[MeshFrame]:
    """Return frames of a raw capture, or of a sequence, without attributes."""
    given = load_any(source, Reading(attributes="none", matches_frames=False))
    sequence = MeshSequence.of_segments(given.segments)
    return [sequence[number] for number in range(sequence.n_frames)[numbers]]


def chosen(sequence: MeshSequence, numbers: Iterable[int]) -> MeshSequence:
    """Return the frames of these numbers, one segment per frame."""
    return as_segments([sequence[number] for number in numbers])


def remeshed(frames: Sequence[MeshFrame], edges: tuple[float, float] = LENGTHS) -> list[MeshFrame]:
    """Return each frame with a new mesh of the same surface; `edges` are in mean lengths."""
    first, rng = frames[0], np.random.default_rng(1)
    corners = first.vertices[first.faces].astype(np.float64)
    mean = float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())
    options = {"iterations": 4, "featuredeg": 60}
    lengths = [mean * rng.uniform(*edges) for _ in frames]
    return [
        filtered(frame, "meshing_isotropic_explicit_remeshing", targetlen=length, **options)
        for frame, length in zip(frames, lengths, strict=True)
    ]


def scanned(
    frames: Sequence[MeshFrame],
    originals: Sequence[MeshFrame],
    *,
    hole: float,
    limb: float,
    noise: float,
) -> list[MeshFrame]:
    """Return frames with holes and without one of their ends, if these have a width, and noise.

    Parameters
    ----------
    originals : sequence of MeshFrame
        The frames with the faces of the first.
    hole, limb, noise : float
        In model units.
    """
    rng, first = np.random.default_rng(0), originals[0]
    rest = first.vertices.astype(np.float64)
    corners = rest[first.faces]
    stride = EDGES_PER_FRAME * np.linalg.norm(corners[:, 0] - corners[:, 1], axis=1).mean()
    axes, normals = rng.normal(size=(N_HOLES, 3)), TriangleMesh(rest, first.faces).vertex_normals
    centers = rng.integers(0, len(rest), N_HOLES)
    ends = np.concatenate([rest.argmin(axis=0), rest.argmax(axis=0)])
    results = []
    for number, (frame, original) in enumerate(zip(frames, originals, strict=True)):
        cuts = [(center, hole / 2) for center in centers] + [(ends[number % len(ends)], limb / 2)]
        middles = frame.vertices[frame.faces].mean(axis=1)
        is_kept = np.ones(len(middles), bool)
        for center, radius in cuts:
            is_kept &= np.linalg.norm(middles - original.vertices[center], axis=1) > radius
        used, numbers = np.unique(frame.faces[is_kept], return_inverse=True)
        moved = frame.vertices[used] + rng.normal(0.0, noise, (len(used), 3))
        results.append(as_frame(moved, numbers.reshape(-1, 3)))
        along = np.cross(normals[centers], axes)  # around the body
        along *= stride / np.linalg.norm(along, axis=1, keepdims=True)
        centers = k_d_tree(rest).query(rest[centers] + along)[1]
    return results


def filtered(frame: MeshFrame, name: str, **options: float) -> MeshFrame:
    """Return a frame after a filter of pymeshlab, welded; `targetlen` is a length, not percent."""
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(frame.vertices.astype(np.float64), frame.faces))
    if length := options.get("targetlen"):
        options["targetlen"] = pymeshlab.PureValue(length)
    meshes.meshing_remove_duplicate_vertices()
    getattr(meshes, name)(**options)
    mesh = meshes.current_mesh()
    return as_frame(mesh.vertex_matrix(), mesh.face_matrix())


def as_frame(vertices: npt.NDArray[np.floating], faces: npt.NDArray[np.integer]) -> MeshFrame:
    """Return a frame of the types of a sequence."""
    return MeshFrame(np.asarray(vertices, np.float32), np.asarray(faces, np.int32))


def errors(raw: MeshSequence, other: MeshSequence, extent: Extent) -> tuple[float, float, float]:
    """Return the surface PSNR of all frames, the mean of TVMC's D2 of unequal ones, both in dB, and
    the mean angle between smooth normals in degrees."""
    scale = float((extent.high - extent.low).max())
    squares, d2, angles = [], [], []
    for frames in zip(raw, other, strict=True):
        first, second = (
            TriangleMesh((frame.vertices - extent.low) / scale, frame.faces) for frame in frames
        )
        squares.append(measure(second, first, Tolerance(1.0)).mean_square)
        d2.append(d2_of_vertices(first, second))
        angles.append(angle_of_normals(first, second))
    mean_d2 = float(np.mean([x for x in d2 if x < 200]))
    return float(10 * np.log10(3 / np.mean(squares))), mean_d2, float(np.mean(angles))


def angle_of_normals(original: TriangleMesh, decoded: TriangleMesh) -> float:
    """Return the mean angle between interpolated normals at face centroids, in degrees.

    Angles above 60 degrees are left out: there the closest point is on another part.
    """
    closest = decoded.closest(original.centroids)
    first = original.vertex_normals[original.faces].mean(axis=1)
    corners = decoded.vertex_normals[decoded.faces[closest.faces]]
    second = np.einsum("nk,nkc->nc", closest.weights, corners)
    cosines = np.einsum("nc,nc->n", unit(first), unit(second))
    angles = np.degrees(np.arccos(np.clip(cosines, -1, 1)))
    return float(np.average(angles, weights=original.areas * (angles < 60)))


def d2_of_vertices(original: TriangleMesh, decoded: TriangleMesh) -> float:
    """Return D2 of TVMC, in dB."""
    closest = k_d_tree(decoded.vertices).query(original.vertices)[1]
    offsets = original.vertices - decoded.vertices[closest]
    heights = np.einsum("nc,nc->n", offsets, decoded.vertex_normals[closest])
    peak = np.ptp(original.vertices, axis=0)
    return float(10 * np.log10(peak @ peak / max(np.mean(heights**2), 1e-30)))


def draco(frames: Iterable[MeshFrame], bits: int, extent: Extent) -> tuple[int, MeshSequence]:
    """Return the bytes of all frames, coded by Draco on one grid, and the decoded frames."""
    low, high = extent.low, extent.high
    streams = [
        DracoPy.encode(
            frame.vertices,
            frame.faces,
            quantization_bits=bits,
            compression_level=10,
            quantization_range=float((high - low).max()),
            quantization_origin=low.tolist(),
        )
        for frame in frames
    ]
    decoded = map(DracoPy.decode, streams)
    return sum(map(len, streams)), as_segments([as_frame(x.points, x.faces) for x in decoded])


HEADER = ["", "kbit/frame", "Mbit/s", "surface PSNR, dB", "D2 of TVMC, dB", "normals, degrees"]
"""Megabits at 30 frames per second."""

Row = tuple[float, float, float, float]
"""Kilobits per frame and three measures."""


def rms(db: float) -> float:
    """Return the root mean square distance of a surface PSNR, in longest sides of the box."""
    return float(np.sqrt(3.0) * 10 ** (-db / 20))


def differences(curves: Mapping[str, Sequence[Row]]) -> Iterator[str]:
    """Yield a line on each tune but the first: its bits relative to those of the first."""
    (_, first), *others = curves.items()
    for tune, rows in others:
        by_psnr, by_angle = (
            bd_rate([measure(row) for row in rows], [measure(row) for row in first])
            for measure in (lambda row: (row[0], rms(row[1])), lambda row: (row[0], row[3]))
        )
        at_psnr, at_angle = (
            "no common errors" if rate.percent is None else f"{rate.percent:+.1f} % of the bits"
            for rate in (by_psnr, by_angle)
        )
        yield f"{tune}: at equal PSNR {at_psnr}, at equal angle {at_angle}"


def summary(registered: Registration, seconds: float) -> str:
    """Return the segments of a registration, its processor time and its distances."""
    raw, sequence = registered.raw, registered.sequence
    n_verts = float(np.mean([segment.n_verts for segment in raw.segments]))
    segments = ", ".join(f"{each.n_frames} x {each.n_verts}" for each in sequence.segments)
    per_frame = seconds / raw.n_frames
    return (
        f"{raw.n_frames} frames of {n_verts:.0f} vertices: frames and vertices of segments "
        f"{segments}; {per_frame:.2f} processor seconds per frame, "
        f"{1e4 * per_frame / n_verts:.2f} per 10,000 vertices; {registered.distances}; "
        f"{registered.distances.n_folded} folded faces"
    )


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("source", help="a raw capture, or a sequence with --remesh")
    parser.add_argument("--frames", type=int, help="number of frames [default: all]")
    parser.add_argument("--every", type=int, default=6, help="distance of measured frames")
    parser.add_argument("--tolerance", default="0.2%")
    parser.add_argument("--quality", type=float, nargs="*", default=[60, 70, 80])
    parser.add_argument("--tune", nargs="*", default=["surface"])
    parser.add_argument("--bits", type=int, nargs="*", default=[9, 10])
    parser.add_argument("--remesh", action="store_true")
    parser.add_argument("--holes", type=float, default=0.0, help="width in tolerances")
    parser.add_argument("--noise", type=float, default=0.0, help="in tolerances")
    parser.add_argument("--limbs", action="store_true", help="cut off an end of each frame")
    parser.add_argument("--decimate", type=float, nargs="*", default=[], help="shares of the faces")
    arguments = parser.parse_args()
    frames = frames_of(arguments.source, slice(arguments.frames))
    n_frames = len(frames)
    raw = as_segments(remeshed(frames) if arguments.remesh else frames)
    if arguments.holes or arguments.noise or arguments.limbs:
        if not arguments.remesh:
            parser.error("--holes, --noise and --limbs need --remesh")
        diagonal = float(np.linalg.norm(raw.extent.high - raw.extent.low))
        length = bound_of(arguments.tolerance).percent(diagonal) / 100.0 * diagonal
        raw = as_segments(
            scanned(
                list(raw),
                frames,
                hole=arguments.holes * length,
                limb=LIMB_WIDTH * length * arguments.limbs,
                noise=arguments.noise * length,
            )
        )
    measured, extent = range(0, n_frames, arguments.every), raw.extent
    results: dict[float, MeshSequence] = {}
    for quality in arguments.quality:
        registering = partial(register, raw, tolerance=arguments.tolerance, quality=quality)
        registered, times = timed_once(registering)
        results[quality] = registered.sequence
        print(f"quality {quality:g}: {summary(registered, times.processor)}")
    print_row = start_table(*HEADER)

    def show(name: str, kilobits: float, db: float, d2: float, degrees: float) -> None:
        rate = f"{kilobits:.2f}", f"{kilobits * 0.03:.3f}"
        print_row(name, *rate, f"{db:.2f}", f"{d2:.2f}", f"{degrees:.2f}")

    targets = chosen(raw, measured)
    curves: dict[str, list[Row]] = {tune: [] for tune in arguments.tune}
    for quality, sequence in results.items():
        measures = errors(targets, chosen(sequence, measured), extent)
        show(f"registered for quality {quality:g}, not coded", 0, *measures)
        for tune, rows in curves.items():
            data = meshreel.encode(sequence, quality=quality, order="drop", tune=tune)
            decoded = chosen(meshreel.decode(data), measured)
            rows.append((len(data) * 8e-3 / n_frames, *errors(targets, decoded, extent)))
            show(f"{tune}, quality {quality:g}", *rows[-1])
        if arguments.remesh:
            positions = np.stack([frame.vertices for frame in frames]).astype(np.float32)
            original = MeshSequence(positions, frames[0].faces, 30.0)
            data = meshreel.encode(original, quality=quality, order="drop")
            exact, decoded = as_segments(frames), meshreel.decode(data)
            measures = errors(chosen(exact, measured), chosen(decoded, measured), extent)
            show(f"original at quality {quality:g}", len(data) * 8e-3 / n_frames, *measures)
    print(*differences(curves), sep="\n")
    points = []
    for share in (1.0, *arguments.decimate):
        coarse = list(targets)
        if share < 1:
            coarse = [filtered(frame, DECIMATION, targetperc=share) for frame in coarse]
        for bits in arguments.bits:
            n_bytes, decoded = draco(coarse, bits, extent)
            kilobits, measures = n_bytes * 8e-3 / len(measured), errors(targets, decoded, extent)
            name = f"Draco, {100 * share:g} % of the faces, {bits} bits"
            show(name, kilobits, *measures)
            points.append((kilobits, rms(measures[0])))
    for _, db, *_ in curves[arguments.tune[-1]]:
        least = rate_at_error(points, rms(db))
        rate = "outside the measured range" if least is None else f"{least:.1f} kbit per frame"
        print(f"Draco at {db:.1f} dB: {rate}")


if __name__ == "__main__":
    main()
